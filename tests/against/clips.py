"""Small clips through the sensor: the public API, driven frame by frame.

Each combination of effects is compiled once, which takes seconds: tests share the few sensors that they need, and
further combinations are marked slow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from vid2ev.sensors.dvs import Dvs, DvsSpec
from vid2ev.stream import Events

from .reference import Pixel

CLEAN = {
    "mismatch": 0.0,
    "crossing_noise": 0.0,
    "refractory_us": 0.0,
    "photoreceptor_tau_us": 0.0,
    "follower_tau_us": 0.0,
    "random_phase": False,
}


EVERYTHING = DvsSpec(
    photoreceptor_tau_us=300,
    follower_tau_us=100,
    bandwidth="light",
    photoreceptor_noise=0.03,
    shading=(0.0, -0.3),
    leak_rate_hz=5,
    shot_rate_hz=20,
    hot_probability=0.02,
    hot_rate_hz=300,
    cold_probability=0.02,
    refractory_us=150,
)
AFTER_TRACKING = EVERYTHING.model_copy(update={"filter": "after", "refractory": "track"})
OF_FRAMES: dict[str, Any] = {  # a frame camera with every effect
    "exposure_us": 23_000, "line_us": 900, "shot_noise": True, "read_noise_e": 3, "prnu": 0.02, "dsnu": 4,
    "full_well_e": 9_000, "shading": (-0.1, -0.3),
}  # fmt: skip


def clean(**keys) -> DvsSpec:
    """A sensor without imperfections, delay or random phase, but for `keys`."""
    return DvsSpec(**{**CLEAN, **keys})


FAINT = {"leak_rate_hz": 1e-6, "shot_rate_hz": 1e-6, "hot_probability": 1e-6, "hot_rate_hz": 1e-6}


def noisy(**keys) -> DvsSpec:
    """A clean sensor with leak, shot noise and hot pixels, each hardly there unless `keys` say so."""
    return clean(**{**FAINT, **keys})


def uneven(**keys) -> DvsSpec:
    """ESIM with mismatch and noise at the crossings, each hardly there unless `keys` say so."""
    return clean(**{"filter": "after", "dark_level": 1e-12, "mismatch": 1e-9, "crossing_noise": 1e-9, **keys})


def sensor(pixel: Pixel, **keys) -> DvsSpec:
    """The sensor all of whose pixels are `pixel`."""
    return clean(**asdict(pixel) | keys)


def start(spec: DvsSpec, light: np.ndarray, **options) -> Dvs:
    """A sensor of the size of `light` [F, H, W] or [H, W]."""
    return Dvs(spec, (light.shape[-1], light.shape[-2]), **options)


def feed(dvs: Dvs, t_ns: Sequence[int], light: np.ndarray) -> Events:
    """The events of all frames `light` [F, H, W], as float32, at `t_ns`."""
    frames = (np.asarray(frame, np.float32) for frame in light)
    return Events.concatenate([dvs.step(frame, int(t)) for t, frame in zip(t_ns, frames, strict=True)])


def play(spec: DvsSpec, t_ns: Sequence[int], light: np.ndarray, **options) -> Events:
    """The events of a fresh sensor that sees the clip, those held back included."""
    dvs = start(spec, light, **options)
    return Events.concatenate([feed(dvs, t_ns, light), dvs.flush()])


def hold(light: np.ndarray | float, t_ns: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A static clip: the same `light` at all `t_ns`; returns (t_ns, frames as a view of one)."""
    frame = np.broadcast_to(np.asarray(light, np.float32), shape)
    return t_ns, np.broadcast_to(frame, (len(t_ns), *shape))


def per_pixel(sent: Events, shape: tuple[int, int], mask: np.ndarray | None = None) -> np.ndarray:
    """How many of the events (of those in `mask`) each pixel sent, int64 [H, W]."""
    chosen = sent if mask is None else sent.select(mask)
    at = chosen.y.astype(np.int64) * shape[1] + chosen.x
    return np.bincount(at, minlength=shape[0] * shape[1]).reshape(shape)
