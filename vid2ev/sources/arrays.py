"""A stack of frames in a .npy file: [N, H, W] grey or [N, H, W, 3] red, green, blue; uint8, uint16 or floating point.

Floating point is linear light unless a transfer is given.  For uint8 and uint16 a transfer must be given: nothing in
the file says what its codes mean.  Times come from fps, or from a file beside it: for `clip.npy`, from
`clip_timestamps.npy` or `clip_timestamps.txt` (`times.py` has the rule for the unit).
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.pictures import TYPES, PictureReader
from vid2ev.sources.times import Clock, parse_fps, read_timestamp_array, read_timestamps
from vid2ev.sources.transfer import KNOWN
from vid2ev.stream.frames import Frame

MAGIC = b"\x93NUMPY"


class ArrayStack:
    """Frames of a .npy file, read from disk one at a time.

    Raises DataError for a file that holds no such stack, UsageError without times or, for codes, without a
    transfer.
    """

    def __init__(self, path: str | Path, *, transfer: str = "auto", fps: float | Fraction | None = None):
        self.path = Path(path)
        self.warnings: list[str] = []
        stack = self._map()
        if stack.ndim not in (3, 4) or 0 in stack.shape or (stack.ndim == 4 and stack.shape[3] != 3):
            raise DataError(f"{self.path}: array of shape {stack.shape}, expected [N, H, W] or [N, H, W, 3]")
        if stack.dtype not in (np.uint8, np.uint16) and stack.dtype.kind != "f":
            raise DataError(f"{self.path}: array of type {stack.dtype}, expected {TYPES}")
        if transfer == "auto" and stack.dtype.kind != "f":
            raise UsageError(
                f"{self.path}: {stack.dtype} codes that may mean anything; say what with --transfer {KNOWN}"
            )
        self._reader = PictureReader("linear" if transfer == "auto" else transfer)
        self._shape, self._dtype = stack.shape, str(stack.dtype)
        self.size = (stack.shape[2], stack.shape[1])
        self.frames_expected: int | None = stack.shape[0]
        self._fps = None if fps is None else parse_fps(fps)
        self._stamps: list[Fraction] = []
        self._unit: str | None = None
        if fps is None:
            self._stamps, self._unit = self._read_stamps()

    def describe(self) -> dict[str, Any]:
        """Facts about the file, for the manifest."""
        return {
            "kind": "array",
            "path": str(self.path),
            "size": list(self.size),
            "shape": list(self._shape),
            "type": self._dtype,
            "transfer": self._reader.transfer,
            "fps": None if self._fps is None else str(self._fps),
            "timestamps_unit": self._unit,
            "frames_expected": self.frames_expected,
        }

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        clock, index = Clock(self._fps), 0
        for k in range(self._shape[0]):
            t_ns = clock.next(self._stamps[k] if self._stamps else None)
            if t_ns is None:
                continue
            if index >= start:
                # (mapped anew for each frame: pages of one long mapping would count as memory in use until its end)
                yield Frame(self._reader.light(self._map()[k]), t_ns)
            index += 1
        self.warnings.extend(remark for remark in clock.remarks() if remark not in self.warnings)

    def _map(self) -> np.ndarray:
        try:
            return np.load(self.path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise DataError(f"{self.path}: not a .npy array that can be read; write it with numpy.save") from error

    def _read_stamps(self) -> tuple[list[Fraction], str]:
        binary, text = (self.path.with_name(f"{self.path.stem}_timestamps{suffix}") for suffix in (".npy", ".txt"))
        if not binary.exists() and not text.exists():
            raise UsageError(f"{self.path}: frames without times; give --fps, or put {binary.name} beside it")
        stamps, unit = read_timestamp_array(binary) if binary.exists() else read_timestamps(text)
        if len(stamps) != self._shape[0]:
            raise DataError(
                f"{self.path}: {len(stamps)} times beside it for {self._shape[0]} frames; expected one each"
            )
        return stamps, unit
