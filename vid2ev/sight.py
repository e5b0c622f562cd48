"""What the cameras of a recording see: views of a video's frames or pictures of a scene, on the cameras' clocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from vid2ev.errors import UsageError
from vid2ev.mounts import Mount
from vid2ev.physics.bayer import mosaic
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.views import Views, is_same
from vid2ev.sources import Source
from vid2ev.stream.frames import Frame


class Sight:
    """The views of the mounts around a source's camera.

    plane_m  how far the scene is, if it is a plane before the source's camera; None where frames carry their depth
    bayer    the pattern of colour filters before the pixels of event cameras, or None
    """

    def __init__(self, source: Intrinsics, mounts: Sequence[Mount], plane_m: float | None, bayer: str | None):
        self._mounts, self._bayer = mounts, bayer
        self.free = all(is_same(source, mount.intrinsics, mount.pose) for mount in mounts)  # of any work
        self._groups = [  # (those that see colours, and those that see luminance: a third of the work)
            (coloured, places, Views(source, [(mounts[k].intrinsics, mounts[k].pose) for k in places], plane_m))
            for coloured in (True, False)
            if (places := [k for k, mount in enumerate(mounts) if sees_colour(mount, bayer) == coloured])
        ]

    @property
    def needs_depth(self) -> bool:
        """Whether frames have to carry their depth."""
        return any(views.needs_depth() for _, _, views in self._groups)

    def frames(self, frame: Frame) -> tuple[Frame, ...]:
        """What each camera sees of a frame."""
        seen: dict[int, Frame] = {}
        for coloured, places, views in self._groups:
            found = views.see(frame.light if coloured else frame.luminance, frame.depth)
            for k, view in zip(places, found, strict=True):
                seen[k] = as_seen(replace(frame, light=view.light, depth=None), self._mounts[k], self._bayer)
        return tuple(seen[k] for k in range(len(self._mounts)))


def rendered(
    source: Source, mounts: Sequence[Mount], bayer: str | None, start: int
) -> Iterator[tuple[tuple[Frame, ...], int]]:
    """What each camera sees of a scene at each instant from index `start` on, and the instant [ns].  Raises UsageError
    for a scene that is seen through a crop or another size."""
    views = getattr(source, "views", None)
    if views is None:
        raise UsageError(
            "a rig sees all of a scene: leave --crop, --size and --slowdown out, and set its camera's size"
        )
    for t_ns, pictures in views([(mount.intrinsics, mount.pose) for mount in mounts], start=start):
        frames = [Frame(picture.light, t_ns) for picture in pictures]
        seen = [
            as_seen(frame if sees_colour(mount, bayer) else replace(frame, light=frame.luminance), mount, bayer)
            for frame, mount in zip(frames, mounts, strict=True)
        ]
        yield tuple(seen), t_ns


def sees_colour(mount: Mount, bayer: str | None) -> bool:
    """Whether a camera wants red, green and blue."""
    return mount.sensor.colour or (bayer is not None and mount.kind == "dvs")


def as_seen(frame: Frame, mount: Mount, bayer: str | None) -> Frame:
    """A view as it reaches the pixels, through their colour filters, on the camera's own clock."""
    light = mosaic(frame.light, bayer) if bayer and mount.kind == "dvs" else frame.light
    return replace(frame, light=light, t_ns=frame.t_ns + 1000 * mount.clock_offset_us)
