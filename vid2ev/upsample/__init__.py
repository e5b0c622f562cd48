"""Denser in time: frames of light between the frames of the source.

A new method is a class that satisfies `Upsampler`, in a module of its own, and a line in `make_upsampler`; other
packages can add theirs (`registered.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Protocol

from vid2ev.errors import UsageError
from vid2ev.requests import is_whole
from vid2ev.stream.frames import Frame
from vid2ev.stream.upload import Upload
from vid2ev.upsample.registered import other, others

__all__ = ["METHODS", "Interval", "Subframes", "Upsampler", "make_upsampler"]

METHODS = ("none", "linear", "flow")
MOST = 1 << 16  # steps of an interval: their instants are in memory at once
Subframes = int | Literal["auto"]


@dataclass(frozen=True, slots=True)
class Interval:
    """The frames after one frame of the source up to and including the next, in order of time, once."""

    frames: Iterator[Frame]
    limited: bool = False  # it asked for more than max_subframes
    shift_px: float | None = None  # how far things move in it, where that was looked at

    def __iter__(self) -> Iterator[Frame]:
        return self.frames


class Upsampler(Protocol):
    """Fills the intervals between frames."""

    def between(self, a: Frame, b: Frame) -> Interval:
        """The frames after a up to and including b.

        The last one is b, its very light; it is the only one with `original`.  What comes out depends
        on a and b alone, so that a recording can be taken up in the middle.  a and b have one shape, and a
        comes before b.  Motion is estimated at once, frames are made when they are asked for: two threads can share
        the work.
        """


def make_upsampler(
    method: str,
    subframes: Subframes = "auto",
    max_subframes: int = 64,
    threshold: float = 0.15,
    upload: Upload | None = None,
) -> Upsampler:
    """The upsampler of a name.

    none     the frames of the source and nothing else
    linear   cross-fades in linear light; "auto" adds nothing, because a sensor takes light to go straight anyway
    flow     light carried along the motion between the frames (dense optical flow)
    others   those of other packages, such as `net` of interp, a trained network; after a colon comes what they take

    subframes      steps per interval, or "auto": what motion and contrast call for (`subframes.py`), one if still
    max_subframes  the most that "auto" may take
    threshold      contrast threshold of the sensor [nat]: what changes much less asks for no frames
    upload         to the device on which frames are made, as tensors; frames of the source may stay as they are

    Raises UsageError for an unknown method or a number that cannot be meant.
    """
    found = None if method in METHODS else other(method)
    if method not in METHODS and found is None:
        raise UsageError(f"upsampling '{method}': expected one of {', '.join([*METHODS, *others()])}")
    if subframes != "auto" and not is_whole(subframes, 1, MOST):
        raise UsageError(f"subframes {subframes}: expected a whole number from 1 to {MOST}, or auto")
    if not is_whole(max_subframes, 1, MOST) or not threshold > 0:
        raise UsageError(
            f"max_subframes {max_subframes}, threshold {threshold}: expected a whole number from 1 to {MOST}, and more"
            " than 0"
        )
    if found is not None:
        make, rest = found
        return make(rest, subframes, max_subframes, threshold, upload)  # type: ignore[no-any-return]
    if method == "none":
        from vid2ev.upsample.none import NoUpsampling

        return NoUpsampling()
    if method == "linear":
        from vid2ev.upsample.linear import LinearUpsampling

        return LinearUpsampling(1 if subframes == "auto" else subframes, upload)
    if method == "flow":
        from vid2ev.upsample.flow import FlowUpsampling

        return FlowUpsampling(subframes, max_subframes, threshold, upload)
    raise NotImplementedError(f"upsampling '{method}' is one of METHODS, and nothing is made of it here")
