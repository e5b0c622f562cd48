"""Views: what other cameras see of a video.

Each camera has intrinsics and a pose relative to the camera that filmed (X_source = R X_camera + t).  How its view is
made depends on what is between the two:

    nothing                       the very picture
    a turn, or other intrinsics   a homography: no depth is needed
    a translation                 a homography if the scene is given as a plane, else by the surface of a depth map:
                                  the nearest surface wins, what opens up behind it is a hole

A view is light and a mask of what is really seen.  Where the source has nothing to show, light is made up: outside its
picture, what is nearest; in a hole, the background around it.  A camera of fewer pixels gets means over its pixels'
area (as many places in each as no two skip a pixel of the source, by the median distance of its pixels there), one of
more pixels a smooth curve.

Depth that is zero, negative or NaN is unknown: it is taken from the background around for warping, and what is seen
there is not in the mask, but of cameras for which depth is not asked.  Infinite depth is infinitely far.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.bands import Bands
from vid2ev.rig.holes import Fill, apply_fill, fill_of
from vid2ev.rig.homography import AT_ONCE, Places, places_on_plane, samples_for
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.rig.sampling import pixel_means, sampled
from vid2ev.rig.spline import Spline
from vid2ev.rig.surface import Corners, Surface, corners_of, seen_of, surface_of
from vid2ev.rig.tensor_spline import spline_of
from vid2ev.rig.tensor_views import TensorLook

INSET_PX = 2  # of the camera: what fills a hole comes from so far beyond its rim
SMOOTHINGS = 5
LOOKED_AT = 16  # one row and column in so many tells how wide the pixels of a camera are on a surface
NEAREST_M = 1e-6  # depth below counts as zero


class View(NamedTuple):
    """What a camera sees."""

    light: Any  # [h, w] or [h, w, 3] float32; of a tensor a tensor
    valid: np.ndarray  # [h, w] bool: all of the pixel is seen by the source as well


class Look(NamedTuple):
    """How a view is made: where its pixels look, and how holes are filled."""

    places: Places
    valid: np.ndarray  # [h, w]
    fill: Fill | None = None
    cuts: tuple[np.ndarray, np.ndarray, float] | tuple[()] = ()  # near_cut, inverse depths, steepness of the surface


class Views:
    """The views of several cameras, frame by frame.

    source    the camera that filmed
    cameras   intrinsics and pose of each
    plane_m   the scene as a plane so far in front of the source, facing it; inf allowed
    samples   at least so many places across each pixel; more are taken where a pixel is wider than the source's
    threads   change nothing but the time it takes

    One picture at a time: memory is used again.  Raises UsageError for a plane that is not in front of the source.
    """

    def __init__(
        self,
        source: Intrinsics,
        cameras: Sequence[tuple[Intrinsics, Pose]],
        plane_m: float | None = None,
        *,
        samples: int = 1,
        threads: int = 1,
    ):
        self.source, self.cameras, self.plane_m = source, list(cameras), plane_m
        self._bands = Bands(threads)
        self._same = [is_same(source, *camera) for camera in self.cameras]
        self._far = [self._look_at_plane(*camera, math.inf, samples) for camera in self.cameras]
        self._fixed: list[Look | None] = [None] * len(self.cameras)
        for k, (camera, pose) in enumerate(self.cameras):
            if not pose.translation_m.any():
                self._fixed[k] = self._far[k]
            elif plane_m is not None:
                self._fixed[k] = self._look_at_plane(camera, pose, plane_m, samples)
        self._corners: Corners | None = None
        self._depth_m = np.zeros(0, np.float32)
        self._looks: list[Look | None] = []
        self._spline: Spline | None = None
        self._uploaded: dict[int, tuple[Look, TensorLook]] = {}

    def needs_depth(self) -> bool:
        """Whether a camera has a translation, and there is no plane."""
        return any(look is None for look in self._fixed)

    def see(self, light: Any, depth_m: np.ndarray | None = None) -> list[View]:
        """What each camera sees of light [h, w] or [h, w, 3] of the source; depth [h, w] m, used instead of a plane.

        Light that is a tensor of torch is sampled on its device, the same to a few units in the last place of float32.
        As long as the depth stays the same from call to call, only light is sampled anew.  Raises UsageError for
        another size than the source's, and without a depth that is needed.
        """
        self._check(light, "light")
        looks = self.looks(depth_m)
        others = {k: look for k, look in enumerate(looks) if not self._same[k]}
        sample = self._sampled if isinstance(light, np.ndarray) else self._sampled_on_device
        seen = sample(light, others) if others else {}
        return [View(seen.get(k, light), look.valid) for k, look in enumerate(looks)]

    def _sampled(self, light: np.ndarray, looks: dict[int, Look]) -> dict[int, np.ndarray]:
        """Light of an array, as cameras see it."""
        self._fit(light)
        return {
            k: self._light_of(look, self._samples(k, look)).reshape(*look.valid.shape, *light.shape[2:])
            for k, look in looks.items()
        }

    def _light_of(self, look: Look, samples: int) -> np.ndarray:
        """Light [h, w, C] of a view; that of finer places some rows at a time, but for holes, which are filled from
        anywhere."""
        assert self._spline
        (x, y, _), rows = look.places, len(look.places.x)
        if samples > 1 and look.fill is None:
            rows = samples * max(AT_ONCE // (samples * x.shape[1]), 1)
        made = []
        for first in range(0, len(x), rows):
            fine = sampled(self._spline, x[first : first + rows], y[first : first + rows], self._bands, *look.cuts)
            if look.fill is not None:
                apply_fill(look.fill, fine, SMOOTHINGS)
            made.append(pixel_means(fine, samples))
        return made[0] if len(made) == 1 else np.concatenate(made)

    def _sampled_on_device(self, light: Any, looks: dict[int, Look]) -> dict[int, Any]:
        """Light of a tensor, as cameras see it."""
        spline, seen = spline_of(light), {}
        for k, look in looks.items():
            if k not in self._uploaded or self._uploaded[k][0] is not look:
                x, y, _ = look.places
                there = TensorLook(self.source.size, x, y, self._samples(k, look), look.fill, look.cuts, light.device)
                self._uploaded[k] = look, there
            view = self._uploaded[k][1].light(spline, SMOOTHINGS)
            seen[k] = view.reshape(*look.valid.shape, *light.shape[2:])
        return seen

    def _samples(self, k: int, look: Look) -> int:
        """Places across each pixel of a camera."""
        return len(look.places.x) // self.cameras[k][0].size[1]

    def looks(self, depth_m: np.ndarray | None = None) -> list[Look]:
        """How the view of each camera is made."""
        if depth_m is None:
            if self.needs_depth():
                raise UsageError("a camera beside the source, and no depth; give a plane or a depth map")
            return [look for look in self._fixed if look is not None]
        self._check(depth_m, "depth")
        depth_m = np.array(depth_m, np.float32, order="C")
        # (compared as bits: NaN is NaN)
        if not np.array_equal(depth_m.view(np.int32), self._depth_m.view(np.int32)):
            self._corners = self._corners or corners_of(self.source)
            inverse, known = filled_inverse(depth_m)
            surface = surface_of(inverse, self._corners, self.source)
            self._looks = [self._look_at_surface(k, surface, known) for k in range(len(self.cameras))]
            self._depth_m = depth_m
        return self._looks  # type: ignore[return-value]

    def _fit(self, light: np.ndarray) -> None:
        """Make the spline of a picture, in the memory of the last one, since fresh memory takes as long as the work."""
        if self._spline is None or len(self._spline.pixels) != (1 if light.ndim == 2 else 3):
            self._spline = Spline(light, self._bands)
        else:
            self._spline.fit(light)

    def _look_at_plane(self, camera: Intrinsics, pose: Pose, plane_m: float, samples: int) -> Look:
        if is_same(self.source, camera, pose):
            empty = np.zeros((camera.size[1], 0), np.float32)
            return Look(Places(empty, empty, empty > 0), np.ones(camera.size[::-1], np.bool_))
        places = places_on_plane(self.source, camera, pose, plane_m)
        samples = max(samples, samples_for(places))
        if samples > 1:
            places = places_on_plane(self.source, camera, pose, plane_m, samples)
        return Look(places, _of_whole_pixels(places.seen, camera))

    def _look_at_surface(self, k: int, surface: Surface, known: np.ndarray) -> Look:
        (camera, pose), far = self.cameras[k], self._far[k]
        if not pose.translation_m.any():
            return far
        samples = self._samples(k, far)
        x, y, inverse = seen_of(surface, _finer(camera, samples), pose, self._bands)
        more = samples_for(Places(x, y, inverse >= 0), samples, LOOKED_AT)
        if more > samples:  # (from behind the source what is near looks smaller than what is far)
            samples, (x, y, inverse) = more, seen_of(surface, _finer(camera, more), pose, self._bands)
        seen = inverse >= 0
        if not seen.any():
            nothing = far.places._replace(seen=np.zeros_like(far.places.seen))
            return far._replace(places=nothing, valid=np.zeros_like(far.valid))
        if not known.all():
            width, height = self.source.size
            columns, rows = np.clip(np.rint(x), 0, width - 1), np.clip(np.rint(y), 0, height - 1)
            seen &= known[rows.astype(np.intp), columns.astype(np.intp)]
        cuts = surface.near_cut, surface.inverse[1:-1, 1:-1], surface.steep
        fill = fill_of(inverse, INSET_PX * samples)
        return Look(Places(x, y, seen), _of_whole_pixels(seen, camera), fill, cuts)

    def _check(self, picture: np.ndarray, what: str) -> None:
        width, height = self.source.size
        shape = picture.shape
        if shape[:2] != (height, width) or (len(shape) != 2 and (what == "depth" or shape[2:] != (3,))):
            raise UsageError(f"{what} of shape {list(shape)}, expected {width}x{height} pixels like the source's")


def is_same(source: Intrinsics, camera: Intrinsics, pose: Pose) -> bool:
    """Whether the camera's picture is the source's."""
    here = np.array_equal(pose.rotation, IDENTITY.rotation) and not pose.translation_m.any()
    return bool(here and source == camera)


def filled_inverse(depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse depth [h, w] float32, 1/m, filled from the background where it is not known, and where it is known.

    Without any that is known it is infinitely far.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        known = depth_m >= NEAREST_M
        inverse = np.where(known, 1 / depth_m, np.float32(-1)).astype(np.float32)
    if not known.all():
        apply_fill(fill_of(inverse), inverse[..., None])
    return (inverse if known.any() else np.zeros_like(inverse)), known


def _finer(camera: Intrinsics, samples: int) -> Intrinsics:
    """The camera with so many pixels across and down in the place of each."""
    return camera.scaled_to((camera.size[0] * samples, camera.size[1] * samples)) if samples > 1 else camera


def _of_whole_pixels(seen: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """Which pixels are seen in all their places."""
    width, height = camera.size
    parts = seen.reshape(height, seen.shape[0] // height, width, seen.shape[1] // width)
    return np.asarray(parts.all(axis=(1, 3)))
