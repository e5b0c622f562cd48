"""What every sensor can be: its size, its seed, its number in a rig, its threads."""

from __future__ import annotations

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import PIXEL_LIMIT


def check_sensor(size: tuple[int, int], seed: int, camera: int, threads: int) -> None:
    """Raise UsageError for what no sensor can be."""
    width, height = size
    if width < 1 or height < 1 or width * height > PIXEL_LIMIT or max(width, height) > 65535:
        raise UsageError(f"size {width}x{height}: expected 1x1 to {PIXEL_LIMIT} pixels in all; scale the frames down")
    if not 0 <= seed < 1 << 64 or not 0 <= camera < 1 << 24:
        raise UsageError(f"seed {seed}, camera {camera}: expected 0 to 2**64 - 1 and 0 to 2**24 - 1")
    if threads < 1:
        raise UsageError(f"threads {threads}: expected at least 1; leave it out for one")
