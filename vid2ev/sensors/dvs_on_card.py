"""DvsOnCard: `Dvs` on a GPU, frame by frame or many frames at a time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import PITCH, stride_of
from vid2ev.sensors.card_walk import CardWalk
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.inside import Inside
from vid2ev.sensors.pixel_planes import by_block, fast_by_block, pixel_planes, uploaded
from vid2ev.sensors.pixels import STATE_PLANES
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still

if TYPE_CHECKING:
    from vid2ev.views.grid import Grid

FRAMES = 16  # at a time: the state of a pixel is read and written once for as many
LONGEST_NS = 1 << 36  # of these, but for a first that is longer: keys count microseconds, and forced events want room


class DvsOnCard(Dvs):
    """An event camera as `Dvs` is, with its pixels on a device: the same events, the same state.

    memory    the device (`vid2ev.kernels.cuda.memory`)

    Light may be a tensor of torch, on the device or not; it is then linear and floating point.
    """

    def __init__(
        self,
        spec: DvsSpec,
        size: tuple[int, int],
        seed: int = 0,
        *,
        memory: Any,
        camera: int = 0,
        labels: bool = False,
        transfer: str | None = None,
        origin_ns: int | None = None,
    ):
        options: dict[str, Any] = {"labels": labels, "transfer": transfer, "origin_ns": origin_ns}
        super().__init__(spec, size, seed, camera=camera, skip=False, **options)
        self._memory, self.at_once = memory, FRAMES
        self._load()

    def _load(self) -> None:
        """The sensor onto the device."""
        flags, numbers, bad = self._pixels.flags, self._pixels.numbers, self._pixels.bad
        self._of_fast, planes = int(stride_of(flags)) // PITCH, self._planes_of_pixels()
        phases = [self.spec.random_phase]
        self._card = CardWalk(self._memory, flags, [numbers], self.size, planes, bad, phases, self.labels)

    def renew(self, spec: DvsSpec, seed: int = 0, camera: int = 0) -> None:
        """`Dvs.renew`."""
        super().renew(spec, seed, camera)
        self._load()

    def step(self, light: Any, t_ns: int, still: Still | None = None) -> Events:
        """`Dvs.step`; light may be a tensor.  What is `still` saves nothing here: all pixels are glanced at."""
        self._intake.check(np.shape(light))
        return self.steps(_in_one(light)[None], [t_ns])[0]

    def steps(self, light: Any, t_ns: Sequence[int]) -> list[Events]:
        """`step` for each frame of light [frames, height, width] at t_ns [frames], in a few launches of kernels."""
        light = _in_one(light)
        sent, times = [], self.times_of(light[:, None], t_ns)
        if self._t_ns is None and times:
            sent.append(self.restart(light[0], times[0]))
        while len(sent) < len(times):
            assert self._t_ns is not None
            first, until_ns = len(sent), max(times[len(sent)], self._t_ns + LONGEST_NS)
            last = first + bisect_right(times[first : first + FRAMES], until_ns)
            sent += self._some(light[first:last], times[first:last])
        return sent

    def fill(self, grid: Grid, light: Any, t_ns: Sequence[int]) -> None:
        """`Dvs.fill`; `DvsBatchOnCard.fill` leaves the grids on the device."""
        for events in self.steps(light, t_ns):
            grid.add(events)

    def _see_shot(self, frames: Sequence[Frame]) -> list[Events]:
        for frame in frames:
            self._intake.check(np.shape(frame.light))
        lights = [self._memory.light(self._light(frame.light)[0])[None] for frame in frames]
        return self.steps(self._memory.joined(lights), [frame.t_ns for frame in frames])

    def _some(self, light: Any, t_ns: list[int]) -> list[Events]:
        seen, _ = self._light(light)
        sent = self._card.walk(seen, [self._steps_to(t_ns)])
        return [self._readout.push(*each) for each in zip(sent.of(0), t_ns, strict=True)]

    def state(self) -> dict[str, np.ndarray]:
        """`Dvs.state`: a sensor on a CPU can take it up."""
        self._download()
        return super().state()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """`Dvs.restore`: also of what a sensor on a CPU gave."""
        super().restore(state)
        self._card.be(self._planes_of_pixels(), self._pixels.tallies[0])

    def inside(self, pixels: np.ndarray) -> Inside:
        """`Dvs.inside`."""
        self._download()
        return super().inside(pixels)

    def forget_counts(self) -> None:
        """`Dvs.forget_counts`."""
        super().forget_counts()
        self._card.forget_tallies()

    @property
    def counts(self) -> dict[str, int]:
        """`Dvs.counts`."""
        self._pixels.tallies[0] = self._card.tallies()
        return super().counts

    def _light(self, light: Any) -> tuple[Any, np.ndarray]:
        """Linear light on its way to the device; what is coded is looked up here."""
        if not hasattr(light, "is_floating_point"):
            light = np.asarray(light)
            if light.dtype.kind == "f":
                self._intake.check(light.shape[-2:])
                return light, np.empty(0, np.float32)
            frames = [super(DvsOnCard, self)._light(frame) for frame in light.reshape(-1, *light.shape[-2:])]
            linear = [table[codes] if len(table) > 1 else codes.astype(np.float32) * table for codes, table in frames]
            return np.reshape(linear, light.shape), frames[0][1]
        self._intake.check(light.shape[-2:])
        if not light.is_floating_point():
            raise UsageError(f"light of type {light.dtype}: expected a tensor of floating point, which is linear light")
        return light, np.empty(0, np.float32)

    def _settle(self, flat: Any, table: np.ndarray, t_ns: int, count: int) -> None:
        self._card.settle(flat, [t_ns], [count])

    def _planes_of_pixels(self) -> Any:
        planes = pixel_planes(self._pixels.planes, self._pixels.flags, self._pixels.bad.size)
        return uploaded(self._memory, planes)

    def _download(self) -> None:
        """The state of the device into the planes of the walk on a CPU."""
        planes = self._card.download()
        planes["fast"] = fast_by_block(planes["fast"].reshape(-1, self._of_fast), self._of_fast)
        if self._pixels.planes.rest.size:
            planes["rest"] = by_block(planes["rest"].reshape(-1, 2), 2)
        for name in STATE_PLANES:
            plane = getattr(self._pixels.planes, name)
            if plane.size:
                plane[...] = planes[name].view(plane.dtype)
        self._pixels.tallies[0] = self._card.tallies()


def _in_one(light: Any) -> Any:
    """Light as an array, unless it is a tensor."""
    return light if hasattr(light, "is_floating_point") else np.asarray(light)
