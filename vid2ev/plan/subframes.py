"""The sub-frames in a plan: what taking light to go straight from frame to frame would change.

Where things move by d [px] in an interval T, a crossing is misplaced by up to (`upsample/subframes.py`)

    T^2/8 |u''|/|u'|  =  kappa d T / 8

and with n steps by a n-th of a n-th of that.  d is a high percentile of the motion that optical flow finds, so this is
an estimate, which leaves out nothing.  Exact is that an interval needs no sub-frames whose light does not change.
"""

from __future__ import annotations

import numpy as np

from vid2ev.bounds.scene import Omission
from vid2ev.plan.plan import Row
from vid2ev.seen.instants import Instant
from vid2ev.stream.frames import Frame
from vid2ev.upsample.subframes import KAPPA_PER_PX

NS_PER_PIXEL = 8.0  # of a sub-frame that is carried along the motion, of one thread; 26 for the motion, an interval


class Subframes:
    """The sub-frames of a clip: `see` each instant, then ask for the `row`."""

    def __init__(self) -> None:
        self.made = self.intervals = self.still = self.limited = 0
        self.speed_px_per_s: float | None = None  # the greatest, of the source's pixels, where it was looked at
        self.worst_us = self.left_us = 0.0
        self._steps = 0
        self._before: tuple[int, tuple[Frame, ...]] | None = None

    def see(self, instant: Instant) -> None:
        """The next instant of the cameras."""
        self._steps += 1
        if not instant.original:
            self.made += 1
            return
        if self._before is not None:
            start_ns, frames = self._before
            self.intervals += 1
            self.still += all(np.array_equal(a.light, b.light) for a, b in zip(frames, instant.frames, strict=True))
            if instant.shift_px is not None:
                self._note((instant.t_ns - start_ns) * 1e-9, instant.shift_px)
        self.limited, self._steps = instant.limited, 0
        self._before = instant.t_ns, instant.frames

    def row(self) -> Row:
        """The row of every camera's plan."""
        intervals, made = f"of {self.intervals} intervals {self.still} still", f"{self.made} made"
        if self.still == self.intervals:
            return Row("subframes", "dropped", Omission(0.0, "exact", made, intervals), 0.0, 0.0)
        if self.speed_px_per_s is None:
            why = f"{intervals}; motion was not looked at"
            return Row("subframes", "kept", Omission(None, "no bound yet", made, why), 0.0, 0.0)
        figure = f"{self.worst_us:.3g} us, {made}"
        limited = f", {self.limited} at the limit of sub-frames" if self.limited else ""
        with_those = " with those made" if self.made else ""
        why = f"{intervals}; by motion crossings are up to {self.left_us:.3g} us off{with_those}{limited}"
        return Row(
            "subframes", "kept", Omission(None, "estimate", figure, why), NS_PER_PIXEL if self.made else 0.0, 0.0
        )

    def _note(self, seconds: float, shift_px: float) -> None:
        off_us = 1e6 * KAPPA_PER_PX * shift_px * seconds / 8
        self.worst_us = max(self.worst_us, off_us)
        self.left_us = max(self.left_us, off_us / max(self._steps, 1) ** 2)
        self.speed_px_per_s = max(self.speed_px_per_s or 0.0, shift_px / seconds)
