"""Recordings of a frame camera and an event camera to interpolate: own ones, HS-ERGB, BS-ERGB."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interp.data.layouts import open_sequence
from interp.data.layouts.own import ROUNDED_US, Own
from interp.data.layouts.sequence import matter_from_us
from interp.interpolate.instants import rate_of
from interp.interpolate.take import Key, Options, refuse_edits
from interp.own_codes import curve_of_film, shown
from interp.representation.dead_time import stated
from vid2ev import Events
from vid2ev.errors import UsageError
from vid2ev.recording.manifest import identity
from vid2ev.terminal import counted

if TYPE_CHECKING:
    from interp.representation.carried import Look


class OfSequence:
    """A sequence in a folder.

    Of a recording with two frame cameras, the frames of the slower one are the key frames.  `late_us` is by how much
    the clock of its events is known to be ahead of that of its frames.
    Raises UsageError where no frame lies in the part asked for.
    """

    bits = 8
    bright = False

    def __init__(self, folder: Path, options: Options):
        refuse_edits(folder, options)
        self._sequence = sequence = open_sequence(folder)
        self.folder, self.name, self.size = folder, sequence.name, sequence.size
        self.curve, self.coded = curve_of_film(sequence.curve), sequence.curve
        self.event_size: tuple[int, int] | None = sequence.event_size
        self.contrast, self.apart = options.contrast or sequence.contrast, sequence.apart
        self.dead_time = options.dead_time(sequence.dead_time)
        self.late_us = sequence.late_us if isinstance(sequence, Own) else 0
        self.remarks = sequence.remarks
        self._times_us = sequence.slow_us if isinstance(sequence, Own) else sequence.times_us
        self._picture = sequence.slow if isinstance(sequence, Own) else sequence.frame
        self._numbers = self._part(options)
        span_us = int(self._times_us[self._numbers[-1]] - self._times_us[self._numbers[0]])
        self.rate = rate_of(Fraction(10**6 * self.gaps_expected, span_us)) if span_us else Fraction(30)
        self.channels = 1 if getattr(sequence, "grey", False) else 3

    @property
    def gaps_expected(self) -> int:
        """Known."""
        return len(self._numbers) - 1

    def looks(self, t_us: int) -> tuple[Look, ...]:
        """See `Take`."""
        return self._sequence.looks(t_us)

    def describe(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """Folder and sizes."""
        about = {"kind": type(self._sequence).__name__.lower(), "path": str(self.folder), "size": list(self.size)}
        sent = {"event_size": list(self._sequence.event_size), "contrast": self.contrast}
        known = {"dead_time": stated(self.dead_time), "identity": identity(self.folder, deep=True, besides=besides)}
        return about | sent | known

    def keys(self, start: int = 0) -> Iterator[Key]:
        """See `Take`."""
        for number in self._numbers[start:]:
            codes = self._picture(number)[..., : self.channels]
            yield Key(int(self._times_us[number]), shown(codes, self.coded))

    def events(self, start_us: int, stop_us: int) -> Events | None:
        """See `Take`."""
        begin_us, end_us = self._sequence.covered_us
        if start_us < begin_us - ROUNDED_US or stop_us > end_us + ROUNDED_US:
            return None
        if any(since < stop_us and until > start_us for since, until in self._sequence.unknown_us):
            return None
        since_us = matter_from_us(self._sequence, start_us, self.dead_time)
        return self._sequence.events(since_us, stop_us).within(self._sequence.event_size)[0]

    def _part(self, options: Options) -> list[int]:
        """The frames to take, in order of time."""
        times = self._times_us
        latest = np.maximum.accumulate(times)
        rising = [k for k in range(len(times)) if k == 0 or times[k] > latest[k - 1]]
        if left_out := len(times) - len(rising):
            self.remarks.append(
                f"{counted(left_out, 'frame')} left out, whose time is not after that of the frame before"
            )
        start_us, stop_us = (
            None if second is None else int(times[rising[0]]) + round(second * 1e6)
            for second in (options.start_s, options.stop_s)
        )
        found = [
            k for k in rising if (start_us is None or times[k] >= start_us) and (stop_us is None or times[k] <= stop_us)
        ]
        if not found:
            start = f"from {options.start_s or 0:g} s" + (
                " on" if options.stop_s is None else f" to {options.stop_s:g} s"
            )
            last_s = 1e-6 * (int(times[rising[-1]]) - int(times[rising[0]]))
            raise UsageError(f"{self.folder}: no frame {start}; expected a part of its {last_s:.6g} s")
        return found
