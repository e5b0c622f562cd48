"""Dvs: light in, events out, one frame at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import BLOCK
from vid2ev.kernels.naps import AT_ONCE
from vid2ev.sensors.clock import Clock, Step, first_count, later
from vid2ev.sensors.dvs_readout import DvsReadout
from vid2ev.sensors.inside import Inside
from vid2ev.sensors.intake import Intake
from vid2ev.sensors.limits import check_sensor, check_spec, time_ns
from vid2ev.sensors.pixels import Pixels
from vid2ev.sensors.sent import Sent
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import WHOLE, Part
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.stream.saved import check_mark, clock, mark_of
from vid2ev.stream.still import Still, nothing_told, told_of
from vid2ev.terminal import counted

if TYPE_CHECKING:
    from vid2ev.views.grid import Grid

__all__ = ["Dvs", "DvsSpec"]

AT_ONCE_PX, MOST = 1 << 23, 8  # pixels of frames that wait until they are seen together, and how many frames


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
    part      pixels, in blocks of 2048, that are simulated; the others send nothing, and these what they always do
    origin_ns   instant from which noise by count is counted: the same for parts of one recording; the first frame's
              unless given

    Events of a step depend on the earlier frames only through the state, which `state` gives and `restore` takes.
    """

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
        part: Part = WHOLE,
        origin_ns: int | None = None,
    ):
        self.size, self.labels, self.transfer = check_sensor(size, seed, camera, threads), labels, transfer
        self._intake = Intake(self.size, transfer)
        self._pixels = Pixels(self.size, labels, threads, skip, part)
        self._first_ns = None if origin_ns is None else time_ns(origin_ns, "origin_ns")
        pixels = self.size[0] * self.size[1]
        self.at_once = max(1, min(MOST, AT_ONCE_PX // pixels))  # frames best given together to `see_all`
        self._be(spec, seed, camera)

    def _be(self, spec: DvsSpec, seed: int, camera: int) -> None:
        """A sensor without light."""
        check_spec(spec, DvsSpec, "load_sensor('ideal')")
        self.spec, self.seed, self.camera, self.effects = spec, seed, camera, spec.effects()
        self._pixels.be(spec, seed, camera)
        self._readout = DvsReadout(spec, self.size, self.labels)
        self._t_ns: int | None = None
        self._origin_ns = self._first_ns
        self._seen: np.ndarray | None = None  # the light of the last frame, as it was given
        self._leak_since_ns = 0
        self._step = 0
        self._fresh_noise = True

    def renew(self, spec: DvsSpec, seed: int = 0, camera: int = 0) -> None:
        """Become another sensor, without light yet: what `Dvs(spec, size, seed, camera=camera, ...)` is, for less.

        Its arrays serve again if the effects are the same.  Raises UsageError as `Dvs` does.
        """
        check_sensor(self.size, seed, camera, 1)
        self._be(spec, seed, camera)

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
        self._intake.check(np.shape(light))
        flat, table = self._light(light)
        sent = self._pixels.walk(flat, table, self._steps_to([t_ns]), told_of([still], [self._seen]))
        self._seen = light
        return self._in_order(sent, [t_ns])[0]

    def steps(self, light: np.ndarray, t_ns: Sequence[int]) -> list[Events]:
        """`step` for each frame of light [frames, height, width] at t_ns [frames].

        Faster than that: some frames go through the walk at a time.  Raises UsageError as `step` does, and for another
        number of times than of frames; then none of them has been seen.
        """
        return self.steps_of(self._intake.frames(light)[:, None], 0, t_ns)

    def steps_of(self, light: np.ndarray, clip: int, t_ns: Sequence[int] | np.ndarray) -> list[Events]:
        """`steps` of one of the clips of light [frames, clips, height, width]."""
        return list(self._each(light, clip, self.times_of(light, t_ns)))

    def times_of(self, light: np.ndarray, t_ns: Sequence[int] | np.ndarray) -> list[int]:
        """The times of frames of light [frames, clips, height, width], each after the one before it.

        Raises UsageError as `steps` does.
        """
        self._intake.check(np.shape(light)[2:])
        if np.shape(t_ns) != (len(light),):
            given, frames = counted(np.size(t_ns), "time"), counted(len(light), "frame")
            raise UsageError(f"{given} for {frames} of light: expected a list of one for each")
        times: list[int] = []
        for t in t_ns:
            times.append(later(t, times[-1] if times else self._t_ns))
        return times

    def fill(self, grid: Grid, light: np.ndarray, t_ns: Sequence[int]) -> None:
        """`steps`, but events go straight into a grid (`vid2ev.views.grid`), without being put in order.

        The grid has then what it would have of the events of `steps`, to the bit.
        """
        self.fill_of(grid, self._intake.frames(light)[:, None], 0, t_ns)

    def fill_of(self, grid: Grid, light: np.ndarray, clip: int, t_ns: Sequence[int] | np.ndarray) -> None:
        """`fill` of one of the clips of light [frames, clips, height, width]."""
        times = self.times_of(light, t_ns)
        if not self._readout.at_once:
            for events in self._each(light, clip, times):
                grid.add(events)
            return
        for sent, _ in self._through(light, clip, times):
            for events in sent.unordered():
                grid.add(self._readout.counted(events))

    def restart(self, light: np.ndarray, t_ns: int) -> Events:
        """Settle in a frame of light at t_ns [int, ns], as after a cut: the light before it is forgotten.

        There are no events in (previous frame, this frame]; only fixed-rate mode may return some, held back from
        before.  What follows is what a new sensor of the same seed would send whose first frame this is (but for fixed
        rate, whose event frames go on) and which counts from the same origin.  Raises UsageError as `step`
        does.
        """
        self._intake.check(np.shape(light))
        flat, table = self._light(light)
        t_ns = later(t_ns, self._t_ns)
        self._seen = light
        if self._t_ns is None:
            self._readout.begin(t_ns)
        self._origin_ns = t_ns if self._origin_ns is None else self._origin_ns
        count = first_count(t_ns, self._origin_ns)
        self._settle(flat, table, t_ns, count)
        self._be_at(Clock(t_ns, count))
        return self._readout.cut(t_ns)

    def see(self, frame: Frame) -> Events:
        """`step` to a frame, or `restart` where it begins a new shot."""
        if frame.cut:
            return self.restart(frame.light, frame.t_ns)
        return self.step(frame.light, frame.t_ns, frame.still)

    def see_all(self, frames: Sequence[Frame]) -> list[Events]:
        """`see` for each frame.  Faster than that: frames of one shot go through the walk together.

        Best are `at_once` at a time, of linear light.
        """
        sent: list[Events] = []
        while rest := frames[len(sent) :]:
            shot = list(takewhile(partial(_goes_on, rest[0].light.dtype), rest)) if self._t_ns is not None else []
            sent += self._see_shot(shot[:AT_ONCE]) if len(shot) > 1 else [self.see(rest[0])]
        return sent

    def run(self, frames: Iterable[Frame]) -> Iterator[Events]:
        """`see` for each frame, and `flush` at the end: one Events per frame, the empty ones too, and the rest."""
        for frame in frames:
            yield self.see(frame)
        yield self.flush()

    def flush(self) -> Events:
        """Events that fixed-rate mode holds back because their event frame lies ahead; otherwise none."""
        return self._readout.flush()

    # ------------------------------------------------------------------------------------------------- state

    def state(self) -> dict[str, np.ndarray]:
        """Everything that later events depend on, as plain arrays (copies); nothing before the first frame."""
        if self._t_ns is None:
            return {}
        state = self._pixels.state()
        numbers = [self._t_ns, self._leak_since_ns, self._step, int(self._fresh_noise), self._origin_ns]
        state["clock"] = np.array(numbers, np.int64)
        return state | self._readout.state() | self._mark()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state that a sensor of the same parameters, size, seed and camera gave.

        Raises UsageError for another, which changes nothing.
        """
        if not state:
            self._be(self.spec, self.seed, self.camera)
            return
        check_mark(state, self._mark())
        numbers = clock(state, "clock", 5)
        for take_up in [self._pixels.restoring(state), self._readout.restoring(state)]:  # (both look at it first)
            take_up()
        self._seen = None
        self._t_ns, self._leak_since_ns, self._step, fresh, self._origin_ns = numbers
        self._fresh_noise = bool(fresh)

    def inside(self, pixels: np.ndarray) -> Inside:
        """What pixels [int, y * width + x] have in them after the last frame (`vid2ev.sensors.inside`).

        Raises UsageError for pixels that this sensor does not have, and for what is no list of them.
        """
        pixels, count = np.asarray(pixels), self.size[0] * self.size[1]
        if pixels.ndim != 1 or pixels.dtype.kind not in "iu" or np.any((pixels < 0) | (pixels >= count)):
            raise UsageError(f"pixels {pixels}: expected a list of whole numbers from 0 to {count - 1}, y * width + x")
        leak_nat = self._pixels.numbers.leak_nat_per_ns * ((self._t_ns or 0) - self._leak_since_ns)
        return self._pixels.inside(pixels, leak_nat)

    def maps(self) -> dict[str, np.ndarray]:
        """What is frozen in this sensor, each [height, width]: threshold_on and threshold_off [nat], hot, cold, and
        shading (optical gain)."""
        return self._pixels.maps()

    @property
    def counts(self) -> dict[str, int]:
        """Events sent (`on`, `off`), crossings `swallowed` by the refractory period, pixel-intervals `capped` at
        `max_crossings`, and pixels `not_finite` (or negative, or above 1e30) that were mended."""
        off, on = (int(count) for count in self._readout.polarities)
        return {"on": on, "off": off} | self._pixels.tallied()

    def forget_counts(self) -> None:
        """Count anew what `counts` has."""
        self._pixels.tallies[...], self._readout.polarities[...] = 0, 0

    def simulates(self, pixel: tuple[int, int]) -> bool:
        """Whether a pixel (x, y) is in the `part` that is simulated."""
        return self._pixels.tiles.holds((pixel[1] * self.size[0] + pixel[0]) // BLOCK)

    @property
    def slept(self) -> tuple[int, int]:
        """How many times a strip of 256 pixels slept through an interval, of how many."""
        return self._pixels.sleep.count

    # ------------------------------------------------------------------------------------------------- inside

    def _mark(self) -> dict[str, np.ndarray]:
        return mark_of(self.spec, self.size, self.seed, self.camera)

    def _light(self, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Light [..., height, width] as the walk takes it, with the table of its codes."""
        return self._intake.flat(light)

    def _settle(self, flat: np.ndarray, table: np.ndarray, t_ns: int, count: int) -> None:
        self._pixels.settle(flat, table, t_ns, count)

    def _steps_to(self, t_ns: Sequence[int]) -> list[Step]:
        """The intervals up to each of these times, which are then over."""
        assert self._t_ns is not None
        clock = Clock(self._t_ns, self._step, self._leak_since_ns, self._fresh_noise)
        steps = [clock.step_to(later(t, clock.t_ns), self._pixels.flags, self._pixels.numbers) for t in t_ns]
        self._be_at(clock)
        return steps

    def _be_at(self, clock: Clock) -> None:
        self._t_ns, self._step, self._leak_since_ns = clock.t_ns, clock.step, clock.leak_since_ns
        self._fresh_noise = clock.fresh_noise

    def _each(self, light: np.ndarray, clip: int, t_ns: list[int]) -> Iterator[Events]:
        """The events of each frame of a clip."""
        if self._t_ns is None and t_ns:
            yield Events.empty(self.labels)  # (of the frame in which it settles)
        for sent, times in self._through(light, clip, t_ns):
            yield from self._in_order(sent, times)

    def _through(self, light: np.ndarray, clip: int, t_ns: list[int]) -> Iterator[tuple[Sent, list[int]]]:
        """What is sent in the frames of a clip of light [frames, clips, height, width], some at a time; their times."""
        if self._t_ns is None and t_ns:
            self.restart(light[0, clip], t_ns[0])
            light, t_ns = light[1:], t_ns[1:]
        flat, table = self._light(light)
        of_clip = flat[clip :: light.shape[1]]
        for first in range(0, len(t_ns), AT_ONCE):
            times = t_ns[first : first + AT_ONCE]
            steps, told = self._steps_to(times), nothing_told(len(times))
            yield self._pixels.walk(of_clip[first : first + AT_ONCE], table, steps, told), times
        self._seen = None

    def _see_shot(self, frames: Sequence[Frame]) -> list[Events]:
        """`see_all` of some frames after each other, at most AT_ONCE."""
        lights, t_ns = [frame.light for frame in frames], [frame.t_ns for frame in frames]
        for light in lights:
            self._intake.check(np.shape(light))
        seen = [self._light(light) for light in lights]
        told = told_of([frame.still for frame in frames], [self._seen, *lights[:-1]])
        sent = self._pixels.walk([flat[0] for flat, _ in seen], seen[0][1], self._steps_to(t_ns), told)
        self._seen = lights[-1]
        return self._in_order(sent, t_ns)

    def _in_order(self, sent: Sent, t_ns: Sequence[int]) -> list[Events]:
        """The events of each of the frames that went through the walk together."""
        return [self._readout.push(*each) for each in zip(sent.ordered(self._pixels.tiles.each), t_ns, strict=True)]


def _goes_on(kind: np.dtype, frame: Frame) -> bool:
    """Whether a frame may go through the walk with those before it, whose light is of a kind."""
    return not frame.cut and frame.light.dtype == kind
