"""Pixels: those of an event camera, on a CPU: their planes, the walk over them, and which of them sleep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vid2ev.compiling.elsewhere import Elsewhere
from vid2ev.kernels.cpu import settle_tile, walk_tile
from vid2ev.kernels.layout import BLOCK, CAPPED, NOT_FINITE, STRIP, SWALLOWED, TALLIES, Flags, Interval, Planes
from vid2ev.kernels.naps import rouse
from vid2ev.kernels.rows import interval_rows
from vid2ev.kernels.work import new_work
from vid2ev.sensors.clock import Step, as_counted
from vid2ev.sensors.compiled import flags_at_rest, flags_of, numbers_of, planes_of
from vid2ev.sensors.inside import Inside, inside_of, maps_of
from vid2ev.sensors.sent import Keys, Sent
from vid2ev.sensors.sleep import Sleep
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Part, Tiles
from vid2ev.stream.saved import entry
from vid2ev.stream.still import strip_count

STATE_PLANES = ("fast", "rest", "memory", "drawn", "t_last", "count", "t_reset")
GROUP = 8  # blocks, of whose pixels each takes 20 to 60 bytes of a cache that has about a million
TALLIED = (("swallowed", SWALLOWED), ("capped", CAPPED), ("not_finite", NOT_FINITE))


def only_read(light: np.ndarray) -> np.ndarray:
    """The same light, which cannot be written: one type for kernels, whether others may write it or not."""
    view = light.view()
    view.flags.writeable = False
    return view


def places_of(lights: np.ndarray | Sequence[np.ndarray]) -> np.ndarray:
    """Where arrays of one type begin: int64, in entries from the first one's first entry on."""
    addresses = [light.__array_interface__["data"][0] for light in lights]
    return (np.array(addresses, np.int64) - addresses[0]) // lights[0].itemsize


