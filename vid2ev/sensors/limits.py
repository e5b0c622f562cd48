"""What every sensor can be: its size, its seed, its number in a rig, its threads."""

from __future__ import annotations

import operator

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import PIXEL_LIMIT

LONGEST_SIDE = 65535  # columns and rows of events are uint16


def check_sensor(size: tuple[int, int], seed: int, camera: int, threads: int) -> None:
    """Raise UsageError for what no sensor can be."""
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError) as error:
        raise UsageError(f"size {size!r}: expected (width, height), two whole numbers of pixels") from error
    if width < 1 or height < 1 or width * height > PIXEL_LIMIT or max(width, height) > LONGEST_SIDE:
        raise UsageError(
            f"size {width}x{height}: expected 1x1 to {PIXEL_LIMIT} pixels in all, and {LONGEST_SIDE} a side at most;"
            " scale the frames down"
        )
    if not 0 <= seed < 1 << 64 or not 0 <= camera < 1 << 24:
        raise UsageError(f"seed {seed}, camera {camera}: expected 0 to 2**64 - 1 and 0 to 2**24 - 1")
    if threads < 1:
        raise UsageError(f"threads {threads}: expected at least 1; leave it out for one")
