"""Cis: light in, exposures out, one frame of light at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.physics.shutter import interval_weights, opening_ns, whole_parts_ns
from vid2ev.sensors.cis_readout import frozen_of, numbers_of
from vid2ev.sensors.cis_rows import Rows
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.limits import check_sensor, check_spec, time_ns
from vid2ev.stream.exposures import Exposure
from vid2ev.stream.frames import Frame
from vid2ev.stream.saved import check_mark, clock, entry, mark_of

__all__ = ["Cis", "CisSpec"]

OPEN_BYTES = 1 << 32  # of the sums of all exposures that are open at a time
NEVER_NS = 1 << 64  # after the first frame: later than any other


@dataclass(slots=True)
class Open:
    """An exposure that has begun: its number, when it opens [ns], the sums of its rows, and what weight the last frame
    of light still has to be added with."""

    index: int
    start_ns: int
    total: Any  # float64 [H, n], where the rows are
    pending: np.ndarray  # float64 [H]


class Cis:
    """A frame camera of `size` (width, height): feed it frames of light with `step`, get the exposures they complete.

    spec      parameters of the sensor
    seed      0 ... 2**64 - 1: fixed pattern and noise; the same seed is the same camera
    camera    0 ... 2**24 - 1: the camera's number in a rig, so that cameras of one seed differ
    threads   rows worked on at a time; changes nothing but the time it takes
    linear    give each exposure its exact `light`, too, before electrons, noise and ADC

    The frames of light are its samples in time; between them it is a straight line, and the exposures are its exact
    integral, whatever the rates.  The first exposure opens with the first frame of light, the k-th k / frame_rate_hz
    later, up to the last of a `burst`.  Exposures depend on the earlier frames only through the state, which `state`
    gives and `restore` takes.
    """

    def __init__(
        self,
        spec: CisSpec,
        size: tuple[int, int],
        seed: int = 0,
        *,
        camera: int = 0,
        threads: int = 1,
        linear: bool = False,
    ):
        check_spec(spec, CisSpec, "load_cis('ideal')")
        self.size = width, height = check_sensor(size, seed, camera, threads)
        self.spec, self.seed, self.camera, self.linear = spec, seed, camera, linear
        self.effects = spec.effects()
        shape = (height, width * (3 if spec.colour else 1))
        if spec.in_flight(height) * shape[0] * shape[1] * 8 > OPEN_BYTES:
            raise UsageError(
                f"{spec.in_flight(height)} exposures of {width}x{height} pixels open at a time: expected to hold them"
                " in 4 GiB; shorten exposure_us or line_us, or lower frame_rate_hz"
            )
        self._row_ns = whole_parts_ns(np.arange(height) * spec.line_us)
        self._exposure_ns = float(whole_parts_ns(spec.exposure_us))
        self._numbers = numbers_of(spec, seed, camera)
        frozen = frozen_of(spec, self._numbers, self.size)
        self._rows: Any = Rows(shape, self._numbers, frozen, threads, colour=spec.colour, linear=linear)
        self._t_ns: int | None = None
        self._first_ns = self._next = self._made = self._unfinished = 0
        self._open: list[Open] = []
        self._spare: list[Any] = []  # sums that are free again, and zero

    # ------------------------------------------------------------------------------------------------- light in

    def step(self, light: np.ndarray, t_ns: int, *, cut: bool = False) -> list[Exposure]:
        """Advance to a frame of light at t_ns [int, ns]; returns the exposures whose last row closes in (previous
        frame, this frame], in order.

        `light` is linear, floating point, [height, width, 3] (red, green, blue), or [height, width] if the spec's
        `colour` is false; NaN and negative count as 0, what is above 1e30 as 1e30.  With `cut` the light steps to it at
        t_ns instead of ramping.  Raises UsageError for another shape or type, or a time that is not after the last one.
        """
        return list(self._advance(light, t_ns, cut))

    def see(self, frame: Frame) -> list[Exposure]:
        """`step` to a frame, with a step of the light where it begins a new shot."""
        return list(self.exposures(frame))

    def exposures(self, frame: Frame) -> Iterator[Exposure]:
        """`see`, but an exposure at a time, however many there are between two frames; take all of them."""
        return self._advance(frame.light if self.spec.colour else frame.luminance, frame.t_ns, frame.cut)

    def run(self, frames: Iterable[Frame]) -> Iterator[Exposure]:
        """The `exposures` of each frame, and `flush` at the end."""
        for frame in frames:
            yield from self.exposures(frame)
        self.flush()

    def flush(self) -> list[Exposure]:
        """End the light: exposures that it did not last for are dropped and counted (`unfinished`); returns none."""
        begun = [each for each in self._open if each.start_ns < (self._t_ns or 0) or self.spec.exposure_us == 0]
        self._unfinished += len(begun)
        self._open.clear()
        return []

    # ------------------------------------------------------------------------------------------------- state

    def state(self) -> dict[str, np.ndarray]:
        """Everything that later exposures depend on, as plain arrays (copies); nothing before the first frame."""
        if self._t_ns is None:
            return {}
        clock = [self._t_ns, self._first_ns, self._next]
        return {
            "clock": np.array(clock, np.int64),
            "counts": np.array(list(self.counts.values()), np.int64),
            "light": self._rows.get(self._rows.before),
            "open": np.array([(each.index, each.start_ns) for each in self._open], np.int64).reshape(-1, 2),
            "totals": np.array([self._rows.get(each.total) for each in self._open]).reshape(-1, *self._rows.shape),
            "pending": np.array([each.pending for each in self._open]).reshape(-1, self._rows.shape[0]),
        } | self._mark()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state that a sensor of the same parameters, size, seed and camera gave.

        Raises UsageError for another, which changes nothing.
        """
        if not state:
            self._open.clear()
            self._t_ns, self._first_ns, self._next = None, 0, 0
            self._made = self._unfinished = self._rows.mended = 0
            return
        check_mark(state, self._mark())
        shape = self._rows.shape
        light = entry(state, "light", np.float32, shape)
        begun = entry(state, "open", np.int64, (None, 2))
        totals = entry(state, "totals", np.float64, (len(begun), *shape)) if len(begun) else begun
        pending = entry(state, "pending", np.float64, (len(begun), shape[0])) if len(begun) else begun
        counts, (t_ns, first_ns, following) = clock(state, "counts", 3), clock(state, "clock", 3)
        open_ns = [first_ns + self._opening_ns(k) for k in (following - 1, following)]
        if following < 1 or not open_ns[0] <= t_ns < open_ns[1]:
            raise UsageError(f"state of a frame camera at {t_ns} ns before exposure {following} since {first_ns} ns")
        self._t_ns, self._first_ns, self._next = t_ns, first_ns, following
        self._made, self._unfinished, self._rows.mended = counts
        self._rows.before = self._rows.put(light)
        self._open = [
            Open(int(index), int(start_ns), self._rows.put(total), rows.copy())
            for (index, start_ns), total, rows in zip(begun, totals, pending, strict=True)
        ]

    @property
    def counts(self) -> dict[str, int]:
        """Exposures made (`frames`), those that the light did not last for (`unfinished`, after `flush`), and values
        `not_finite` (or above 1e30, or negative where colours cannot be) that were mended."""
        return {"frames": self._made, "unfinished": self._unfinished, "not_finite": self._rows.mended}

    def maps(self) -> dict[str, np.ndarray]:
        """What is frozen in this sensor, float32, each of the shape of a picture: `gain` (relative sensitivity), `dark`
        (dark signal [electrons]), and shading (optical gain)."""
        names, shape = {"gain": "gain", "dark": "dark", "shading": "shade"}, self._rows.shape
        planes = self._rows.frozen.padded()._asdict()
        return {name: self._shaped(np.broadcast_to(planes[field], shape).copy()) for name, field in names.items()}

    # ------------------------------------------------------------------------------------------------- inside

    def _mark(self) -> dict[str, np.ndarray]:
        return mark_of(self.spec, self.size, self.seed, self.camera)

    def _advance(self, light: np.ndarray, t_ns: int, cut: bool) -> Iterator[Exposure]:
        """The exposures that a frame completes; all of them are to be taken before the next frame comes."""
        rows, t_ns = self._light(light), self._later(t_ns)
        self._rows.take(rows)
        if self._t_ns is None:  # the first frame: as if its light had been there for a moment
            self._first_ns, self._t_ns = t_ns, t_ns - 1
            self._rows.before[...] = self._rows.after
        since_ns, begun = self._t_ns, self._open
        self._t_ns, self._open = t_ns, []
        for each in begun:
            yield from self._expose(each, since_ns, cut)
        while (start_ns := self._first_ns + self._opening_ns(self._next)) <= t_ns:
            self._next += 1
            yield from self._expose(self._opened(self._next - 1, start_ns), since_ns, cut)
        self._rows.pass_on()

    def _opening_ns(self, k: int) -> int:
        """When exposure k opens [ns after the first]; those after the burst never do."""
        return NEVER_NS if 0 < self.spec.burst <= k else opening_ns(k, self.spec.frame_rate_hz)

    def _expose(self, each: Open, since_ns: int, cut: bool) -> Iterator[Exposure]:
        """Give an exposure the light from `since_ns` until now; it comes out if its last row closes."""
        assert self._t_ns is not None
        row_ns = self._row_ns + (each.start_ns - since_ns)
        before, after, closed = self._weights(row_ns, self._t_ns - since_ns, cut)
        before += each.pending  # (a frame's two sides are added at once, when the next frame is there)
        each.pending, after = np.where(closed, 0.0, after), np.where(closed, after, 0.0)
        if before.any() or after.any():
            self._rows.add(each.total, before, after)
        if closed[-1]:
            yield self._read(each)
        else:
            self._open.append(each)

    def _weights(self, row_ns: np.ndarray, length_ns: int, cut: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`interval_weights` of rows that open at row_ns; without blur those of the middles of their windows."""
        exposure_ns = self._exposure_ns
        if self.spec.blur:
            return interval_weights(row_ns, exposure_ns, length_ns, cut)
        before, after, _ = interval_weights(row_ns + exposure_ns / 2, 0.0, length_ns, cut)
        return before, after, row_ns + exposure_ns <= length_ns

    def _read(self, each: Open) -> Exposure:
        """Read out an exposure; its sums are free for another one."""
        codes, light = self._rows.read(each.total, each.index)
        self._spare.append(each.total)
        self._made += 1
        end_ns = each.start_ns + round(self._row_ns[-1] + self._exposure_ns)
        made = None if light is None else self._shaped(light)
        return Exposure(self._shaped(codes), each.start_ns, end_ns, each.index, made)

    def _opened(self, index: int, start_ns: int) -> Open:
        total = self._spare.pop() if self._spare else self._rows.sums()
        return Open(index, start_ns, total, np.zeros(self._rows.shape[0]))

    def _light(self, light: Any) -> Any:
        """Light as rows [H, n]."""
        light = np.asarray(light)
        self._check(light.shape, light.dtype, light.dtype.kind == "f")
        wanted = None if light.dtype in (np.float32, np.float64) else np.float32
        with np.errstate(over="ignore"):  # (what is beyond float32 becomes infinite, and is mended)
            return np.ascontiguousarray(light, wanted).reshape(self._rows.shape)

    def _check(self, shape: tuple[int, ...], dtype: Any, floating: bool) -> None:
        """Raises UsageError for light of another shape than the sensor's, and for codes."""
        width, height = self.size
        expected = (height, width, 3) if self.spec.colour else (height, width)
        if shape != expected:
            remedy = "open the source with colour='rgb', or set cis.colour=false" if len(shape) == 2 else "resize it"
            raise UsageError(f"light of shape {shape}: expected {expected} of this sensor; {remedy}")
        if not floating:
            raise UsageError(f"light of type {dtype}: expected floating point, linear; decode the codes first")

    def _later(self, t_ns: int) -> int:
        """The time of a frame, which must be after the last one."""
        t_ns = time_ns(t_ns)
        if self._t_ns is not None and t_ns <= self._t_ns:
            raise UsageError(
                f"frame time {t_ns} ns after {self._t_ns} ns: expected a later one; sort the frames and drop repeated"
                " times"
            )
        return t_ns

    def _shaped(self, rows: np.ndarray) -> np.ndarray:
        return rows.reshape(self.size[1], self.size[0], 3) if self.spec.colour else rows
