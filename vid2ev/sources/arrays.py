"""A stack of frames in a .npy or .npz: [N, H, W] grey or [N, H, W, 3] red, green, blue; uint8, uint16 or floats.

Floating point is linear light unless a transfer is given.  For uint8 and uint16 a transfer must be given: nothing in
the file says what its codes mean.  Times come from fps, from the archive itself (`stacks.py` says where), or from a
file beside it: for `clip.npy`, from `clip_timestamps.npy` or `clip_timestamps.txt` (`times.py` has the rule for the
unit).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.pictures import OF_CODES, TYPES, PictureReader
from vid2ev.sources.stacks import NpyStack, NpzStack, Stack
from vid2ev.sources.times import (
    Clock,
    digest_of,
    expected_duration_s,
    parse_fps,
    remarks_on_unit,
    stamps_beside,
    stamps_of_array,
    times_beside,
)
from vid2ev.stream.frames import Colour, Frame
from vid2ev.terminal import counted


class ArrayStack:
    """Frames of a stack, read from disk one at a time.

    Raises DataError for a stack that is no such thing, UsageError without times or, for codes, without a
    transfer.
    """

    rewindable = True
    kept = None
    dense = False

    def __init__(
        self,
        path: str | Path,
        stack: Stack | None = None,
        *,
        transfer: str = "auto",
        fps: float | Fraction | None = None,
        colour: Colour = "luminance",
    ):
        self.path = Path(path)
        self.warnings: list[str] = []
        self._stack = stack = NpyStack(self.path) if stack is None else stack
        shape, dtype = stack.shape, stack.dtype
        if len(shape) not in (3, 4) or min(shape) < 1 or (len(shape) == 4 and shape[3] != 3):
            raise DataError(
                f"{self.path}: array of shape {shape}, expected [N, H, W] or [N, H, W, 3], each at least 1; bring it"
                " into that shape"
            )
        if dtype.newbyteorder("=") not in (np.uint8, np.uint16) and dtype.kind != "f":
            raise DataError(f"{self.path}: array of type {dtype}, expected {TYPES}")
        if transfer == "auto" and dtype.kind != "f":
            raise UsageError(f"{self.path}: {dtype} codes that may mean anything; say what with --transfer {OF_CODES}")
        self._reader = PictureReader("linear" if transfer == "auto" else transfer, colour)
        with stack.opened() as read:
            self.warnings += self._reader.remarks_on(read(0))
        self.size = (shape[2], shape[1])
        self.frames_expected: int | None = shape[0]
        self._fps = None if fps is None else parse_fps(fps)
        self._stamps: list[Fraction] = []
        self._unit: str | None = None
        if fps is None:
            self._find_times()
        self.duration_expected_s = expected_duration_s(self._stamps, self._fps, shape[0])

    def describe(self) -> dict[str, Any]:
        """Facts about the file, for the manifest."""
        return {
            "kind": "array",
            "path": str(self.path),
            "size": list(self.size),
            "shape": list(self._stack.shape),
            "type": str(self._stack.dtype),
            **self._reader.about(),
            "fps": None if self._fps is None else str(self._fps),
            "timestamps_unit": self._unit,
            "timestamps_sha256": digest_of(self._stamps),
            "frames_expected": self.frames_expected,
        }

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        return self.frames_between(None, None, start)

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """The frames from `since_ns` to `until_ns`, both included, None without end; from index `start` among these."""
        clock = Clock(self._fps)
        stamps: Sequence[Fraction | None] = self._stamps or [None] * self._stack.shape[0]
        with self._stack.opened() as read:
            for k, t_ns in clock.within(enumerate(stamps), since_ns, until_ns, start):
                yield Frame(self._reader.light(read(k)), t_ns, number=k)
        self.warnings.extend(remark for remark in clock.remarks() if remark not in self.warnings)

    def _find_times(self) -> None:
        """Stamps or a rate: of the archive, else of a file beside it."""
        count, file = self._stack.shape[0], self.path
        if isinstance(self._stack, NpzStack) and self._stack.times is not None:
            times, unit = self._stack.times
            self._stamps, self._unit = stamps_of_array(times, self.path, unit)
            if len(self._stamps) != count:
                found, frames = counted(len(self._stamps), "time"), counted(count, "frame")
                raise DataError(f"{self.path}: {found} for {frames}; expected one each, or give --fps")
        elif isinstance(self._stack, NpzStack) and self._stack.fps is not None:
            self._fps = parse_fps(self._stack.fps)
        else:
            self._stamps, self._unit = stamps_beside(self.path, count)
            file = times_beside(self.path)
        self.warnings += remarks_on_unit(self._unit, file)
