"""Dvs: light in, events out, one frame at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.kernels.cpu import settle_tile, shift_levels, walk_tile
from vid2ev.kernels.layout import BLOCK, CAPPED, NOT_FINITE, STRIP, SWALLOWED, TALLIES
from vid2ev.kernels.naps import rouse
from vid2ev.kernels.order import order_keys, unpack
from vid2ev.kernels.work import new_work
from vid2ev.light.transfer import code_table
from vid2ev.physics.delay import Delayed
from vid2ev.physics.fixed_rate import EventFrames
from vid2ev.sensors.compiled import flags_of, interval_of, numbers_of, planes_of
from vid2ev.sensors.inside import Inside, inside_of, maps_of
from vid2ev.sensors.limits import check_sensor
from vid2ev.sensors.sleep import Sleep
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Tiles
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still, strip_count, told_of

__all__ = ["Dvs", "DvsSpec"]

LONGEST_INTERVAL_NS = 1 << 44  # 4.9 hours: what an event key can count in microseconds, with room to spare
LEAK_REBASE_NAT = 0.5
WORTH_THREADS = 1 << 15  # events that take longer to put in order than threads take to wake
STATE_PLANES = ("fast", "rest", "memory", "drawn", "t_last", "count", "t_reset")


class Dvs:
    """An event camera of `size` (width, height): feed it frames of light with `step`, get the events between them.

    spec      parameters of the sensor
    seed      0 ... 2**64 - 1: frozen maps and noise; the same seed is the same camera
    camera    0 ... 2**24 - 1: the camera's number in a rig, so that cameras of one seed differ
    threads   tiles worked on at a time; changes nothing but the time it takes
    labels    give each event its cause (`vid2ev.stream.events.Label`)
    transfer  what uint8 or uint16 frames are coded with ("srgb", "bt709", "linear", "gamma:2.2"); without it
              they are refused, because linear light was not promised
    skip      let strips of pixels sleep in which nothing can happen; changes nothing but the time it takes
              (`vid2ev.kernels.sleep`)

    Events of a step depend on the earlier frames only through the state, which `state` gives and `restore` takes.
    """

    at_once = 1  # frames that are best given together, to `see_all`

    def __init__(
        self,
        spec: DvsSpec,
        size: tuple[int, int],
        seed: int = 0,
        *,
        camera: int = 0,
        threads: int = 1,
        labels: bool = False,
        transfer: str | None = None,
        skip: bool = True,
    ):
        check_sensor(size, seed, camera, threads)
        width, height = size
        self.spec, self.size, self.seed, self.camera, self.labels = (
            spec,
            (width, height),
            seed,
            camera,
            labels,
        )
        self.transfer = transfer
        self.effects = spec.effects()
        self._flags = flags_of(spec, labels)
        self._numbers = numbers_of(spec, seed, camera)
        self._planes, self._bad = planes_of(spec, self._flags, self._numbers, width, height)
        self._frames = EventFrames(spec, width, height, labels) if spec.frame_rate_hz > 0 else None
        self._delayed = Delayed(spec.delay_us) if spec.delay_us > 0 else None
        self._tallies = np.zeros((threads, TALLIES), np.int64)
        self._polarities = np.zeros(2, np.int64)
        self._t_ns: int | None = None
        self._seen: np.ndarray | None = None  # the light of the last frame, as it was given
        self._leak_since_ns = 0
        self._step = 0
        self._fresh_noise = True
        self._sleep = Sleep(width * height, skip and not self._flags.noise)
        self._tiles = Tiles(-(-width * height // BLOCK), threads)
        self._work = [new_work() for _ in range(self._tiles.count)]
        self._buffers = [np.empty(4096, np.uint64) for _ in range(self._tiles.count)]
        self._tables: dict[Any, np.ndarray] = {}

    # ------------------------------------------------------------------------------------------------- light in

    def step(self, light: np.ndarray, t_ns: int, still: Still | None = None) -> Events:
        """Advance to a frame of light at t_ns [int, ns]; returns the events in (previous frame, this frame].

        `light` is [height, width]: floating point is linear light (1.0 diffuse white; NaN and negative count as 0,
        what is above 1e30 as 1e30), uint8 or uint16 are codes of `transfer`.  The first frame settles the sensor and
        has no events. `still`, where it is about the array of the last step, saves looking for what has not changed.
        Raises UsageError for another shape or type, or a time that is not after the last one.
        """
        if self._t_ns is None:
            return self.restart(light, t_ns)
        flat, table = self._light(light)
        t_ns = self._later(t_ns, self._t_ns)
        self._rebase_leak(t_ns)
        interval = interval_of(
            self._flags, self._numbers, self._t_ns, t_ns, self._leak_since_ns, self._step, self._fresh_noise
        )
        self._sleep.begin(interval, told_of(still, self._seen))
        events = self._events(self._walk(flat, table, interval), interval)
        self._sleep.end()
        self._t_ns, self._seen = t_ns, light
        self._step += 1
        self._fresh_noise = not interval.noise_resolved
        return self._passed_on(events, t_ns)

    def restart(self, light: np.ndarray, t_ns: int) -> Events:
        """Settle in a frame of light at t_ns [int, ns], as after a cut: the light before it is forgotten.

        There are no events in (previous frame, this frame]; only fixed-rate mode may return some, held back from
        before.  Noise goes on: what is drawn by count or by time is drawn on.  Raises UsageError as `step` does.
        """
        flat, table = self._light(light)
        self._seen = light
        if self._t_ns is None and self._frames is not None:
            self._frames.origin_us = int(t_ns) // 1000
        t_ns = self._later(t_ns, self._t_ns)
        self._settle(flat, table, t_ns)
        if self._delayed is not None:
            self._delayed.forget()
        released = Events.empty(self.labels)
        if self._frames is not None:
            released = self._frames.push(released, t_ns // 1000)
        return self._counted(released)

    def see(self, frame: Frame) -> Events:
        """`step` to a frame, or `restart` where it begins a new shot."""
        if frame.cut:
            return self.restart(frame.light, frame.t_ns)
        return self.step(frame.light, frame.t_ns, frame.still)

    def see_all(self, frames: Sequence[Frame]) -> list[Events]:
        """`see` for each frame."""
        return [self.see(frame) for frame in frames]

    def run(self, frames: Iterable[Frame]) -> Iterator[Events]:
        """`see` for each frame, and `flush` at the end: one Events per frame, the empty ones too, and the rest."""
        for frame in frames:
            yield self.see(frame)
        yield self.flush()

    def flush(self) -> Events:
        """Events that fixed-rate mode holds back because their event frame lies ahead; otherwise none."""
        return self._counted(self._frames.flush()) if self._frames is not None else Events.empty(self.labels)

    # ------------------------------------------------------------------------------------------------- state

    def state(self) -> dict[str, np.ndarray]:
        """Everything that later events depend on, as plain arrays (copies); needs at least one frame."""
        if self._t_ns is None:
            return {}
        self._rouse(np.arange(strip_count(*self.size)))
        state = {name: getattr(self._planes, name).copy() for name in STATE_PLANES}
        numbers = [self._t_ns, self._leak_since_ns, self._step, int(self._fresh_noise)]
        state["clock"] = np.array(numbers, np.int64)
        state["tallies"] = self._tallies.sum(axis=0)
        state["polarities"] = self._polarities.copy()
        for part in (self._frames, self._delayed):
            state |= part.state() if part is not None else {}
        return state

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state that a sensor of the same parameters, size, seed and camera gave."""
        self._sleep.forget()
        self._seen = None
        if not state:
            self._t_ns = None
            return
        for name in STATE_PLANES:
            plane = getattr(self._planes, name)
            if state[name].shape != plane.shape:
                raise UsageError(
                    f"state of {state[name].size} entries in '{name}', expected {plane.size}: another sensor's state"
                )
            plane[...] = state[name]
        self._t_ns, self._leak_since_ns, self._step, fresh = (int(value) for value in state["clock"])
        self._fresh_noise = bool(fresh)
        self._tallies[...] = 0
        self._tallies[0] = state["tallies"]
        self._polarities[...] = state["polarities"]
        for part in (self._frames, self._delayed):
            if part is not None:
                part.restore(state)

    def inside(self, pixels: np.ndarray) -> Inside:
        """What pixels [int, y * width + x] have in them after the last frame (`vid2ev.sensors.inside`)."""
        self._rouse(np.unique(pixels // STRIP))
        leak = self._numbers.leak_nat_per_ns * ((self._t_ns or 0) - self._leak_since_ns)
        return inside_of(pixels, self._planes, self._flags, self._numbers, leak)

    def maps(self) -> dict[str, np.ndarray]:
        """What is frozen in this sensor, each [height, width]: threshold_on and threshold_off [nat], hot, cold, and
        shading (optical gain)."""
        return maps_of(self._planes, self._flags, self._numbers, self._bad, self.size)

    @property
    def counts(self) -> dict[str, int]:
        """Events sent (`on`, `off`), crossings `swallowed` by the refractory period, pixel-intervals `capped` at
        `max_crossings`, and pixels `not_finite` (or negative, or above 1e30) that were mended."""
        tallies = self._tallies.sum(axis=0)
        off, on = (int(count) for count in self._polarities)
        swallowed, capped, not_finite = (int(tallies[k]) for k in (SWALLOWED, CAPPED, NOT_FINITE))
        return {"on": on, "off": off, "swallowed": swallowed, "capped": capped, "not_finite": not_finite}

    @property
    def slept(self) -> tuple[int, int]:
        """How many times a strip of 256 pixels slept through an interval, of how many."""
        return self._sleep.count

    # ------------------------------------------------------------------------------------------------- inside

    def _later(self, t_ns: int, last_ns: int | None) -> int:
        """The time of a frame, which must be after the last one."""
        t_ns = int(t_ns)
        if last_ns is not None and not last_ns < t_ns < last_ns + LONGEST_INTERVAL_NS:
            raise UsageError(
                f"frame time {t_ns} ns after {last_ns} ns: expected a later one, by at most 4.8 hours;"
                " sort the frames and drop repeated times"
            )
        return t_ns

    def _check_shape(self, shape: tuple[int, ...]) -> None:
        width, height = self.size
        if shape != (height, width):
            raise UsageError(f"light of shape {shape}: expected ({height}, {width}), rows and columns of this sensor")

    def _light(self, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        light = np.asarray(light)
        self._check_shape(light.shape)
        if light.dtype.kind == "f":
            flat = np.ascontiguousarray(light, None if light.dtype in (np.float32, np.float64) else np.float32)
            return flat.reshape(-1), np.empty(0, np.float32)
        if light.dtype not in (np.uint8, np.uint16) or self.transfer is None:
            raise UsageError(
                f"light of type {light.dtype}: expected floating point (linear light), or uint8 or uint16 with"
                " transfer='srgb', 'bt709', 'gamma:2.2' or 'linear'"
            )
        if light.dtype not in self._tables:
            self._tables[light.dtype] = self._table(8 * light.dtype.itemsize)
        return np.ascontiguousarray(light).reshape(-1), self._tables[light.dtype]

    def _table(self, bits: int) -> np.ndarray:
        assert self.transfer is not None
        if self.transfer == "linear":
            return np.array([1.0 / ((1 << bits) - 1)], np.float32)  # one entry: a product is faster than a look-up
        return code_table(self.transfer, bits)

    def _settle(self, flat: np.ndarray, table: np.ndarray, t_ns: int) -> None:
        def settle(k: int, first: int, last: int) -> None:
            settle_tile(
                first, last, self._bad.size, flat, table, t_ns, self._bad, self.spec.random_phase, self._planes,
                self._flags, self._numbers, self._work[k], self._tallies[k],
            )  # fmt: skip

        self._sleep.forget()
        self._tiles.each_blocks(settle)
        self._t_ns = self._leak_since_ns = t_ns
        self._fresh_noise = True
        self._planes.t_last[...] = max(t_ns - self._numbers.refractory_ns - 1, np.iinfo(np.int64).min)

    def _walk(self, flat: np.ndarray, table: np.ndarray, interval: Any) -> list[np.ndarray]:
        def walk(k: int, first: int, last: int) -> np.ndarray:
            self._buffers[k], n = walk_tile(
                first, last, self._bad.size, flat, table, self._sleep.naps, self._planes, self._flags, self._numbers,
                interval, self._work[k], self._buffers[k], self._tallies[k],
            )  # fmt: skip
            return self._buffers[k][:n]

        return self._tiles.each_blocks(walk)

    def _events(self, parts: list[np.ndarray], interval: Any) -> Events:
        ends = np.cumsum([0, *map(len, parts)])
        n, count = int(ends[-1]), len(parts)
        if n == 0:
            return Events.empty(self.labels)
        keys = np.empty(n, np.uint64)
        t, x, y, p = np.empty(n, np.int64), np.empty(n, np.uint16), np.empty(n, np.uint16), np.empty(n, np.uint8)
        label = np.empty(n if self.labels else 0, np.uint8)
        each = self._tiles.each if n > WORTH_THREADS else lambda work: [work(k) for k in range(count)]
        each(lambda k: order_keys(parts[k], interval.last_us, keys[ends[k] : ends[k + 1]]))
        each(lambda k: unpack(keys, ends, k, count, self.size[0], interval.first_us, t, x, y, p, label))
        return Events(t, x, y, p, label if self.labels else None)

    def _passed_on(self, events: Events, t_ns: int) -> Events:
        """What of the events up to t_ns is sent by then, through all that comes behind the comparator."""
        if self._delayed is not None:
            events = self._delayed.push(events, t_ns // 1000)
        if self._frames is not None:
            events = self._frames.push(events, t_ns // 1000)
        return self._counted(events)

    def _counted(self, events: Events) -> Events:
        on = int(np.count_nonzero(events.p))
        self._polarities += (len(events) - on, on)
        return events

    def _rebase_leak(self, t_ns: int) -> None:
        """Keep the leak small against the levels, whose float32 copies the scan compares."""
        assert self._t_ns is not None
        rate = self._numbers.leak_nat_per_ns
        if rate * (t_ns - self._leak_since_ns) > LEAK_REBASE_NAT and self._t_ns > self._leak_since_ns:
            risen = rate * (self._t_ns - self._leak_since_ns)
            shift_levels(self._bad.size, risen, self._planes, self._flags, self._numbers, self._work[0])
            self._leak_since_ns = self._t_ns
            self._sleep.wake()

    def _rouse(self, strips: np.ndarray) -> None:
        """Bring these strips up to the last frame, if they have slept."""
        late = self._sleep.late(strips)
        if late.size:
            rouse(late, self._bad.size, self._planes, self._sleep.naps, self._flags, self._numbers, self._work[0])
