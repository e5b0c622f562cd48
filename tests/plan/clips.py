"""Clips that plans are held to: synthetic, scenes and real ones, small; and the distance of two recordings."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from vid2ev.compare.by_pixel import by_pixel
from vid2ev.compare.distance import TAUS_US, normalised, squared_distances
from vid2ev.instants import instants
from vid2ev.plan.plan import EFFECTS
from vid2ev.recipe import Recipe
from vid2ev.rig.camera import Camera, Rig
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream import Events, Frame
from vid2ev.stream.scene import Omission

VIDEOS = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos"
SIZE = "160x120"
REAL = {
    "juggle": ("sam2_05_default_juggle.mp4", 1.5),
    "cups": ("sam2_02_cups.mp4", 1.2),
    "karma": ("gopro_karma.mp4", 1.1),
    "cars": ("intel_car-detection.mp4", 2.6),
    "bottles": ("intel_bottle-detection.mp4", 1.5),
    "book": ("intel_asl_book.mkv", 1.5),
    "again": ("intel_asl_again.mkv", 1.5),
    "rocket": ("nasa_13013.mp4", 1.5),
}
MADE = {
    "edge": "synthetic:moving-edge,size=96x72,duration_s=0.5",
    "sine": "synthetic:sine,size=96x72,duration_s=0.5,frequency_hz=9",
}
SCENES = {  # how much of them [s]
    "close-object": 0.15,
    "flicker": 0.05,
    "flying-shapes": 0.15,
    "low-light": 0.3,
    "parallax": 0.3,
    "room": 0.15,
    "specular": 0.4,
    "spinning-shapes": 0.15,
}
SMALL = Rig(cameras=(Camera(name="dvs", kind="dvs", size=(120, 90)),))


@cache
def clip(name: str) -> tuple[tuple[int, int], list[Frame]]:
    """Size and frames of a clip, sub-frames too, as a sensor sees them."""
    options: dict = {"video": MADE.get(name) or f"scene:{name}"}
    if name in REAL:
        file, stop = REAL[name]
        options = {"video": VIDEOS / file, "stop": stop, "size": SIZE}
    elif name in SCENES:
        options |= {"stop": SCENES[name], "rig": SMALL}
    recipe = Recipe.of(sensor="ideal", **options)
    return recipe.mounts[0].size, [instant.frames[0] for instant in instants(recipe)]


def sent(spec: DvsSpec, size: tuple[int, int], frames: list[Frame]) -> Events:
    """All events of a sensor."""
    return Events.concatenate(list(Dvs(spec, size).run(frames)))


def distance(a: Events, b: Events, size: tuple[int, int]) -> float:
    """The headline distance of two recordings of a sensor of a size."""
    sides = [by_pixel([side], size[0], range(size[1])) for side in (a, b)]
    return normalised(squared_distances(*sides, TAUS_US[0]).sum(), len(a), len(b))


def without(spec: DvsSpec, effect: str, omission: Omission) -> DvsSpec:
    """The sensor without an effect, or with what takes its place."""
    return DvsSpec(**(spec.model_dump() | (dict(omission.replace) or EFFECTS[effect].off)))
