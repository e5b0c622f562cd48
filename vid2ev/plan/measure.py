"""`Measure`: the scene of a clip, one frame at a time."""

from __future__ import annotations

import math

import numpy as np

from vid2ev.bounds.scene import DISTANCE_TAU_S, OF_BARE, OF_TILES, SPREAD, Scene
from vid2ev.errors import UsageError
from vid2ev.kernels.calm import STRIPS
from vid2ev.kernels.layout import BLOCK, PITCH
from vid2ev.kernels.measure import LEAST, Pace, Seen, measure_blocks, settle_measure
from vid2ev.kernels.measure_bare import BARE_FIGURES, BARE_PLANES, Bare, end_bare
from vid2ev.kernels.measured import (
    BY_ALL,
    BY_JUMPS,
    FIGURES,
    LANES,
    LIGHT,
    PLANES,
    PUSHED_S,
    QUARTERS,
    SCRATCH,
    TRAVEL,
    TRAVELLED,
    TURNED,
)
from vid2ev.kernels.play import end_measure
from vid2ev.kernels.work import aligned
from vid2ev.physics.log_curve import curve_of
from vid2ev.physics.omission import tracks
from vid2ev.physics.shading import shading_map
from vid2ev.physics.thresholds import spread_thresholds, widest
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Tiles
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import told_of

BRIGHTNESS_EVERY = 8  # frames
TIMED = [TRAVELLED, PUSHED_S, TURNED]
LIGHTS = 41  # octaves of light, from 2**-20 to 2**20


