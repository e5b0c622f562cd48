"""The ray caster's law, pixel by pixel, as scalar functions; `walk` calls them for all pixels of a picture."""

from vid2ev.compiling.cache import drop_stale_kernels

drop_stale_kernels()
