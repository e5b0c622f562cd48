"""Photographs in motion, one before the other: clips at a fifth of the cost of rendered scenes.

A background and up to three layers before it, cut out in shapes, each with its distance.  All follow the camera, the
near ones more than the far ones, and each moves, turns and grows by itself, at a speed that changes; in some, rows
sway to the sides.  Light may grow or fade meanwhile.  A camera that stands beside sees the near ones shifted more than
the far.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import torch

from interp.data.chance import chance, log_uniform, uniform
from interp.data.layer_kernel import lay
from interp.data.layer_tensors import Laid, seen
from interp.data.settings import ClipSettings
from interp.data.shot import Beside, coarse
from vid2ev.scenes.textures import pixels_of
from vid2ev.sensors.devices import Device
from vid2ev.stamps import Stamp, stamp
from vid2ev.stream.frames import luminance_of

MOST_BEFORE = 3  # layers before the background
CLOSENESS = (0.7, 2.5)  # pixels of the picture per pixel of a photograph
FOCAL = 0.87  # of the cameras, in widths of the picture: 60 degrees
NEAREST_M, FARTHEST_M = 0.4, 12.0
SWAYING, FADING = 0.3, 0.2  # shares of layers that sway, and of clips that grow brighter or darker
LARGEST_PX = 768  # of a photograph, at the size at which it is seen
SOFT_PX = 1.0  # from where a shape covers all to where it covers nothing


class Layer(NamedTuple):
    """A picture [h, w, 4] and its motion: what the camera looks at in its middle, turn and size at u = 0 ... 1 are
    start + u way + u (1 - u) bend, each (x, y [px of the layer, along its sides], turn [rad], log of the size)."""

    pixels: np.ndarray
    start: np.ndarray
    way: np.ndarray
    bend: np.ndarray
    waves: tuple[float, float, float, float]  # height [px], length [px], phase, and phases per gap
    distance_m: float
    behind_all: bool

    def waves_at(self, u: float) -> tuple[float, float, float]:
        """Height [px], length [px] and phase of its waves at u."""
        height, length, phase, turns = self.waves
        return height, length, phase + u * turns


class Layers:
    """A shot of photographs in motion, drawn for a clip."""

    exposed = False

    def __init__(self, settings: ClipSettings, seed: int, number: int, beside: Beside, motion_px: float):
        draw = chance(seed, "layers", number)
        self.size, self._beside, self.moved_px = settings.size, beside, motion_px
        count = 1 + int(draw.integers(1, MOST_BEFORE + 1))
        far = np.sort(np.exp(draw.uniform(math.log(NEAREST_M), math.log(FARTHEST_M), count)))[::-1]
        names = [settings.textures[int(k)] for k in draw.integers(0, len(settings.textures), count)]
        camera = _way(draw) * [1, 1, 0.3, 0.3]
        layers = [_layer(draw, names[k], self.size, float(far[k]), camera, k == 0) for k in range(count)]
        self._layers = _at_speed(layers, motion_px, self.size)
        self._fade = uniform(draw, (-0.2, 0.2)) if draw.random() < FADING else 0.0
        self.about: dict[str, Any] = {"source": "photographs", "textures": names, "distances_m": far.round(3).tolist()}

    def pictures(self, steps: int, first: int, last: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """The light of both cameras (`Shot`)."""
        for j in range(first, last + 1):
            light = self._seen(j / steps, (0.0, 0.0))
            if self._beside.same:
                yield light, luminance_of(light)
            else:
                there = self._seen(j / steps, (self._beside.right_m, self._beside.down_m))
                yield light, coarse(luminance_of(there), self._beside.coarser)

    def on_device(self, device: Device, steps: int, first: int, last: int) -> tuple[Any, Any]:
        """The same on a device (`Shot`)."""
        times, beside = [j / steps for j in range(first, last + 1)], self._beside
        pixels = [torch.from_numpy(layer.pixels).to(device.light) for layer in self._layers]
        light = self._seen_on(pixels, times, (0.0, 0.0))
        if beside.same:
            return light, luminance_of(light)
        there = luminance_of(self._seen_on(pixels, times, (beside.right_m, beside.down_m)))
        return light, torch.nn.functional.avg_pool2d(there, beside.coarser)

    def _seen(self, u: float, stand_m: tuple[float, float]) -> np.ndarray:
        out = np.zeros((self.size[1], self.size[0], 3), np.float32)
        for layer in self._layers:
            lay(layer.pixels, self._place(layer, u, stand_m), layer.waves_at(u), layer.behind_all, out)
        out *= np.float32(math.exp(self._fade * u))
        return out

    def _seen_on(self, pixels: list[Any], times: list[float], stand_m: tuple[float, float]) -> Any:
        """Light [n, H, W, 3] at some times, as a tensor beside those of the layers' pixels."""
        layers = []
        for there, layer in zip(pixels, self._layers, strict=True):
            places = torch.tensor([self._place(layer, u, stand_m) for u in times], dtype=torch.float64)
            waves = torch.tensor([layer.waves_at(u) for u in times], dtype=torch.float64)
            layers.append(Laid(there, places.to(there.device), waves.to(there.device), layer.behind_all))
        light = seen(layers, self.size)
        fade = torch.tensor([math.exp(self._fade * u) for u in times], dtype=torch.float32)
        return light * fade.to(light.device)[:, None, None, None]

    def _place(self, layer: Layer, u: float, stand_m: tuple[float, float]) -> tuple[float, float, float, float]:
        """Where a layer is, as `layer_kernel.lay` takes it."""
        x, y, turn, growth = layer.start + u * layer.way + u * (1 - u) * layer.bend
        shift, step = FOCAL * self.size[0] / layer.distance_m, math.exp(-growth)
        beside = step * shift * _turned(stand_m, turn)
        rows, columns = layer.pixels.shape[:2]
        return columns / 2 + x + beside[0], rows / 2 + y + beside[1], step * math.cos(turn), step * math.sin(turn)


