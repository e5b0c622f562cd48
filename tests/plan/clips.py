"""Clips that plans are held to: synthetic, scenes and real ones, small; and the distance of two recordings."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from vid2ev.bounds.scene import Omission
from vid2ev.compare.by_pixel import by_pixel
from vid2ev.compare.distance import TAUS_US, normalised, squared_distances
from vid2ev.plan.plan import EFFECTS
from vid2ev.rig.camera import Camera, Rig
from vid2ev.seen.instants import instants
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream import Events, Frame

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


def small(width: int, height: int) -> Rig:
    """One small event camera."""
    return Rig(cameras=(Camera(name="dvs", kind="dvs", size=(width, height)),))


SMALL = small(120, 90)
DATA = VIDEOS.parent
TINY = {"size": "96x72"}
UNSEEN: dict[str, dict] = {  # other parts, sizes and speeds, other seeds, photographs in motion
    "juggle, slow": {"video": VIDEOS / REAL["juggle"][0], "start": 5, "stop": 6, "size": "128x96", "slowdown": 3},
    "cups, part": {"video": VIDEOS / REAL["cups"][0], "start": 4, "stop": 5, "crop": "640x480+300+100", **TINY},
    "karma, fast": {"video": VIDEOS / REAL["karma"][0], "start": 7, "stop": 8, "size": "128x72", "slowdown": 0.5},
    "cars, later": {"video": VIDEOS / REAL["cars"][0], "start": 12, "stop": 14.4, "size": "128x72"},
    "bottles, slow": {"video": VIDEOS / REAL["bottles"][0], "start": 20, "stop": 21.2, "size": "112x63", "slowdown": 2},
    "again, slow": {"video": VIDEOS / REAL["again"][0], "start": 1, "stop": 2, "size": "128x96", "slowdown": 4},
    "rocket, later": {"video": VIDEOS / REAL["rocket"][0], "start": 6, "stop": 7.5, "size": "128x72"},
    "toy": {"video": DATA / "hybrid/toy.png", "motion": "saccade", "stop": 0.3, **TINY},
    "keyboard": {"video": DATA / "hybrid/keyboard.png", "motion": "pan:speed=60,duration_s=0.6", **TINY},
    "stereo": {"video": DATA / "stereo/motorcycle_left.png", "motion": "pan:speed=200,duration_s=0.3", **TINY},
    "still life": {"video": DATA / "hdr/StillLife.exr", "motion": "pan:speed=40,duration_s=0.8", **TINY},
    "candle": {"video": DATA / "hdr/CandleGlass.exr", "motion": "zoom", "stop": 0.5, **TINY},
    "night": {"video": DATA / "hdr/st_peters_square_night_1k.hdr", "motion": "saccade", "stop": 0.3, **TINY},
    "flying-shapes 7": {"video": "scene:flying-shapes,seed=7", "stop": 0.12, "rig": small(96, 72)},
    "spinning-shapes 3": {"video": "scene:spinning-shapes,seed=3", "stop": 0.12, "rig": small(96, 72)},
    "low-light 5": {"video": "scene:low-light,seed=5", "stop": 0.25, "rig": small(96, 72)},
    "parallax 9": {"video": "scene:parallax,seed=9", "stop": 0.2, "rig": small(96, 72)},
    "sine, fast": {"video": "synthetic:sine,size=64x48,duration_s=0.5,frequency_hz=31"},
}


def is_there(name: str) -> bool:
    """Whether a clip can be made: made ones always, real ones where the data are."""
    video = UNSEEN[name]["video"] if name in UNSEEN else VIDEOS if name in REAL else ""
    return isinstance(video, str) or video.exists()


@cache
def clip(name: str) -> tuple[tuple[int, int], list[Frame]]:
    """Size and frames of a clip, sub-frames too, as a sensor sees them."""
    options: dict = {"video": MADE.get(name) or f"scene:{name}"}
    if name in REAL:
        file, stop = REAL[name]
        options = {"video": VIDEOS / file, "stop": stop, "size": SIZE}
    elif name in SCENES:
        options |= {"stop": SCENES[name], "rig": SMALL}
    elif name in UNSEEN:
        options = UNSEEN[name]
    recipe = Recipe.of(sensor="ideal", **options)
    return recipe.mounts[0].size, [instant.frames[0] for instant in instants(recipe)]


def sent(spec: DvsSpec, size: tuple[int, int], frames: list[Frame], seed: int = 0) -> Events:
    """All events of a sensor."""
    return Events.concatenate(list(Dvs(spec, size, seed=seed).run(frames)))


def distance(a: Events, b: Events, size: tuple[int, int]) -> float:
    """The headline distance of two recordings of a sensor of a size."""
    sides = [by_pixel([side], size[0], range(size[1])) for side in (a, b)]
    return normalised(squared_distances(*sides, TAUS_US[0]).sum(), len(a), len(b))


def without(spec: DvsSpec, effect: str, omission: Omission) -> DvsSpec:
    """The sensor without an effect, or with what takes its place."""
    return DvsSpec(**(spec.model_dump() | (dict(omission.replace) or EFFECTS[effect].off)))
