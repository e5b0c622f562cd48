"""DvsBatchOnCard: event cameras of one size on a GPU, each with its own clip, all clips some frames at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.sensors.batch import cameras_of
from vid2ev.sensors.card_events import CardEvents
from vid2ev.sensors.card_walk import CardWalk
from vid2ev.sensors.clock import LONGEST_INTERVAL_NS, Clock, Step, first_count, later, pace_of
from vid2ev.sensors.compiled import flags_of, numbers_of
from vid2ev.sensors.limits import check_sensor, check_spec, time_ns
from vid2ev.sensors.pixel_planes import blank_planes
from vid2ev.sensors.spec import DvsSpec


class DvsBatchOnCard:
    """Event cameras of `size` (width, height), one for each of `specs`, which switch on the same effects.

    seeds    of each, as of `Dvs`
    cameras  numbers of each, as of `Dvs`; by default 0
    memory   where they are (`vid2ev.kernels.cuda.memory`)
    labels   give each event its cause

    Raises UsageError for specs with different effects, or with effects that come behind the walk (delay, fixed rate).
    """

    def __init__(
        self,
        specs: Sequence[DvsSpec],
        size: tuple[int, int],
        seeds: Sequence[int],
        *,
        memory: Any,
        cameras: Sequence[int] | None = None,
        labels: bool = False,
    ):
        self.size, self.labels, self._memory = size, labels, memory
        self.renew(specs, seeds, cameras)

    def renew(self, specs: Sequence[DvsSpec], seeds: Sequence[int], cameras: Sequence[int] | None = None) -> None:
        """Become other sensors, without light yet.  Raises UsageError as when made."""
        cameras, size = cameras_of(specs, seeds, cameras), self.size
        for seed, camera in zip(seeds, cameras, strict=True):
            size = check_sensor(size, seed, camera, 1)
        for spec in specs:
            check_spec(spec, DvsSpec, "load_sensor('ideal')")
        flags = flags_of(specs[0], self.labels)
        if any(flags_of(spec, self.labels) != flags for spec in specs):
            raise UsageError("a batch of sensors with different effects: expected the same; make one of each kind")
        if any(spec.delay_us > 0 or spec.frame_rate_hz > 0 for spec in specs):
            raise UsageError("a batch of sensors with delay or fixed rate: expected neither; use a DvsBatch")
        self._flags, self._numbers = flags, [numbers_of(*each) for each in zip(specs, seeds, cameras, strict=True)]
        planes, bad = blank_planes(self._memory, specs, self._flags, self._numbers, size)
        phases = [spec.random_phase for spec in specs]
        self._walk = CardWalk(self._memory, self._flags, self._numbers, size, planes, bad, phases, self.labels)
        self._clocks: list[Clock] = []
        self._origins: list[int] = []  # what noise by count is counted from: the first frames [ns]

    def restart(self, light: Any, t_ns: Sequence[int]) -> None:
        """Settle each sensor in a frame of light [clips, height, width], linear, at its t_ns [clips].

        Raises UsageError for light of another shape or type, and times that are not after those before.
        """
        self._check(light, np.shape(t_ns))
        before: list[int | None] = [clock.t_ns for clock in self._clocks]
        before = before or [None] * len(self._numbers)
        times = [later(t, last) for t, last in zip(t_ns, before, strict=True)]
        origins = self._origins or times
        counts = [first_count(t, origin) for t, origin in zip(times, origins, strict=True)]
        self._walk.settle(light, times, counts)
        self._origins, self._clocks = origins, [Clock(t, count) for t, count in zip(times, counts, strict=True)]

    def steps(self, light: Any, t_ns: Any) -> CardEvents:
        """Advance all through frames of light [frames, clips, height, width], linear, at t_ns [frames, clips].

        Raises UsageError for light of another shape or type, times that are not after those before, or too long after
        them, and for sensors without light (`restart`); then none of the frames has been seen.
        """
        return self._advanced(self._walk.walk, light, t_ns)

    def fill(self, grids: Any, light: Any, t_ns: Any) -> None:
        """`steps`, but events go straight into the grids of all clips (`card_grids`), which stay on the device."""
        grids.add(self._advanced(self._walk.sent, light, t_ns))

    def _advanced(self, walk: Callable[[Any, list[list[Step]]], Any], light: Any, t_ns: Any) -> Any:
        """What is sent in a walk through these frames, which are then over."""
        times = self._checked_times(t_ns)
        self._check(light, times.shape)
        steps, clocks = self._steps(times)
        sent = walk(light, steps)
        self._clocks = clocks
        return sent

    def _check(self, light: Any, shape: tuple[int, ...]) -> None:
        """Raise UsageError for what is not linear light for as many times as there are, of as many clips as sensors."""
        clips, (width, height) = len(self._numbers), self.size
        if shape[-1:] != (clips,) or tuple(np.shape(light)) != (*shape, height, width):
            raise UsageError(
                f"light of shape {tuple(np.shape(light))} at times of shape {shape}: expected (..., {clips}, {height},"
                f" {width}) at (..., {clips}), {clips} clips of this size"
            )
        light = light if hasattr(light, "is_floating_point") else np.asarray(light)
        if not (light.dtype.kind == "f" if isinstance(light, np.ndarray) else light.is_floating_point()):
            raise UsageError(f"light of type {light.dtype}: expected floating point, which is linear light")

    def _checked_times(self, t_ns: Any) -> np.ndarray:
        if not self._clocks:
            raise UsageError("a batch without light: expected restart(light, t_ns) before its steps")
        times = np.asarray(t_ns)
        if times.dtype != np.int64:  # (thousands of whole numbers need no look at each)
            times = np.array([[time_ns(t) for t in row] for row in times], np.int64)
        before = np.array([[clock.t_ns for clock in self._clocks]], np.int64)
        if times.shape[1:] != before.shape[1:] or not len(times):
            raise UsageError(f"times of shape {times.shape}: expected (frames, {before.size}), and a frame at least")
        gaps_ns = np.diff(np.concatenate([before, times]), axis=0)
        if ((gaps_ns <= 0) | (gaps_ns >= LONGEST_INTERVAL_NS)).any():
            raise UsageError(
                "frame times of a batch: expected each after the one before, by at most 4.8 hours; sort the frames"
            )
        return times

    def _steps(self, times: np.ndarray) -> tuple[list[list[Step]], list[Clock]]:
        """The steps of each clip, and the clocks after them; if all are the same, one list of them for all."""
        clocks, same_times = [copy(clock) for clock in self._clocks], bool((times[:, 0] == times.T).all())
        first, same_pace = clocks[0], len({pace_of(num) for num in self._numbers}) == 1
        if same_pace and same_times and all(clock == first for clock in clocks):
            row = [first.step_to(int(t), self._flags, self._numbers[0]) for t in times[:, 0]]
            return [row] * len(clocks), [copy(first) for _ in clocks]
        steps = [
            [clock.step_to(int(t), self._flags, num) for t in column]
            for clock, num, column in zip(clocks, self._numbers, times.T, strict=True)
        ]
        return steps, clocks
