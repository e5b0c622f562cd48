"""preview.mp4: the video on the left, its events on the right, in real time, for a browser.

Frame k shows the instant t_k = t_0 + (k + 1/4) / rate on the clock of the camera: the newest source frame that is not
after it, and the events since t_(k-1); none is lost, and one that is sent late is shown late.  The quarter lets source
times that are rounded, or that drift as 29.97 Hz does, be shown in step.  Where nothing changes, a frame is left out
and the one before it stays.

A panel has at most 640 pixels a side: larger frames are reduced, events of the pixels that share one are added up;
smaller ones are enlarged a whole number of times.

The film is made in pieces, each beginning with a key frame, so that an interrupted run can go on: `begin`, then `add`
and now and then `close`, and in the end `finish`, `close` and `join`.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.pictures.film import film_frame, join_films, open_film
from vid2ev.recording.disk import sync
from vid2ev.recording.panels import COLOURS, count, paint, reduced
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.stream.saved import clock, entry
from vid2ev.stream.upload import downloaded

RATE = 30  # frames per second
PARTS = 8  # frames per interval of a slow source, for which fewer will do
SIDE = 640
ENCODER = {"preset": "ultrafast", "crf": "25"}  # 60 % of the time of "superfast", 24, in a third more bytes


class Preview:
    """The preview of a recording of `size` (width, height), made in the folder `pieces`; not at all unless `wanted`.

    Its state between two pieces is small: how far it is, and the events not shown yet.
    """

    def __init__(self, size: tuple[int, int], pieces: Path, *, wanted: bool = True, rate: int = RATE):
        width, height = size
        shrunk = min(1.0, SIDE / max(size))
        self.across, self.down = max(1, round(width * shrunk)), max(1, round(height * shrunk))
        self.enlarged = max(1, SIDE // max(size))
        sides = self.across * self.enlarged, self.down * self.enlarged
        self.panel = [side + side % 2 for side in sides]  # 4:2:0 needs even sides
        self.wanted, self.pieces, self.rate = wanted, pieces, rate
        self._column = (np.arange(width) * self.across // width).astype(np.uint16)
        self._row = (np.arange(height) * self.down // height).astype(np.uint16)
        self._counts = np.zeros((2, self.down, self.across), np.uint8)  # events not shown yet: OFF, ON
        self._next = 0  # number of the next frame
        self._starts: list[int] = []  # number of the first frame of each piece
        self._waiting = self._showing = False  # events not shown yet; events in the last frame
        self._moved = True  # the newest source frame is not shown yet
        self._t0_ns: int | None = None
        self._gray: np.ndarray | None = None  # the left panel, once it is drawn
        self._container: Any = None

    def begin(self, frame: Frame) -> None:
        """The first frame of the recording; after `restore`, the last source frame before it.  Raises UsageError for
        one that is not where the state is."""
        self._newest = frame
        if self.wanted and self._t0_ns is not None and not self._instant_ns(-1) < frame.t_ns <= self._instant_ns():
            raise UsageError(f"state of a preview before its frame {self._next}, at {frame.t_ns} ns")
        self._t0_ns = frame.t_ns if self._t0_ns is None else self._t0_ns

    def add(self, frame: Frame, events: Events) -> None:
        """Take in the events up to a frame, and the frame itself if it is the source's."""
        if not self.wanted:
            return
        while (instant_ns := self._instant_ns()) < frame.t_ns:
            earlier = int(np.searchsorted(events.t, instant_ns // 1000, side="right"))
            self._count(events.stretch(0, earlier))
            events = events.stretch(earlier, len(events))
            self._show()
        self._count(events)
        if frame.original:
            self._newest, self._gray, self._moved = frame, None, True

    def finish(self, events: Events) -> None:
        """Show the last events, and what is left."""
        if self.wanted:
            self._count(events)
            self._show()

    def close(self) -> None:
        """End a piece and bring it to the disk; the next frame begins another."""
        if self._container is not None:
            self._container.mux(self._stream.encode(None))
            self._container.close()
            self._container = None
            sync(self._piece(len(self._starts) - 1))

    def state(self) -> dict[str, np.ndarray]:
        """The state between two pieces, as plain arrays."""
        clock = np.array([self._t0_ns, self._next, self._waiting, self._showing, self._moved], np.int64)
        return {"clock": clock, "starts": np.array(self._starts, np.int64), "counts": self._counts.copy()}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state.  Raises UsageError for one that cannot be, which changes nothing."""
        t0_ns, following, *flags = clock(state, "clock", 5)
        starts = [int(start) for start in entry(state, "starts", np.int64, (None,))]
        counts = entry(state, "counts", np.uint8, self._counts.shape)
        if any(after <= before for before, after in pairwise([-1, *starts, following + (not starts)])):
            raise UsageError(f"state of a preview whose pieces begin at {starts[:9]}, up to {following}")
        if missing := [k for k in range(len(starts)) if not self._piece(k).is_file()]:
            raise UsageError(f"state of a preview without its piece {missing[0]}")
        self._t0_ns, self._next, self._starts = t0_ns, following, starts
        self._waiting, self._showing, self._moved = (bool(flag) for flag in flags)
        self._counts[...] = counts

    def join(self, path: Path, duration_us: int) -> None:
        """Put the pieces one after the other into one file, without encoding them again.  Raises UsageError for a state
        of more frames than a recording of that length has."""
        if self._next > self.rate * duration_us // 10**6 + 3:
            raise UsageError(f"state of a preview of {self._next} frames for {duration_us / 1e6:.6g} s")
        if self._starts:
            join_films(path, ((self._piece(number), first) for number, first in enumerate(self._starts)), self.rate)

    def _piece(self, number: int) -> Path:
        return self.pieces / f"preview-{number:05d}.mp4"

    def _instant_ns(self, later: int = 0) -> int:
        """The instant of the next frame, or of another `later` than that."""
        assert self._t0_ns is not None
        return self._t0_ns + (4 * (self._next + later) + 1) * 10**9 // (4 * self.rate)

    def _count(self, events: Events) -> None:
        if len(events):
            count(events.x, events.y, events.p, self._column, self._row, self._counts)
            self._waiting = True

    def _show(self) -> None:
        """Encode the next frame, if it differs from the one before."""
        if self._waiting or self._showing or self._moved:
            self._encode(self._picture())
            self._counts[...] = 0
        self._showing, self._waiting, self._moved = self._waiting, False, False
        self._next += 1

    def _picture(self) -> np.ndarray:
        """Both panels as planes Y, U, V, one after the other as yuv420p has them."""
        if self._gray is None:
            self._gray = reduced(downloaded(self._newest).light, self.across, self.down)
        width, height = self.panel
        picture = np.empty((height * 3 // 2, 2 * width), np.uint8)
        luma, chroma = picture[:height], picture[height:].reshape(2, height // 2, width)
        paint(self._gray, self._counts, COLOURS, self.enlarged, luma, chroma)
        return picture

    def _encode(self, picture: np.ndarray) -> None:
        if self._container is None:
            self._open()
        self._container.mux(
            self._stream.encode(film_frame(picture, self._next - self._starts[-1], Fraction(self.rate)))
        )

    def _open(self) -> None:
        """Begin a piece with the next frame."""
        size = 2 * self.panel[0], self.panel[1]
        self._container, self._stream = open_film(self._piece(len(self._starts)), size, Fraction(self.rate), ENCODER)
        self._starts.append(self._next)


def rate_for(frames: int | None, duration_s: float | None) -> int:
    """Frames per second of the preview of so many source frames: of slow sources at least one, `PARTS` per interval."""
    if not frames or not duration_s:
        return RATE
    return min(RATE, max(1, math.ceil(PARTS * frames / duration_s)))
