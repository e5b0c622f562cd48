"""How events are seen: cut into slices, and each slice made an array or a picture."""

from vid2ev.kernel_cache import mark_our_kernels

mark_our_kernels()
