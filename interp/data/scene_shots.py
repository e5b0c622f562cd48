"""The eight scenes, and a person's own, as shots: any part of the picture, at any pace.

The camera of a scene is looked through at a part of its picture, as large as a clip.  How much of the scene's time
passes in a gap is chosen by the motion that is wanted: the world may run faster or slower than the sensors, as in the
paper, whose films are accelerated.  Photographs on things are exchanged for those that may be seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from interp.data.chance import Range, chance, log_uniform, uniform
from interp.data.settings import ClipSettings
from interp.data.shot import Beside
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.reel import Reel
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.scene_file import SceneFile, read_scene
from vid2ev.scenes.world import World
from vid2ev.sensors.devices import Device
from vid2ev.stamps import Stamp, stamp
from vid2ev.stream.frames import luminance_of

WHOLE_PX: Range = (160.0, 640.0)  # width of the picture of which a part is seen; scenes are made for 640
SPARSE = 32  # pixels across, of the picture in which motion is measured
FAST_PERCENTILE = 95.0
PROBE_NS = 200_000  # over which it is measured
SPAN_S = (1e-3, 0.3)  # of the scene's time, in a gap
PERIODS = 2.0  # of the fastest flicker in a gap, at most
PER_PERIOD_PX = 24.0  # of motion: what a period of flicker counts as
PHOTOGRAPHS = 5  # different ones in a scene; each costs as much as some pictures


class SceneShot:
    """A shot of a rendered scene, drawn for a clip."""

    exposed = False

    def __init__(self, settings: ClipSettings, seed: int, number: int, beside: Beside, motion_px: float):
        draw = chance(seed, "scene", number)
        name = settings.scene_names[int(draw.integers(len(settings.scene_names)))]
        scene_seed = int(draw.integers(1 << 62))
        self._world = World(_dressed(_file(name, stamp(name)).resolved(scene_seed), settings, draw))
        self._world.threads = 1
        self._lens = _part(self._world.intrinsics, settings.size, draw)
        middle_s = uniform(draw, (SPAN_S[1] / 2, 1e-9 * self._world.duration_ns - SPAN_S[1] / 2))
        speed = _speed_px_s(self._world, self._lens, round(1e9 * middle_s))
        flicker_hz = _flickers_hz(self._world.scene)
        longest_s = min(SPAN_S[1], PERIODS / max(flicker_hz, 1e-9))
        self._span_ns = 1e9 * float(np.clip(motion_px / max(speed, 1e-9), SPAN_S[0], longest_s))
        self._begin_ns = 1e9 * middle_s - self._span_ns / 2
        self.moved_px = 1e-9 * self._span_ns * max(speed, PER_PERIOD_PX * flicker_hz)
        self._there = None if beside.same else _there(self._lens, settings.size, beside)
        self.about: dict[str, Any] = {
            "source": "scene", "scene": name, "scene_seed": scene_seed, "begin_s": 1e-9 * self._begin_ns,
            "span_s": 1e-9 * self._span_ns, "focal_px": self._lens.focal_px[0],
        }  # fmt: skip

    def pictures(self, steps: int, first: int, last: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """The light of both cameras (`Shot`)."""
        frames = Reel(self._world, self._lens)
        events = Reel(self._world, *self._there) if self._there else None
        for t_ns in self._instants_ns(steps, first, last):
            light = frames.picture(t_ns)[0].light
            yield light, luminance_of(events.picture(t_ns)[0].light if events else light)

    def on_device(self, device: Device, steps: int, first: int, last: int) -> tuple[Any, Any]:
        """The same on a device (`Shot`)."""
        instants_ns = self._instants_ns(steps, first, last)
        light = self._painted(device, instants_ns, self._lens)
        there = self._painted(device, instants_ns, *self._there) if self._there else light
        return light, luminance_of(there)

    def _painted(self, device: Device, instants_ns: list[int], lens: Intrinsics, stand: Pose = IDENTITY) -> Any:
        """Light [n, H, W, 3] on a device."""
        import torch

        from vid2ev.scenes.reel_on_card import ReelOnCard

        pictures = ReelOnCard(self._world, device.memory, lens, stand).pictures(instants_ns)
        return torch.stack([torch.as_tensor(picture.light) for picture in pictures])

    def _instants_ns(self, steps: int, first: int, last: int) -> list[int]:
        """When the scene is seen, by its own clock."""
        return [max(0, round(self._begin_ns + self._span_ns * j / steps)) for j in range(first, last + 1)]


def _there(lens: Intrinsics, size: tuple[int, int], beside: Beside) -> tuple[Intrinsics, Pose]:
    """What an event camera beside sees through, and how it stands to the frame camera."""
    coarse = size[0] // beside.coarser, size[1] // beside.coarser
    return lens.scaled_to(coarse), Pose(np.eye(3), np.array([beside.right_m, beside.down_m, 0.0]))


@lru_cache(maxsize=16)
def _file(name: str, written: Stamp) -> SceneFile:
    return read_scene(name)


def _part(whole: Intrinsics, size: tuple[int, int], draw: np.random.Generator) -> Intrinsics:
    """A part of the camera's picture, seen with so many pixels that the whole has a width of WHOLE_PX."""
    width = max(size[0], round(log_uniform(draw, WHOLE_PX)))
    scale = width / whole.size[0]
    large = whole.scaled_to((width, max(size[1], round(whole.size[1] * scale))))
    left, top = (int(draw.integers(0, have - want + 1)) for have, want in zip(large.size, size, strict=True))
    centre = large.centre_px[0] - left, large.centre_px[1] - top
    return large.model_copy(update={"size": size, "centre_px": centre})


def _speed_px_s(world: World, lens: Intrinsics, t_ns: int) -> float:
    """How fast the fast things in the picture move [px/s]; the 95th percentile over the picture."""
    sparse = lens.scaled_to((SPARSE, max(1, round(SPARSE * lens.size[1] / lens.size[0]))))
    picture = world.render(t_ns, sparse)
    shift = world.flow(t_ns, t_ns + PROBE_NS, picture, sparse).shift
    speeds = np.hypot(shift[..., 0], shift[..., 1]) * (lens.size[0] / SPARSE) / (1e-9 * PROBE_NS)
    speeds = speeds[np.isfinite(speeds)]
    return float(np.percentile(speeds, FAST_PERCENTILE)) if speeds.size else 0.0


def _flickers_hz(scene: Scene) -> float:
    """How fast the fastest light swings; 0 if none does."""
    flickers = [*(light.flicker for light in scene.lights), *(thing.flicker for thing in scene.objects)]
    return max((flicker.frequency_hz for flicker in flickers if flicker), default=0.0)


def _dressed(scene: Scene, settings: ClipSettings, draw: np.random.Generator) -> Scene:
    """The scene with other photographs on its things, and perhaps another environment."""
    few = [settings.textures[int(k)] for k in draw.integers(0, len(settings.textures), PHOTOGRAPHS)]
    objects = tuple(
        thing.model_copy(update={"texture": few[int(draw.integers(len(few)))]})
        if isinstance(thing.texture, str)
        else thing
        for thing in scene.objects
    )
    setting = scene.scene
    if settings.environments:
        picture = settings.environments[int(draw.integers(len(settings.environments)))]
        setting = setting.model_copy(update={"environment": picture})
    return scene.model_copy(update={"objects": objects, "scene": setting})
