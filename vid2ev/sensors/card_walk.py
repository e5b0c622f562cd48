"""The walk of the pixels of some sensors on a GPU: settle, and advance by some frames at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vid2ev.kernels.cuda.clips import Candidates, Clips, Listed, Sent, Start, Totals
from vid2ev.kernels.layout import TALLIES, Flags, Numbers, Planes
from vid2ev.kernels.rows import interval_row, sensor_row
from vid2ev.sensors.card_events import CardEvents, CardSent, Moments, events_of, sent_of
from vid2ev.sensors.clock import Step, as_counted
from vid2ev.sensors.proposed import none_proposed, proposed

WALKERS = 1 << 17  # threads that walk pixels: what is listed, which only the device knows, is shared out among them


class CardWalk:
    """State of the pixels of some sensors of size (width, height) on a device.

    `planes` is their state, on the device, pixel by pixel, one sensor after the other (`vid2ev.sensors.pixel_planes`),
    and `bad` their maps of bad pixels, on the host.
    """

    def __init__(
        self,
        memory: Any,
        flags: Flags,
        numbers: Sequence[Numbers],
        size: tuple[int, int],
        planes: Planes,
        bad: np.ndarray,
        random_phase: Sequence[bool],
        labels: bool,
    ):
        self.memory, self._flags, self._labels = memory, flags, labels
        self._numbers, self._size = list(numbers), size
        self._pixels, self._total = size[0] * size[1], size[0] * size[1] * len(self._numbers)
        self._kernels = memory.kernels(flags)
        self._bad, self._phase = memory.put(bad), memory.put(np.array(random_phase, np.uint8))
        self._hot = np.flatnonzero(bad == 1)
        self._of_walk, self._none = Totals(memory.zeros(TALLIES, np.int64)), none_proposed(memory)
        self.be(planes, np.zeros(TALLIES, np.int64))
        self._saved = Planes(*(memory.like(plane) for plane in planes))
        self._listed = Listed(
            memory.zeros(self._total, np.int64), memory.zeros(self._total, np.int32), memory.zeros(1, np.int64)
        )
        self._sent = Sent(memory.zeros(max(4096, self._total), np.uint64), memory.zeros(1, np.int64))
        rows = [sensor_row(num) for num in self._numbers]
        self._floats = memory.put(np.array([floats for floats, _ in rows]))
        self._ints = memory.put(np.array([ints for _, ints in rows]))

    def be(self, planes: Planes, tallies: np.ndarray) -> None:
        """Take up a state, and what has been counted until then."""
        self._planes, self._totals = planes, Totals(self.memory.put(tallies))

    def download(self) -> dict[str, np.ndarray]:
        """The state, by the names of the planes."""
        return {name: self.memory.get(plane) for name, plane in self._planes._asdict().items()}

    def tallies(self) -> np.ndarray:
        """What has been counted (`layout.TALLIES`)."""
        return self.memory.get(self._totals.counts)

    def forget_tallies(self) -> None:
        """Count anew what `tallies` has."""
        self._totals.counts[:] = 0

    def settle(self, light: Any, t_ns: Sequence[int], counts: Sequence[int]) -> None:
        """Settle each sensor in a frame of its light [clips, height, width] at its t_ns, where crossings are counted
        from its count."""
        for k, count in enumerate(counts):
            first = self.memory.put(np.array([as_counted(count)]))
            self._planes.count[self._of(k, self._planes.count)] = first
        start = Start(self.memory.put(np.array(t_ns, np.int64)), self._bad, self._phase)
        seen = self._clips(self.memory.light(light).reshape(1, len(self._numbers), self._pixels), [], np.zeros((1, 1)))
        self.memory.launch(self._kernels.settle, self._total, seen, start, self._planes, self._totals)
        for k, (num, t) in enumerate(zip(self._numbers, t_ns, strict=True)):
            since = max(int(t) - num.refractory_ns - 1, int(np.iinfo(np.int64).min))
            self._planes.t_last[self._of(k, self._planes.t_last)] = since

    def _of(self, k: int, plane: Any) -> slice:
        """Where sensor k's entries are of a plane; all of one that nothing uses."""
        return slice(k * self._pixels, (k + 1) * self._pixels) if len(plane) == self._total else slice(None)

    def walk(self, light: Any, steps: list[list[Step]]) -> CardEvents:
        """Advance through frames of light [frames, clips, height, width], by the steps [clips][frames]."""
        keys, moments = self._through(light, steps)
        return events_of(self.memory, self.memory.ordered(keys), moments, self._size[0], self._labels)

    def sent(self, light: Any, steps: list[list[Step]]) -> CardSent:
        """`walk`, but what is sent is not put in order."""
        keys, moments = self._through(light, steps)
        return sent_of(self.memory, self.memory.cast(keys, np.int64), moments)

    def _through(self, light: Any, steps: list[list[Step]]) -> tuple[Any, Moments]:
        """The keys of the events, in no order but that of each pixel, and what they count time from."""
        moments = Moments([[interval for interval, _ in row] for row in steps])
        light = self.memory.light(light).reshape(len(steps[0]), len(steps), self._pixels)
        seen = self._clips(light, steps, moments.bases())
        candidates = self._candidates(seen, steps)
        self._listed.count[:] = 0
        self.memory.launch(self._kernels.glance, self._total, seen, self._planes, self._listed, self._totals)
        return self._keys(seen, candidates), moments

    def _keys(self, seen: Clips, candidates: Candidates) -> Any:
        """Walk the pixels that are listed; again, with more room, where the keys of their events found none."""
        while True:
            self._sent.taken[:] = 0
            self._of_walk.counts[:] = 0
            self.memory.launch(
                self._kernels.walk, min(self._total, WALKERS), seen, self._listed, candidates, self._planes,
                self._saved, self._sent, self._of_walk,
            )  # fmt: skip
            taken = int(self._sent.taken[0])
            if taken <= len(self._sent.keys):
                break
            self.memory.launch(self._kernels.undo, self._total, self._listed, self._planes, self._saved)
            self._sent = self._sent._replace(keys=self.memory.zeros(taken + taken // 2, np.uint64))
        self._totals.counts[:] += self._of_walk.counts
        return self._sent.keys[:taken]

    def _clips(self, light: Any, steps: list[list[Step]], bases: np.ndarray) -> Clips:
        alike = all(row is steps[0] for row in steps)  # (then one row of intervals is for all clips)
        rows = [[interval_row(*step) for step in row] for row in (steps[:1] if alike else steps)]
        floats, ints = (np.array([[row[k] for row in each] for each in rows]) for k in range(2))
        put, forced = self.memory.put, self._total if self._flags.forced and rows else 1
        return Clips(
            self._pixels, light, self._floats, self._ints, put(floats if rows else np.zeros((1, 1, 1))),
            put(ints if rows else np.zeros((1, 1, 1), np.int64)), put(bases.astype(np.uint64)),
            self.memory.zeros(forced, np.uint8),
        )  # fmt: skip

    def _candidates(self, seen: Clips, steps: list[list[Step]]) -> Candidates:
        if not self._flags.forced:
            return self._none
        t0_ns = [row[0][0].t0_ns for row in steps]
        t1_ns = [row[-1][0].t0_ns + int(row[-1][0].dt_ns) for row in steps]
        return proposed(self.memory, self._kernels.propose, seen, self._hot, self._numbers, t0_ns, t1_ns)
