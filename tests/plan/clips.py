"""Clips that plans are held to: synthetic, scenes and real ones, small; and the distance of two recordings."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numba import njit

from vid2ev.instants import instants
from vid2ev.recipe import Recipe
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream import Events, Frame

VIDEOS = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos"
SIZE = "160x120"
REAL = {
    "juggle": ("sam2_05_default_juggle.mp4", 1.2),
    "cups": ("sam2_02_cups.mp4", 1.2),
    "karma": ("gopro_karma.mp4", 1.0),
    "cars": ("intel_car-detection.mp4", 1.5),
    "bottles": ("intel_bottle-detection.mp4", 1.5),
    "book": ("intel_asl_book.mkv", 1.5),
    "rocket": ("nasa_13013.mp4", 1.5),
}
MADE = {
    "edge": "synthetic:moving-edge,size=96x72,duration_s=0.5",
    "sine": "synthetic:sine,size=96x72,duration_s=0.5,frequency_hz=9",
}
SCENES = ("flying-shapes", "flicker", "low-light", "room")


@cache
def clip(name: str) -> tuple[tuple[int, int], list[Frame]]:
    """Size and frames of a clip, sub-frames too, as a sensor sees them."""
    options: dict = {"video": MADE.get(name) or f"scene:{name}"}
    if name in REAL:
        file, stop = REAL[name]
        options = {"video": VIDEOS / file, "stop": stop, "size": SIZE}
    elif name in SCENES:
        options |= {"stop": 0.3, "size": SIZE}
    recipe = Recipe.of(sensor="ideal", **options)
    return recipe.mounts[0].size, [instant.frames[0] for instant in instants(recipe)]


def sent(spec: DvsSpec, size: tuple[int, int], frames: list[Frame]) -> Events:
    """All events of a sensor."""
    return Events.concatenate(list(Dvs(spec, size).run(frames)))


def distance(a: Events, b: Events, tau_us: float = 1000.0) -> float:
    """van Rossum's, signed, per pixel, divided by the mean number of events: 0 the same, 1 nothing in common."""
    pixel = np.concatenate([side.y.astype(np.int64) << 16 | side.x for side in (a, b)])
    t = np.concatenate([a.t, b.t])
    weight = np.concatenate([2.0 * a.p - 1.0, 1.0 - 2.0 * b.p])
    order = np.lexsort((t, pixel))
    return 2.0 * _squared(pixel[order], t[order], weight[order], tau_us) / max(len(t), 1)


@njit
def _squared(pixel, t, weight, tau_us):
    total, trace = 0.0, 0.0
    for i in range(len(t)):
        if i > 0:
            trace = trace * np.exp((t[i - 1] - t[i]) / tau_us) if pixel[i] == pixel[i - 1] else 0.0
        total += weight[i] * trace + 0.5
        trace += weight[i]
    return total