class Pixels:
    """The pixels of a sensor of `size` (width, height), between one call of the walk and the next.

    labels, threads, skip and part are as of `Dvs`; `be` has to follow.
    """

    def __init__(self, size: tuple[int, int], labels: bool, threads: int, skip: bool, part: Part):
        self.size, self._labels, self._skip, self._total = size, labels, skip, size[0] * size[1]
        self._threads = threads
        self._elsewhere: Elsewhere | None = None  # (where the walk is compiled)
        self.tiles = Tiles(-(-self._total // BLOCK), threads, part)
        self._work = [new_work() for _ in range(self.tiles.count)]
        self._buffers = [np.empty(4096, np.uint64) for _ in range(self.tiles.count)]
        self.tallies = np.zeros((self.tiles.count, TALLIES), np.int64)
        self._planes_of: dict[Flags, Planes] = {}  # (of the last sensor alone)

    def be(self, spec: DvsSpec, seed: int, camera: int) -> None:
        """Those of another sensor, without light; in the planes of the old one if it had the same effects."""
        flags = flags_of(spec, self._labels)
        self.flags, self.numbers, self._random_phase = flags, numbers_of(spec, seed, camera), spec.random_phase
        self._at_rest = flags_at_rest(flags)
        self.planes, self.bad = planes_of(spec, flags, self.numbers, *self.size, self._planes_of.get(flags))
        self._planes_of = {flags: self.planes}
        self.tallies[...] = 0
        self.sleep = Sleep(self._total, self._skip and not flags.noise)

    def settle(self, flat: np.ndarray, table: np.ndarray, t_ns: int, count: int) -> None:
        """Settle in a frame of light, from which noise by count goes on at `count`."""
        light = only_read(flat[0])
        if self._threads > 1:  # (a core for the walk, by far the longest of the kernels)
            none = np.zeros((0, 0)), np.zeros((0, 0), np.int64), np.zeros((0, 0), np.int64)
            self._elsewhere = Elsewhere(walk_tile, self._of_walk(0, 0, 0, light, np.zeros(0, np.int64), table, *none))

        def settle(k: int, first: int, last: int) -> None:
            settle_tile(
                first, last, self._total, light, table, t_ns, self.bad, self._random_phase, self.planes,
                self._at_rest, self.numbers, self._work[k], self.tallies[k],
            )  # fmt: skip

        self.sleep.forget()
        self.planes.count[...] = as_counted(count)
        self.tiles.each_blocks(settle)
        self.planes.t_last[...] = max(t_ns - self.numbers.refractory_ns - 1, np.iinfo(np.int64).min)

    def walk(self, lights: np.ndarray | Sequence[np.ndarray], table: np.ndarray, steps: list[Step], told: Any) -> Sent:
        """Through the frames of these steps, of each of which the light [pixels] is one of `lights`, wherever in memory
        it is; `told`: see `Naps`."""
        intervals = [interval for interval, _ in steps]
        self.sleep.begin(intervals, told)
        floats, ints = interval_rows(steps)
        light, places = only_read(lights[0]), places_of(lights)
        if self._elsewhere:
            self._wait_for_walk(self._elsewhere, intervals)

        def walk(k: int, first: int, last: int) -> Keys:
            ends = np.zeros((-(-(last - first) // GROUP) if len(steps) > 1 else 1, len(steps)), np.int64)
            self._buffers[k] = walk_tile(*self._of_walk(k, first, last, light, places, table, floats, ints, ends))
            return Keys(self._buffers[k], ends)

        parts = self.tiles.each_blocks(walk)
        self.sleep.end(len(steps))
        return self._sent(parts, intervals)

    def _of_walk(
        self, k: int, first: int, last: int, light: np.ndarray, places: np.ndarray, table: np.ndarray,
        floats: np.ndarray, ints: np.ndarray, ends: np.ndarray,
    ) -> tuple:  # fmt: skip
        """What the walk is called with for tile k."""
        return (
            first, last, light, places, table, self.sleep.naps, self.planes, self.flags, self.numbers, floats, ints,
            ends, self._work[k], self._buffers[k], self.tallies[k],
        )  # fmt: skip

    def _wait_for_walk(self, elsewhere: Elsewhere, intervals: list[Interval]) -> None:
        """Until it is compiled; meanwhile what puts events in order is, by one event of no meaning."""
        event = Keys(np.zeros(1, np.uint64), np.ones((1, 1), np.int64))
        self._sent([event], intervals[:1]).ordered(self.tiles.each)
        elsewhere.wait()

    def _sent(self, parts: list[Keys], intervals: list[Interval]) -> Sent:
        first_us, last_us = (np.array([getattr(iv, name) for iv in intervals]) for name in ("first_us", "last_us"))
        return Sent(parts, first_us, last_us, self.size[0], self._labels)

    def state(self) -> dict[str, np.ndarray]:
        """All that later events depend on and that is in the pixels, and what was tallied (copies)."""
        self._rouse(np.arange(strip_count(*self.size)))
        state = {name: getattr(self.planes, name).copy() for name in STATE_PLANES}
        return state | {"tallies": self.tallies.sum(axis=0)}

    def restoring(self, state: dict[str, np.ndarray]) -> Callable[[], None]:
        """What takes up a state, all of which is found right before.  Raises UsageError for another."""
        planes = {name: getattr(self.planes, name) for name in STATE_PLANES}
        saved = {name: entry(state, name, plane.dtype, plane.shape) for name, plane in planes.items()}
        tallies = entry(state, "tallies", self.tallies.dtype, self.tallies.shape[1:])

        def take_up() -> None:
            self.sleep.forget()
            for name, plane in planes.items():
                plane[...] = saved[name]
            self.tallies[...] = 0
            self.tallies[0] = tallies

        return take_up

    def inside(self, pixels: np.ndarray, leak_nat: float) -> Inside:
        """What pixels [int, y * width + x] have in them, whose levels have leaked this far."""
        self._rouse(np.unique(pixels // STRIP))
        return inside_of(pixels, self.planes, self.flags, self.numbers, leak_nat)

    def maps(self) -> dict[str, np.ndarray]:
        """What is frozen in them (`Dvs.maps`)."""
        return maps_of(self.planes, self.numbers, self.bad, self.size)

    def tallied(self) -> dict[str, int]:
        """How many crossings were swallowed, intervals capped, values of light mended."""
        tallies = self.tallies.sum(axis=0)
        return {name: int(tallies[k]) for name, k in TALLIED}

    def _rouse(self, strips: np.ndarray) -> None:
        """Bring these strips up to the last frame, if they have slept."""
        late = self.sleep.late(strips)
        if late.size:
            rouse(late, self._total, self.planes, self.sleep.naps, self._at_rest, self.numbers, self._work[0])
