"""What the cameras of a recording see: views of a video's frames or pictures of a scene, on the cameras' clocks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.physics.bayer import mosaic
from vid2ev.rig.camera import Source as Taker
from vid2ev.rig.homography import places_on_plane
from vid2ev.rig.intrinsics import Framing, Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.views import View, Views, is_same
from vid2ev.scenes.reel import Reel
from vid2ev.scenes.render import Picture
from vid2ev.scenes.source import SceneSource
from vid2ev.seen.mounts import Mount
from vid2ev.sources import Source
from vid2ev.sources.cut import Cut, Slowed
from vid2ev.sources.edit import Edit, unedited
from vid2ev.sources.framing import framing_of
from vid2ev.stream.frames import Frame

GLANCE_PX = 64  # along a side: most cameras see much, and so many of their places say so


class Sight:
    """The views of the mounts around a source's camera.

    plane_m  how far the scene is, if it is a plane before the source's camera; None where frames carry their depth
    bayer    the pattern of colour filters before the pixels of event cameras, or None
    threads  change nothing but the time it takes
    """

    def __init__(
        self,
        source: Intrinsics,
        mounts: Sequence[Mount],
        plane_m: float | None,
        bayer: str | None = None,
        threads: int = 1,
    ):
        self._mounts = mounts
        self.free = are_free(source, mounts)
        self._groups = [  # (those that see colours, and those that see luminance: a third of the work)
            (coloured, places, Views(source, [mounts[k].view for k in places], plane_m, threads=threads))
            for coloured in (True, False)
            if (places := [k for k, mount in enumerate(mounts) if sees_colour(mount, bayer) == coloured])
        ]

    def views(self, frame: Frame) -> list[View]:
        """The views of a frame, with their masks."""
        seen: dict[int, View] = {}
        for coloured, places, views in self._groups:
            light = frame.light if coloured else frame.luminance
            seen |= dict(zip(places, views.see(light, frame.depth), strict=True))
        return [seen[k] for k in range(len(self._mounts))]


def are_free(source: Intrinsics, mounts: Sequence[Mount]) -> bool:
    """Whether all cameras see what the source's sees, so that their views are no work."""
    return all(is_same(source, mount.intrinsics, mount.pose) for mount in mounts)


def sees_nothing(source: Intrinsics, mount: Mount, plane_m: float | None) -> bool:
    """Whether no pixel of a camera sees anything of a video, as far as that is known without maps of depth."""
    camera, pose = mount.view
    if is_same(source, camera, pose) or (plane_m is None and pose.translation_m.any()):
        return False
    few = min(camera.size[0], GLANCE_PX), min(camera.size[1], GLANCE_PX)
    glance = Framing(camera.size, (0, 0), camera.size, few).lens_of_part(camera)
    far_m = math.inf if plane_m is None else plane_m
    return not any(places_on_plane(source, lens, pose, far_m).seen.any() for lens in (glance, camera))


def scene_of(source: Source) -> SceneSource | None:
    """The scene that a source renders, or a part in time of one; None for other sources."""
    scene = source.source if isinstance(source, Cut) else source
    return scene if isinstance(scene, SceneSource) else None


def scene_behind(source: Source) -> SceneSource | None:
    """The scene whose pictures a source shows, or what is left of them; None for other sources."""
    scene = unedited(source)
    return scene if isinstance(scene, SceneSource) else None


def instants_of(scene: SceneSource, source: Source) -> dict[int, int]:
    """When a source shows a scene, on the source's clock, and which instant of the scene that is [ns]."""
    ends_ns: tuple[int | None, int | None] = (None, None)
    slowed: Slowed | None = None
    while isinstance(source, Edit):
        ends_ns = source.ends_ns() if isinstance(source, Cut) else ends_ns
        slowed = source if isinstance(source, Slowed) else slowed
        source = source.source
    return {slowed.slowed_ns(t_ns) if slowed else t_ns: t_ns for t_ns in scene.instants_between(*ends_ns)}


def lens_of(source: Source) -> Intrinsics | None:
    """The lens of the scene that a source renders, through which what is left of its pictures is seen; None for other
    sources."""
    scene = scene_behind(source)
    if scene is None:
        return None
    framing = framing_of(source)
    return framing.lens_of_part(scene.world.intrinsics) if framing else scene.world.intrinsics


def taken_by(source: Source) -> Taker | None:
    """The camera that took the pictures of a source, where these come with it."""
    return getattr(unedited(source), "taken_by", None)


def staged(source: Source) -> SceneSource:
    """The scene of a source, to be rendered for each camera.  Raises UsageError for one that is seen through a crop, at
    another size or speed."""
    scene = scene_of(source)
    if scene is None:
        raise UsageError("a rig sees all of a scene: leave --crop, --size and --slowdown out; set its camera's size")
    return scene


class Stage:
    """A scene whose pictures are rendered for each camera, in place of views of one.

    Raises UsageError as `staged` does.
    """

    def __init__(self, source: Source, mounts: Sequence[Mount]):
        scene = staged(source)
        self.world, self._mounts = scene.world, mounts
        self._memory = None if scene.world.renderer else scene.memory  # (another renderer is not asked on a device)
        self.instants_ns = scene.instants_between(*(source.ends_ns() if isinstance(source, Cut) else (None, None)))

    def pictures(self, start: int = 0) -> Iterator[list[tuple[Picture, np.ndarray | None]]]:
        """What each camera sees at each instant from number `start` on, and which strips have not changed since the one
        before (`scenes.reel`; on a device nobody asks); cameras with the same view share it."""
        keys = [(mount.intrinsics, *(part.tobytes() for part in vars(mount.pose).values())) for mount in self._mounts]
        views = {key: mount.view for key, mount in zip(keys, self._mounts, strict=True)}
        seen = {key: self._of_view(view, self.instants_ns[start:]) for key, view in views.items()}
        for pictures in zip(*seen.values(), strict=True):
            of_key = dict(zip(seen, pictures, strict=True))
            yield [of_key[key] for key in keys]

    def _of_view(
        self, view: tuple[Intrinsics, Pose], instants_ns: Sequence[int]
    ) -> Iterator[tuple[Picture, np.ndarray | None]]:
        """The pictures of a camera."""
        if self._memory is None:
            return map(Reel(self.world, *view).picture, instants_ns)
        from vid2ev.scenes.reel_on_card import ReelOnCard

        return ((picture, None) for picture in ReelOnCard(self.world, self._memory, *view).pictures(instants_ns))


def arriving(
    frame: Frame, lights: Sequence[np.ndarray], mounts: Sequence[Mount], bayer: str | None
) -> tuple[Frame, ...]:
    """The light that each camera sees at a frame of the source, as it reaches its pixels: luminance where it tells no
    colours apart, through its colour filters, on its own clock."""
    frames = []
    for light, mount in zip(lights, mounts, strict=True):
        seen = replace(frame, light=light, t_ns=frame.t_ns + 1000 * mount.clock_offset_us, depth=None)
        if bayer is not None and mount.kind == "dvs":
            seen = replace(seen, light=mosaic(light, bayer))
        elif not mount.sensor.colour:
            seen = replace(seen, light=seen.luminance)
        frames.append(seen)
    return tuple(frames)


def sees_colour(mount: Mount, bayer: str | None) -> bool:
    """Whether a camera wants red, green and blue."""
    return mount.sensor.colour or (bayer is not None and mount.kind == "dvs")