def _layer(
    draw: np.random.Generator, name: str, size: tuple[int, int], distance_m: float, camera: np.ndarray, behind_all: bool
) -> Layer:
    """A layer at an arbitrary speed."""
    light = _enlarged(name, stamp(name), round(4 * log_uniform(draw, CLOSENESS)))
    own = _way(draw) * (0.3 if behind_all else 1.0)
    near = NEAREST_M / distance_m
    if behind_all:
        pixels = np.ones((*light.shape[:2], 4), np.float32)
        pixels[..., :3] = light
        start = np.array([*(draw.uniform(-0.5, 0.5, 2) * light.shape[1::-1]), uniform(draw, (-math.pi, math.pi)), 0.0])
    else:
        pixels = _cut_out(draw, light, max(size))
        # (a shape is seen where the camera looks away from it)
        start = np.array([*(draw.uniform(-0.45, 0.45, 2) * size), uniform(draw, (-math.pi, math.pi)), 0.0])
    sways = draw.random() < SWAYING
    waves = (
        uniform(draw, (0.5, 3.0)) * sways, uniform(draw, (0.2, 1.0)) * max(size), draw.random(), uniform(draw, (-1, 1))
    )  # fmt: skip
    bend = _way(draw) * uniform(draw, (0, 1.2))
    # (what the camera does is along the sides of the picture, to which each layer is turned by another angle)
    followed = near * np.array([*_turned(camera[:2], start[2]), *camera[2:]])
    return Layer(pixels, start, own + followed, bend, waves, distance_m, behind_all)


def _turned(place: Sequence[float] | np.ndarray, turn: float) -> np.ndarray:
    """What is (x, y) along the sides of the picture, along those of a layer of a turn, as `layer_kernel` has it."""
    (x, y), across, down = place, math.cos(turn), math.sin(turn)
    return np.array([x * across - y * down, x * down + y * across])


def _way(draw: np.random.Generator) -> np.ndarray:
    """Motion in a gap, of about 1 across and down; a turn and growth that move edges of the picture by less."""
    angle = draw.uniform(0, 2 * math.pi)
    return np.array([math.cos(angle), math.sin(angle), draw.normal() * 0.006, draw.normal() * 0.004])


def _at_speed(layers: list[Layer], motion_px: float, size: tuple[int, int]) -> list[Layer]:
    """The layers, the fastest of which moves so far."""
    reach = max(size) / 3
    speeds = [math.hypot(layer.way[0], layer.way[1]) + reach * abs(layer.way[2:]).sum() for layer in layers]
    factor = motion_px / max(max(speeds), 1e-9)
    made = []
    for layer in layers:
        way, bend = layer.way * factor, layer.bend * factor * [1, 1, 0.2, 0.2]
        height, length, phase, turns = layer.waves
        turns *= min(1.0, motion_px / max(4 * height, 1e-9))  # (rows that sway go with the rest)
        waves = (height, length, phase, turns)
        made.append(layer._replace(start=layer.start - way / 2, way=way, bend=bend, waves=waves))
    return made


def _cut_out(draw: np.random.Generator, light: np.ndarray, side: int) -> np.ndarray:
    """A part of a photograph in a shape: a blob, a card or bars."""
    most = min(light.shape[:2])
    across = min(most, round(side * uniform(draw, (0.25, 0.9))))
    top, left = (int(draw.integers(0, length - across + 1)) for length in light.shape[:2])
    y, x = np.indices((across, across), np.float32) - (across - 1) / 2
    kind = draw.random()
    if kind < 0.5:
        angle, radius = np.arctan2(y, x), np.hypot(x, y)
        waves = sum(draw.normal() * 0.12 * np.cos(k * angle + draw.uniform(0, 6.3)) for k in range(2, 7))
        inside = across * 0.36 * np.clip(1 + waves, 0.3, 1.35) - radius
    elif kind < 0.8:
        inside = np.minimum(across * 0.48 - np.abs(x), across * uniform(draw, (0.1, 0.48)) - np.abs(y))
    else:
        bars = draw.integers(1, 5)
        inside = across / bars * (np.abs((y / across * bars) % 1.0 - 0.5) - 0.25)
        inside = np.minimum(inside, across * 0.48 - np.abs(x))
    covered = np.clip(inside / SOFT_PX + 0.5, 0, 1).astype(np.float32)[..., None]
    part = light[top : top + across, left : left + across]
    return np.concatenate([part * covered, covered], axis=2)


@lru_cache(maxsize=48)
def _enlarged(name: str, written: Stamp, quarters: int) -> np.ndarray:
    """A photograph at about quarters/4 times its size, linear light [h, w, 3], no larger than 768 pixels."""
    import cv2

    light = pixels_of(name)
    rows, columns = light.shape[:2]
    factor = min(quarters / 4, LARGEST_PX / max(rows, columns))
    size = max(16, round(columns * factor)), max(16, round(rows * factor))
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    return cv2.resize(light, size, interpolation=how).astype(np.float32)  # (the spline smooths it after)
