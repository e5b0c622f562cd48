"""The picture of a slice as people get it: events, the frame beside or under them, and a line with time and number.

+--------+--------+        the longest side has at most `limit` pixels: larger sensors are reduced, events of the
| events | frame  |        pixels that share one are added up; smaller ones are enlarged a whole number of times
+--------+--------+
| 0.033 s  1,234  |        wide sensors (beyond 16:9) have the frame under the events
+-----------------+
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from vid2ev.formats.event_file import Picture
from vid2ev.pictures.colours import GROUND, in_8_bits
from vid2ev.stream.events import Events
from vid2ev.terminal import counted
from vid2ev.views.representation import Kind, Representation, Slice

DARK = in_8_bits(GROUND)
INK = (150, 156, 168)
LINE = 30  # pixels of the line below
FONT, FONT_SCALE, INSET = cv2.FONT_HERSHEY_SIMPLEX, 0.5, 10


class Canvas:
    """Pictures of the slices of a sensor of `size` (width, height), seen as `kind`.

    limit   the longest side of a picture [pixels], without the line
    frames  shown with the events; None for events alone
    stamp   whether there is a line: at the left the end of the slice [s] after `zero_us` with `digits` decimals, at the
            right how many events it has; what has no room is left out
    """

    def __init__(
        self,
        kind: Kind,
        size: tuple[int, int],
        limit: int,
        frames: Iterator[Picture] | None,
        *,
        stamp: bool = True,
        zero_us: int = 0,
        digits: int = 3,
    ):
        across, down = _extent(kind(size))
        self._under = frames is not None and across * 9 > down * 16
        panels = (1, 1) if frames is None else (1, 2) if self._under else (2, 1)
        self.view = Reduced(kind, size, min(_factor(kind(size), size, limit, panels), 1.0))
        across, down = _extent(self.view)
        self._enlarged = max(1, limit // max(across * panels[0], down * panels[1]))
        self._panel = across, down = across * self._enlarged, down * self._enlarged
        self._beside = None if frames is None else Beside(frames, (across, down))
        self._stamp, self._zero_us, self._digits = stamp, zero_us, digits
        self.size = across * panels[0], down * panels[1] + LINE * stamp

    def draw(self, part: Slice, array: np.ndarray) -> np.ndarray:
        """The picture of a slice, R'G'B' uint8 [height, width, 3]; slices must come in order of time."""
        drawn = np.empty((self.size[1], self.size[0], 3), np.uint8)
        across, down = self._panel
        drawn[:down, :across] = cv2.resize(self.view.picture(array), (across, down), interpolation=cv2.INTER_NEAREST)
        if self._beside is not None:
            top, left = (down, 0) if self._under else (0, across)
            drawn[top : top + down, left : left + across] = self._beside.at(part.stop_us)
        if self._stamp:
            self._write(part, drawn[-LINE:])
        return drawn

    def _write(self, part: Slice, line: np.ndarray) -> None:
        line[:] = DARK
        left, right = f"{(part.stop_us - self._zero_us) / 1e6:.{self._digits}f} s", counted(part.events, "event")
        widths = [cv2.getTextSize(text, FONT, FONT_SCALE, 1)[0][0] for text in (left, right)]
        if INSET + widths[0] > self.size[0]:
            return  # (of a time that is cut, what is left reads as another)
        _write(line, left, INSET)
        if sum(widths) + 4 * INSET <= self.size[0]:
            _write(line, right, self.size[0] - INSET - widths[1])


class Reduced:
    """A representation on a sensor that is smaller by a factor of at most 1."""

    def __init__(self, kind: Kind, size: tuple[int, int], factor: float):
        across, down = (max(1, int(side * factor)) for side in size)
        self._view = kind((across, down))
        self.shape, self.dtype, self.tiles = self._view.shape, self._view.dtype, self._view.tiles
        self._same = (across, down) == size
        self._column, self._row = (
            (np.arange(side) * less // side).astype(np.uint16) for side, less in zip(size, (across, down), strict=True)
        )

    def add(self, events: Events, start_us: int, stop_us: int) -> None:
        """Add up events of the pixels that share one; raises ValueError for those outside of the sensor."""
        if not self._same:
            try:
                x, y = self._column[events.x], self._row[events.y]
            except IndexError as error:
                raise ValueError("events outside of the sensor") from error
            events = Events(events.t, x, y, events.p)
        self._view.add(events, start_us, stop_us)

    def take(self, stop_us: int) -> np.ndarray:
        """The array of the slice."""
        return self._view.take(stop_us)

    def picture(self, array: np.ndarray) -> np.ndarray:
        """How it looks."""
        return self._view.picture(array)


class Beside:
    """The newest frame at an instant, in a panel of a size (width, height)."""

    def __init__(self, frames: Iterator[Picture], size: tuple[int, int]):
        self._frames, self._size = frames, size
        self._next = next(frames, None)
        self._panel = np.full((size[1], size[0], 3), DARK, np.uint8)

    def at(self, t_us: int) -> np.ndarray:
        """The panel at an instant that is not before the last one asked for; dark before the first frame."""
        newest = None
        while self._next is not None and self._next.t_us <= t_us:
            newest, self._next = self._next, next(self._frames, None)
        if newest is not None:
            self._panel = fitted(newest.pixels, self._size)
        return self._panel


def fitted(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Gray [H, W] or colour [H, W, 3], uint8, as large as it goes in the middle of a panel (width, height)."""
    scale = min(size[0] / pixels.shape[1], size[1] / pixels.shape[0])
    across, down = (max(1, round(side * scale)) for side in pixels.shape[1::-1])
    enlarging = cv2.INTER_NEAREST if scale == round(scale) else cv2.INTER_LINEAR
    picture = cv2.resize(pixels, (across, down), interpolation=cv2.INTER_AREA if scale < 1 else enlarging)
    panel = np.full((size[1], size[0], 3), DARK, np.uint8)
    left, top = (size[0] - across) // 2, (size[1] - down) // 2
    panel[top : top + down, left : left + across] = picture if picture.ndim == 3 else picture[..., None]
    return panel


def _extent(view: Representation) -> tuple[int, int]:
    """Width and height of a representation's picture."""
    down, across = view.picture(np.zeros(view.shape, view.dtype)).shape[:2]
    return across, down


def _factor(view: Representation, size: tuple[int, int], limit: int, panels: tuple[int, int]) -> float:
    """By how much a sensor may be larger so that all panels are within the limit."""
    sides = zip(size, view.tiles, panels, strict=True)
    return min((limit / panel - (tiles - 1)) / (side * tiles) for side, tiles, panel in sides)


def _write(line: np.ndarray, text: str, x: int) -> None:
    cv2.putText(line, text, (x, LINE * 2 // 3), FONT, FONT_SCALE, INK, 1, cv2.LINE_AA)
