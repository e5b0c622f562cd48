"""DvsBatch: event cameras of one size, each with its own clip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.limits import check_threads
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Tiles
from vid2ev.stream.events import Events
from vid2ev.terminal import counted

if TYPE_CHECKING:
    from vid2ev.views.grid import Grid

R = TypeVar("R")


@dataclass(frozen=True)
class BatchEvents:
    """Events of some frames of some clips."""

    clips: list[list[Events]]

    def of(self, clip: int) -> list[Events]:
        """Those of each interval of a clip."""
        return self.clips[clip]

    def __len__(self) -> int:
        return sum(len(events) for clip in self.clips for events in clip)


class DvsBatch:
    """Event cameras of `size` (width, height), one for each of `specs`: with any parameters, effects and seeds.

    seeds     of each, as of `Dvs`
    cameras   numbers of each, as of `Dvs`; by default 0
    threads   clips worked on at a time
    labels    give each event its cause
    transfer  what uint8 or uint16 frames are coded with, as of `Dvs`

    Each clip has the events that a `Dvs` of its spec, seed and camera would have.  Raises UsageError as `Dvs` does.
    """

    def __init__(
        self,
        specs: Sequence[DvsSpec],
        size: tuple[int, int],
        seeds: Sequence[int],
        *,
        cameras: Sequence[int] | None = None,
        threads: int = 1,
        labels: bool = False,
        transfer: str | None = None,
    ):
        check_threads(threads)
        self.size, options = size, {"labels": labels, "transfer": transfer, "skip": False}
        self._sensors = [
            Dvs(spec, size, seed, camera=camera, **options)  # type: ignore[arg-type]
            for spec, seed, camera in zip(specs, seeds, cameras_of(specs, seeds, cameras), strict=True)
        ]
        self._tiles = Tiles(len(self._sensors), threads)

    def renew(self, specs: Sequence[DvsSpec], seeds: Sequence[int], cameras: Sequence[int] | None = None) -> None:
        """Become other sensors, as many as before and without light yet, in the same arrays (`Dvs.renew`).

        Raises UsageError for another number of them, which changes nothing.
        """
        cameras = cameras_of(specs, seeds, cameras)
        if len(specs) != len(self._sensors):
            given, there = counted(len(specs), "spec"), counted(len(self._sensors), "sensor")
            raise UsageError(f"{given} for a batch of {there}: expected as many; make another batch")
        for sensor, spec, seed, camera in zip(self._sensors, specs, seeds, cameras, strict=True):
            sensor.renew(spec, seed, camera)

    def restart(self, light: np.ndarray, t_ns: Sequence[int]) -> None:
        """Settle each sensor in a frame of light [clips, height, width] at its t_ns [clips]."""
        light, times = self._checked(np.asarray(light)[None], np.asarray(t_ns)[None])
        self._all(lambda k: self._sensors[k].restart(light[0, k], times[k][0]))

    def steps(self, light: np.ndarray, t_ns: np.ndarray) -> BatchEvents:
        """Advance all through frames of light [frames, clips, height, width] at t_ns [frames, clips].

        A sensor without light settles in the first.  Raises UsageError for times that are not after those before, or
        not as many as the frames; then none of them has been seen.
        """
        light, times = self._checked(light, t_ns)
        return BatchEvents(self._all(lambda k: self._sensors[k].steps_of(light, k, times[k])))

    def fill(self, grids: Sequence[Grid], light: np.ndarray, t_ns: np.ndarray) -> None:
        """`steps`, but the events of each clip go straight into a grid of its own (`Dvs.fill`)."""
        light, times = self._checked(light, t_ns)
        if len(grids) != len(self._sensors):
            given, clips = counted(len(grids), "grid"), counted(len(self._sensors), "clip")
            raise UsageError(f"{given} for {clips}: expected one for each")
        self._all(lambda k: self._sensors[k].fill_of(grids[k], light, k, times[k]))

    def _checked(self, light: Any, t_ns: Any) -> tuple[np.ndarray, list[list[int]]]:
        """Light as an array of as many clips as there are sensors, in one piece, and the times of its frames."""
        light, times = np.ascontiguousarray(light), np.asarray(t_ns)
        clips, (width, height) = len(self._sensors), self.size
        if light.ndim != 4 or light.shape[1:] != (clips, height, width):
            raise UsageError(f"light of shape {light.shape}: expected (frames, {clips}, {height}, {width})")
        if times.shape != light.shape[:2]:
            raise UsageError(f"times of shape {times.shape}: expected {light.shape[:2]}, one for each frame and clip")
        return light, [sensor.times_of(light, times[:, k]) for k, sensor in enumerate(self._sensors)]

    def _all(self, work: Callable[[int], R]) -> list[R]:
        """[work(0), work(1) ...], of each clip, some at the same time."""
        runs = self._tiles.each_blocks(lambda _, first, last: [work(k) for k in range(first, last)])
        return [result for run in runs for result in run]


def cameras_of(specs: Sequence[DvsSpec], seeds: Sequence[int], cameras: Sequence[int] | None) -> Sequence[int]:
    """The numbers of the cameras of a batch.  Raises UsageError for one without sensors, and for other numbers of seeds
    or cameras than of these."""
    cameras = cameras if cameras is not None or not isinstance(specs, Sequence) else [0] * len(specs)
    for name, values in (("specs", specs), ("seeds", seeds), ("cameras", cameras)):
        if not isinstance(values, Sequence | np.ndarray):
            raise UsageError(
                f"{name} of type {type(values).__name__}: expected a list, with one for each sensor of the batch"
            )
    if not specs or not len(specs) == len(seeds) == len(cameras):
        given = f"{counted(len(specs), 'spec')}, {counted(len(seeds), 'seed')} and {counted(len(cameras), 'camera')}"
        raise UsageError(f"a batch of {given}: expected one of each for every sensor, and at least one")
    return cameras
