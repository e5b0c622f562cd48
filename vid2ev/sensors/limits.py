"""What every sensor can be: its kind, its size, its seed, its number in a rig, its threads; and when it sees."""

from __future__ import annotations

import operator
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import PIXEL_LIMIT
from vid2ev.requests import is_whole

LONGEST_SIDE = 65535  # columns and rows of events are uint16


def check_spec(spec: Any, kind: type, example: str) -> None:
    """Raise UsageError for what is not of a kind of parameters."""
    if not isinstance(spec, kind):
        raise UsageError(f"spec {spec!r}: expected a {kind.__name__}, such as {example} gives")


def check_sensor(size: tuple[int, int], seed: int, camera: int, threads: int) -> tuple[int, int]:
    """The size as plain numbers, whose products are exact; raises UsageError for what no sensor can be."""
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError) as error:
        raise UsageError(f"size {size!r}: expected (width, height), two whole numbers of pixels") from error
    if width < 1 or height < 1 or width * height > PIXEL_LIMIT or max(width, height) > LONGEST_SIDE:
        raise UsageError(
            f"size {width}x{height}: expected 1x1 to {PIXEL_LIMIT} pixels in all, and {LONGEST_SIDE} a side at most;"
            " scale the frames down"
        )
    check_seed(seed)
    if not is_whole(camera, 0, (1 << 24) - 1):
        raise UsageError(f"camera {camera!r}: expected a whole number from 0 to 2**24 - 1")
    check_threads(threads)
    return width, height


def check_threads(threads: int) -> None:
    """Raise UsageError for what is no number of threads."""
    if not is_whole(threads, 1):
        raise UsageError(f"threads {threads!r}: expected a whole number of at least 1; leave it out")


def check_seed(seed: int) -> None:
    """Raise UsageError for what is no seed."""
    if not is_whole(seed, 0, (1 << 64) - 1):
        raise UsageError(f"seed {seed!r}: expected a whole number from 0 to 2**64 - 1")


def time_ns(t_ns: Any, name: str = "frame time") -> int:
    """The time of a frame, or another of this name; raises UsageError for what is none."""
    try:
        if isinstance(t_ns, str | bytes):
            raise TypeError
        whole = int(t_ns)
        if whole != t_ns or abs(whole) >= 1 << 63:
            raise ValueError
        return whole
    except (TypeError, ValueError, OverflowError) as error:
        raise UsageError(f"{name} {t_ns!r}: expected a whole number of nanoseconds, below 2**63") from error
