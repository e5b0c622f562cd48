"""`Measure`: the scene of a clip, one frame at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import BLOCK, PITCH
from vid2ev.kernels.measure import LEAST, STRIPS, Pace, Seen, measure_blocks, settle_measure
from vid2ev.kernels.play import FIGURES, LANES, LIGHT, PLANES, QUARTERS, SCRATCH, STEPS, TRAVEL
from vid2ev.kernels.work import aligned
from vid2ev.physics.log_curve import curve_of
from vid2ev.physics.shading import shading_map
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Tiles
from vid2ev.stream.frames import Frame
from vid2ev.stream.scene import DISTANCE_TAU_S, OF_TILES, SPREAD, Scene

BRIGHTNESS_EVERY = 8  # frames
LOOK_NS, PUSHED_NS = 1.1, 12.0  # of one thread: per pixel and frame, and for one that is pushed, more
LIGHTS = 41  # octaves of light, from 2**-20 to 2**20


class Measure:
    """What a sensor of `size` (width, height) sees, measured while frames go by: `see` each, then ask for `scene`.

    The light that is measured is that behind the sensor's lens shading.  Memory is 45 bytes a pixel.  `threads` change
    nothing but the time it takes.
    """

    def __init__(self, spec: DvsSpec, size: tuple[int, int], threads: int = 1):
        width, height = size
        self.spec, self.size = spec, (width, height)
        self._curve = curve_of(spec.log_curve, spec.dark_level)
        self._half = 0.5 * min(spec.threshold_on, spec.threshold_off)
        self._shade = shading_map(spec.shading, width, height).ravel() if spec.shading else np.empty(0, np.float32)
        blocks = -(-width * height // BLOCK)
        self._found = Seen(
            state=np.zeros(blocks * PLANES * PITCH, np.float32),
            calm=np.zeros((blocks, STRIPS), np.uint8),
            owed=np.ones((blocks, STRIPS, 2), np.float32),
            tiles=np.zeros((blocks, FIGURES)),
            spread=np.zeros((blocks, len(SPREAD), QUARTERS, 2)),
        )
        self._found.tiles[:, LEAST] = np.inf
        self._cut = Tiles(blocks, threads)
        self._work = [_scratch() for _ in range(self._cut.count)]
        self._brightness = np.zeros(LIGHTS)
        self._taus_s = [tau * 1e-6 for tau in spec.pole_taus_us]
        self._frames, self._ns = 0, 0
        self._t_ns: int | None = None
        self._dt_s = math.inf

    def see(self, frame: Frame) -> None:
        """The next frame of luminance [H, W]; raises UsageError for another shape, or a time that is not later."""
        width, height = self.size
        if frame.light.shape != (height, width):
            raise UsageError(f"light of shape {frame.light.shape}: expected ({height}, {width}), this sensor's pixels")
        if self._t_ns is not None and frame.t_ns <= self._t_ns:
            raise UsageError(f"frame time {frame.t_ns} ns after {self._t_ns} ns: expected a later one; sort the frames")
        light = np.ascontiguousarray(frame.light, np.float32).reshape(-1)
        if self._t_ns is None or frame.cut:
            settle_measure(light, self._shade, self._curve, self._half, self._found)
            self._dt_s = math.inf
        else:
            self._advance(light, (frame.t_ns - self._t_ns) * 1e-9)
            self._ns += frame.t_ns - self._t_ns
        if self._frames % BRIGHTNESS_EVERY == 0:
            self._note_brightness(self._plane(LIGHT)[:, :BLOCK].reshape(-1)[: light.size : 16])
        self._frames, self._t_ns = self._frames + 1, frame.t_ns

    def scene(self) -> Scene:
        """What was seen so far."""
        travel = self._plane(TRAVEL)
        return Scene(
            pixels=self.size[0] * self.size[1],
            frames=self._frames,
            seconds=self._ns * 1e-9,
            threshold=2 * self._half,
            busiest=float(travel.max()),
            by_pixel=np.bincount((travel / (2 * self._half)).astype(np.int64).ravel(), travel.ravel()),
            **dict(zip(SPREAD, np.moveaxis(self._found.spread.sum(axis=0), 1, 2).copy(), strict=True)),
            brightness=self._brightness.copy(),
            **dict(zip(OF_TILES, self._found.tiles.T.copy(), strict=True)),
        )

    def costs(self) -> tuple[float, float]:
        """What measuring takes [ns per pixel and frame, of one thread], and how many events a sensor sends in that."""
        scene = self.scene()
        pushed = float(scene.pushed_s.sum()) / max(scene.seconds * scene.pixels, 1e-300)
        return LOOK_NS + PUSHED_NS * pushed, scene.events / (scene.pixels * scene.frames)

    def _advance(self, light: np.ndarray, dt_s: float) -> None:
        delay, slowest = sum(self._taus_s), max(self._taus_s, default=0.0)
        smooth_s = slowest if self.spec.bandwidth == "constant" else 0.0
        steps = np.arange(STEPS + 1) * (dt_s / STEPS)
        pace = Pace(
            half=self._half,
            before_log=self.spec.filter == "before",
            dt_s=dt_s,
            back_s=min(delay, self._dt_s),
            ahead_s=min(4 * delay, dt_s),
            keep=math.exp(-self._dt_s / slowest) if slowest else 0.0,
            smooth_s=smooth_s,
            decays=np.exp(-steps / smooth_s).astype(np.float32) if smooth_s else np.zeros(STEPS + 1, np.float32),
            tau_s=DISTANCE_TAU_S,
        )
        self._cut.each_blocks(
            lambda k, first, last: measure_blocks(
                first, last, light, self._shade, self._curve, pace, self._found, self._work[k]
            )
        )
        self._dt_s = dt_s

    def _plane(self, plane: int) -> np.ndarray:
        """A plane of the state [tiles, PITCH]; beyond the pixels there is nothing."""
        return self._found.state.reshape(-1, PLANES, PITCH)[:, plane]

    def _note_brightness(self, light: np.ndarray) -> None:
        octave = np.log2(np.maximum(light, 2.0**-20)) + 20
        self._brightness += np.bincount(np.clip(octave.astype(np.int64), 0, LIGHTS - 1), minlength=LIGHTS)


def _scratch() -> tuple[np.ndarray, ...]:
    """What a thread works in."""
    return (
        aligned(SCRATCH, np.float32),
        aligned(BLOCK, np.uint8),
        aligned(BLOCK + 1, np.int32),
        aligned(LANES, np.float32),
    )


def scene_of(spec: DvsSpec, size: tuple[int, int], frames: Iterable[Frame]) -> Scene:
    """The scene of all frames."""
    measure = Measure(spec, size)
    for frame in frames:
        measure.see(frame)
    return measure.scene()