class Measure:
    """What a sensor of `size` (width, height) sees, measured while frames go by: `see` each, then ask for `scene`.

    The light that is measured is that behind the sensor's lens shading.  Memory is 85 bytes a pixel, for a
    shading 38 more, for memories that jump to the signal 8, and that of the last frame.  What frames say of what is
    still (`Frame.still`) is taken for granted where it is about the last one.  `threads` change nothing but the time it
    takes.
    """

    def __init__(self, spec: DvsSpec, size: tuple[int, int], threads: int = 1):
        width, height = size
        self.spec, self.size = spec, (width, height)
        self._curve = curve_of(spec.log_curve, spec.dark_level)
        self._half = 0.5 * min(spec.threshold_on, spec.threshold_off)
        self._wide = 0.5 * widest(spec)
        self._halves = (0.5 * spread_thresholds(2 * self._half, spec, BLOCK)).astype(np.float32)
        self._shade = shading_map(spec.shading, width, height).ravel() if spec.shading else np.empty(0, np.float32)
        blocks = -(-width * height // BLOCK)
        self._found = Seen(
            state=np.zeros(blocks * PLANES * PITCH, np.float32),
            calm=np.zeros((blocks, STRIPS), np.uint8),
            owed=np.ones((blocks, STRIPS, 2), np.float32),
            tiles=np.zeros((blocks, FIGURES)),
            spread=np.zeros((blocks, BY_JUMPS if tracks(spec) else BY_ALL, QUARTERS, 2)),
            bare=(_bare(blocks),) if spec.shading else (),
        )
        self._found.tiles[:, LEAST] = np.inf
        self._cut = Tiles(blocks, threads)
        self._work = [_scratch() for _ in range(self._cut.count)]
        self._brightness = np.zeros(LIGHTS)
        self._tau1_s, self._tau2_s = spec.photoreceptor_tau_us * 1e-6, spec.follower_tau_us * 1e-6
        self._by_light = spec.bandwidth == "light" and self._tau1_s > 0
        self._blind_s = spec.refractory_us * 1e-6 if tracks(spec) else 0.0
        self._frames, self._ns, self._shortest_ns = 0, 0, math.inf
        self._shot_ns, self._longest_ns, self._longest_interval_ns = 0, 0, 0
        self._when = np.zeros((blocks, len(TIMED)))  # sums of figures times the time since the shot began [s]
        self._t_ns: int | None = None
        self._dt_s = math.inf
        self._pace: Pace | None = None  # of the last interval of a shot
        self._last: np.ndarray | None = None  # the light of the last frame, as it was given

    def see(self, frame: Frame) -> None:
        """The next frame of luminance [H, W]; raises UsageError for another shape, or a time that is not later."""
        width, height = self.size
        if frame.light.shape != (height, width):
            raise UsageError(f"light of shape {frame.light.shape}: expected ({height}, {width}), this sensor's pixels")
        if self._t_ns is not None and frame.t_ns <= self._t_ns:
            raise UsageError(f"frame time {frame.t_ns} ns after {self._t_ns} ns: expected a later one; sort the frames")
        light = np.ascontiguousarray(frame.light, np.float32).reshape(-1)
        if self._t_ns is None or frame.cut:
            self._when = self._end(self._found)
            below = self._wide if self.spec.random_phase else 0.0
            settle_measure(
                light, self._shade, self._curve, self._halves, below, self.spec.filter == "before", self._found
            )
            self._dt_s, self._pace, self._shot_ns = math.inf, None, 0
        else:
            before = self._found.tiles[:, TIMED]
            dt_ns = frame.t_ns - self._t_ns
            self._advance(light, told_of([frame.still], [self._last])[0], dt_ns * 1e-9)
            self._ns += dt_ns
            self._shot_ns += dt_ns
            self._longest_ns = max(self._longest_ns, self._shot_ns)
            self._when += self._timed(self._found.tiles, before)
            self._shortest_ns = min(self._shortest_ns, dt_ns)
            self._longest_interval_ns = max(self._longest_interval_ns, dt_ns)
        if self._frames % BRIGHTNESS_EVERY == 0:
            self._note_brightness(self._plane(LIGHT)[:, :BLOCK].reshape(-1)[: light.size : 16])
        self._frames, self._t_ns, self._last = self._frames + 1, frame.t_ns, frame.light

    def scene(self) -> Scene:
        """What was seen so far."""
        travel, found = self._plane(TRAVEL), _with_own_sums(self._found)
        when_s = (self._end(found) / np.maximum(found.tiles[:, TIMED], 1e-300)).T
        bare = found.bare[0] if found.bare else _bare(len(travel), planes=0)
        return Scene(
            size=self.size,
            frames=self._frames,
            seconds=self._ns * 1e-9,
            shortest_s=self._shortest_ns * 1e-9,
            longest_s=self._longest_ns * 1e-9,
            longest_interval_s=self._longest_interval_ns * 1e-9,
            **dict(zip(("travelled_when_s", "pushed_when_s", "turned_when_s"), when_s, strict=True)),
            threshold=2 * self._half,
            moving=int(np.count_nonzero(travel)),
            busiest=float(travel.max()),
            by_pixel=_by_events(travel.ravel(), 2 * self._half),
            **dict(zip(SPREAD, _spread(found.spread, len(SPREAD)), strict=True)),
            brightness=self._brightness.copy(),
            **dict(zip(OF_TILES, found.tiles.T, strict=True)),
            **dict(zip(OF_BARE, bare.tiles.T, strict=True)),
            by_bare=_spread(bare.spread, 1)[0],
        )

    def _end(self, found: Seen) -> np.ndarray:
        """Add the end of a shot to the sums of what was found; returns those of figures and times."""
        before = found.tiles[:, TIMED]
        if self._pace is not None:
            end_measure(self._pace, found.state, found.tiles, found.spread)
            for bare in found.bare:
                end_bare(self._pace, bare)
        return self._when + self._timed(found.tiles, before)

    def _timed(self, tiles: np.ndarray, before: np.ndarray) -> np.ndarray:
        """What came to figures since then, times the time since the shot began."""
        return (tiles[:, TIMED] - before) * (self._shot_ns * 1e-9)

    def _advance(self, light: np.ndarray, told: np.ndarray, dt_s: float) -> None:
        smooth_s = 0.0 if self._by_light else max(self._tau1_s, self._tau2_s)
        pace = Pace(
            halves=self._halves,
            half=self._half,
            wide=self._wide,
            per_on=2.0 * self._half / self.spec.threshold_on,
            per_off=2.0 * self._half / self.spec.threshold_off,
            before_log=self.spec.filter == "before",
            dt_s=dt_s,
            before_s=self._dt_s,
            tau1_s=self._tau1_s,
            tau2_s=self._tau2_s,
            by_light=(0,) if self._by_light else (),
            dark=self.spec.bandwidth_dark,
            tracks=(0,) if self._blind_s else (),
            blind_s=self._blind_s,
            smooth_s=smooth_s,
            kept=math.exp(-dt_s / smooth_s) if smooth_s else 0.0,
            tau_s=DISTANCE_TAU_S,
            at_once=self.spec.timing == "frame",
        )
        self._cut.each_blocks(
            lambda k, first, last: measure_blocks(
                first, last, light, told, self._shade, self._curve, pace, self._found, self._work[k]
            )
        )
        self._dt_s, self._pace = dt_s, pace

    def _plane(self, plane: int) -> np.ndarray:
        """A plane of the state [tiles, PITCH]; beyond the pixels there is nothing."""
        return self._found.state.reshape(-1, PLANES, PITCH)[:, plane]

    def _note_brightness(self, light: np.ndarray) -> None:
        octave = np.log2(np.maximum(light, 2.0**-20)) + 20
        self._brightness += np.bincount(np.clip(octave.astype(np.int64), 0, LIGHTS - 1), minlength=LIGHTS)


def _bare(blocks: int, planes: int = BARE_PLANES) -> Bare:
    """Nothing found yet beside a shading."""
    state = np.zeros(blocks * planes * PITCH, np.float32)
    return Bare(state, np.zeros((blocks, BARE_FIGURES)), np.zeros((blocks, 1, QUARTERS, 2)))


def _with_own_sums(found: Seen) -> Seen:
    """The same, with copies of the sums."""
    bare = tuple(each._replace(tiles=each.tiles.copy()) for each in found.bare)
    return found._replace(tiles=found.tiles.copy(), spread=found.spread.copy(), bare=bare)


def _spread(found: np.ndarray, count: int) -> np.ndarray:
    """Sums over all blocks [count, 2, QUARTERS], of which the last may not have been taken."""
    sums = np.zeros((count, 2, QUARTERS))
    sums[: found.shape[1]] = np.moveaxis(found.sum(axis=0), 1, 2)
    return sums


def _by_events(travel: np.ndarray, threshold: float) -> np.ndarray:
    """Whole events of pixels with any travel, ascending, and the travel of all with so many [2, numbers]."""
    moved = travel[travel > 0.0]
    numbers, of = np.unique(np.floor(moved / threshold), return_inverse=True)
    return np.stack([numbers, np.bincount(of, moved, len(numbers))])


def _scratch() -> tuple[np.ndarray, ...]:
    """What a thread works in."""
    return (
        aligned(SCRATCH, np.float32),
        aligned(BLOCK, np.uint8),
        aligned(BLOCK + 8, np.int32),
        aligned(LANES, np.float32),
    )
