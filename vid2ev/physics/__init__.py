"""What happens to the light: one file per effect, in the order light travels; `random` is noise as a function."""

from vid2ev.compiling.cache import drop_stale_kernels

drop_stale_kernels()
