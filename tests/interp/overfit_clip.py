"""A clip of 64 x 64 pixels to learn by heart: a textured square before a texture, seen by two cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from exact_voxels import exact_voxels

from interp.light import to_codes
from interp.representation.event_counts import EventCounts, count_events
from vid2ev import Dvs, Events, load_sensor

SIDE = 64
TARGETS = 7
STEPS = 32  # instants at which light is given to the sensor
SPAN_US = 33_280


@dataclass(frozen=True)
class Clip:
    """Codes of all 9 frames [9, 3, 64, 64], and the events between the first and the last."""

    frames: torch.Tensor
    events: Events

    def pair(self) -> tuple[torch.Tensor, torch.Tensor]:
        return self.frames[:1], self.frames[-1:]

    def times(self) -> torch.Tensor:
        return torch.arange(1, TARGETS + 1) / (TARGETS + 1)

    def truth(self) -> torch.Tensor:
        return self.frames[None, 1:-1]

    def counts(self) -> EventCounts:
        return count_events(self.events, (SIDE, SIDE), 0, SPAN_US, STEPS)

    def voxels(self) -> torch.Tensor:
        """Voxels of the windows before frames 1 to 8, [1, 8, 5, 64, 64]."""
        edges = [SPAN_US * k // (TARGETS + 1) for k in range(TARGETS + 2)]
        windows = [exact_voxels(self.events, (SIDE, SIDE), *edges[k : k + 2]) for k in range(TARGETS + 1)]
        return torch.stack(windows)[None]


def made_clip() -> Clip:
    """The clip; the square speeds up on a bent way, 9 px in all."""
    dvs = Dvs(load_sensor("ideal", ["threshold_on=0.15", "threshold_off=0.15"]), size=(SIDE, SIDE))
    frames, found = [], []
    for k in range(STEPS + 1):
        light = _light(k / STEPS)
        found.append(dvs.step(light @ np.float32([0.2126, 0.7152, 0.0722]), t_ns=1000 * SPAN_US * k // STEPS))
        if k % (STEPS // (TARGETS + 1)) == 0:
            frames.append(to_codes(torch.from_numpy(light).permute(2, 0, 1), "srgb"))
    return Clip(torch.stack(frames), Events.concatenate(found))


def _light(t: float) -> np.ndarray:
    """Light [64, 64, 3] at a time of 0 ... 1."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.float32)
    ground = 0.25 + 0.1 * np.sin(0.21 * x + 0.13 * y)[..., None] * np.float32([1, 0.6, 0.3])
    u, v = x - 22 - 8 * t**1.5, y - 26 - 4 * math.sin(1.5 * t)
    inside = 1 / (1 + np.exp(np.maximum(abs(u), abs(v)) - 13))[..., None]
    texture = 0.5 + 0.3 * np.sin(0.5 * u) * np.cos(0.4 * v + 1)
    return (ground + inside * (texture[..., None] * np.float32([0.7, 0.9, 1]) - ground)).astype(np.float32)


def psnr_db(images: torch.Tensor, truth: torch.Tensor) -> float:
    """PSNR of codes from 0 to 1, clipped."""
    return -10 * math.log10(float(((images.clamp(0, 1) - truth) ** 2).mean()))


def affine_psnr_db(images: torch.Tensor, truth: torch.Tensor) -> float:
    """PSNR after the gain and offset for all images that suit best: events do not say how bright it is."""
    x, y = images.flatten(), truth.flatten()
    gain = ((x - x.mean()) * (y - y.mean())).mean() / ((x - x.mean()) ** 2).mean()
    return psnr_db(y.mean() + gain * (images - x.mean()), truth)
