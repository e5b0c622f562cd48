"""Events in many npz files, one for each frame: as HS-ERGB and BS-ERGB have them, read as one stream.

Neither release can be taken by its word, so nothing is believed that can be seen:

* Files are numbered from anywhere, and file n holds the events before image n (HS-ERGB) or after it (BS-ERGB), or in
  some sequences neither.  So numbers only say the order; times say the rest.
* x and y are whole pixels, floating point pixels, or pixels times 32 as whole numbers, of which those left of or above
  the picture have wrapped around to near 65536.  If a sequence has any that lie 2 pictures beyond the last pixel, all
  are times 32.
* p is 0 and 1, false and true, or -1 and 1.  Files may be empty, hold one instant, or be out of order.
* A file that cannot be read is named; what it should have held is a stretch of unknown events.  So is that of files
  whose numbers are left out, where events are left out there, too.

Sources: the READMEs and loaders of rpg_timelens and timelens-pp, and what their users report in those projects' issues.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from interp.data.layouts.sequence import Placed
from vid2ev.errors import DataError
from vid2ev.stamps import Stamp, stamp
from vid2ev.terminal import counted
from vid2ev.untrusted import first_line, read_arrays

SCALE = 32.0
WRAP = 65536
COLUMNS = ("t", "timestamp"), ("x",), ("y",), ("p", "polarity")  # what the two layouts call them
BEYOND = 2  # pictures
LEAST_MISSING = 0.5  # of the time of a file, for which there are no events where one is missing


class EventParts:
    """The events of npz files in a folder, in the order of their numbers.

    size      width and height of the picture that they are on [px]
    first_us, last_us   times of the first and the last event; 0 without events
    unknown_us  stretches of which events are not known, as their file is missing or cannot be read
    remarks   files that are missing or cannot be read, and empty ones by their number
    """

    def __init__(self, folder: Path, size: tuple[int, int]):
        self.folder, self.size = folder, size
        self.paths = numbered(folder, ".npz")
        self.remarks: list[str] = []
        self._spans = np.zeros((len(self.paths), 2), np.int64)
        self._count = np.zeros(len(self.paths), np.int64)
        self._damaged = np.zeros(len(self.paths), bool)
        self._scaled = self._survey()
        self.unknown_us = [self._unknown(int(k), int(k) + 1) for k in np.flatnonzero(self._damaged)]
        self.unknown_us += self._missing()
        used = self._count > 0
        self.first_us = int(self._spans[used, 0].min()) if used.any() else 0
        self.last_us = int(self._spans[used, 1].max()) if used.any() else 0
        if empty := int((~used & ~self._damaged).sum()):
            self.remarks.append(f"{empty} of {len(self.paths)} event files {'is' if empty == 1 else 'are'} empty")

    def between(self, start_us: int, stop_us: int) -> Placed:
        """The events in (start_us, stop_us].  Raises DataError where a file in that time cannot be read."""
        for since_us, until_us in self.unknown_us:
            if since_us < stop_us and until_us > start_us:
                raise DataError(
                    f"{self.folder}: events from {start_us} to {stop_us} us are in a file that is missing or cannot be"
                    " read"
                )
        near = np.flatnonzero((self._count > 0) & (self._spans[:, 0] <= stop_us) & (self._spans[:, 1] > start_us))
        parts = [self._placed(int(k)) for k in near]
        if not parts:
            none = np.empty(0, np.float32)
            return Placed(np.empty(0, np.int64), none, none, np.empty(0, np.uint8))
        t, x, y, p = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        order = np.argsort(t, kind="stable")
        order = order[np.searchsorted(t[order], start_us, "right") : np.searchsorted(t[order], stop_us, "right")]
        return Placed(t[order], x[order], y[order], p[order])

    def _survey(self) -> bool:
        """Look at all files once; returns whether coordinates are times 32."""
        far = False
        for k, path in enumerate(self.paths):
            try:
                t, x, y, _ = columns_of(path)
            except DataError as error:
                self._damaged[k] = True
                self.remarks.append(str(error))
                continue
            self._count[k] = len(t)
            if len(t):
                self._spans[k] = t.min(), t.max()
                far |= bool((x > BEYOND * self.size[0]).any() or (y > BEYOND * self.size[1]).any())
        return far

    def _placed(self, k: int) -> Placed:
        t, x, y, p = _cached(self.paths[k], stamp(self.paths[k]))
        return Placed(t, self._pixels(x, self.size[0]), self._pixels(y, self.size[1]), p)

    def _pixels(self, values: np.ndarray, side: int) -> np.ndarray:
        """Places in pixels."""
        if not self._scaled:
            return values.astype(np.float32)
        values = values.astype(np.float64)
        wrapped = values > SCALE * (side - 1) + SCALE  # (right of the picture; or left of it, wrapped around)
        return (np.where(wrapped, values - WRAP, values) / SCALE).astype(np.float32)

    def _missing(self) -> list[tuple[int, int]]:
        """When files that are missing by their numbers may have held events: where there are none for long."""
        found, used = list[tuple[int, int]](), self._spans[self._count > 0]
        typical_us = float(np.median(np.diff(used, axis=1))) if len(used) else 0.0
        for k in range(1, len(self.paths)):
            missing = int(self.paths[k].stem) - int(self.paths[k - 1].stem) - 1
            since_us, until_us = self._unknown(k, k)
            if missing > 0 and until_us - since_us > LEAST_MISSING * typical_us:
                found.append((since_us, until_us))
                said = f"{counted(missing, 'event file')} {'is' if missing == 1 else 'are'}"
                self.remarks.append(f"{said} missing before {self.paths[k].name}")
        return found

    def _unknown(self, stop: int, start: int) -> tuple[int, int]:
        """When files between those before `stop` and those from `start` on may have held events: after the last event
        of the first, before the first of the others."""
        before, after = self._spans[:stop][self._count[:stop] > 0], self._spans[start:][self._count[start:] > 0]
        return int(before[-1, 1]) if len(before) else -(2**62), int(after[0, 0]) if len(after) else 2**62


def columns_of(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """t int64 [us], x, y as they are, and p as 0 and 1, uint8, of a file.  Raises DataError."""
    try:
        arrays = read_arrays(path, [name for choice in COLUMNS for name in choice])
        names = [next((name for name in choice if name in arrays), choice[0]) for choice in COLUMNS]
        columns = [arrays[name].reshape(-1) for name in names]
    except DataError:
        raise
    except Exception as error:  # (numpy, zipfile and zlib have a dozen of their own)
        said = first_line(error, 150)
        raise DataError(f"{path} is no file of events ({said}); expected an npz of x, y, t, p") from error
    lengths = {len(each) for each in columns}
    if len(lengths) > 1:
        raise DataError(f"{path} is no file of events (columns of {sorted(lengths)}); expected one length")
    t, x, y, p = columns
    if any(each.dtype.kind not in "iufb" for each in columns) or not np.all(np.abs(t.astype(np.float64)) < 1 << 62):
        kinds = ", ".join(str(each.dtype) for each in columns)
        raise DataError(
            f"{path} is no file of events (columns of {kinds}, or times beyond all clocks); expected numbers"
        )
    return np.floor(t).astype(np.int64), x, y, (p > 0).astype(np.uint8)


@lru_cache(maxsize=8)
def _cached(path: Path, written: Stamp) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return columns_of(path)


def numbered(folder: Path, suffix: str) -> list[Path]:
    """The files of a folder whose names are numbers, in the order of these."""
    found = [path for path in folder.iterdir() if path.suffix.lower() == suffix and path.stem.isdecimal()]
    return sorted(found, key=lambda path: int(path.stem))
