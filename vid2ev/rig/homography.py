"""What a camera sees of a plane, or of the infinitely far: a map from its pixels to those of the source.

The plane lies Z in front of the source and faces it.  Along the direction r of a pixel of the camera
(X_source = R X_camera + t) the source sees it in the direction

    g = R r + t (R r)_z / (Z - t_z)         or, between pixels, H = K_source (I + t e_z' / (Z - t_z)) R K_camera^-1

For Z = infinity this is the turn alone, and so it is without a translation, whatever the depth.  The plane is seen
where it is in front of both, Z > t_z and (R r)_z > 0; lenses bend r and g.

Source: R. Hartley, A. Zisserman, "Multiple View Geometry in Computer Vision", 2004, section 13.1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid, pixels_of, rays_of
from vid2ev.rig.pose import Pose

BORDER_PX = 1e-3  # beyond the outermost pixels' borders: rounding, not a place outside
SKIPPED = 0.25  # px of the source, between two places: so little is not worth more of them
FINEST = 16  # places across a pixel, at most
AT_ONCE = 1 << 18  # places: some 30 MB of float64


class Places(NamedTuple):
    """Where in the source the pixels of a camera look: for `samples` x `samples` places in each of its pixels."""

    x: np.ndarray  # [samples h, samples w] float32, px of the source; of what is not seen, the nearest that is
    y: np.ndarray
    seen: np.ndarray  # [samples h, samples w] bool


def places_on_plane(
    source: Intrinsics, camera: Intrinsics, pose: Pose, plane_m: float = math.inf, samples: int = 1
) -> Places:
    """Where in the source the pixels of a camera look, the scene being a plane at plane_m, infinity allowed."""
    width, height = camera.size[0] * samples, camera.size[1] * samples
    fine = camera.scaled_to((width, height)) if samples > 1 else camera
    before = _before_plane(pose, plane_m)
    onto = _onto_plane(pose, plane_m) if before else pose.rotation
    x, y = (np.empty((height, width), np.float32) for _ in range(2))
    seen = np.empty((height, width), np.bool_)
    rows = max(AT_ONCE // width, 1)
    for first in range(0, height, rows):  # (wide cameras around tele videos have 256 places in each pixel)
        band = np.s_[first : first + rows]
        grid = pixel_grid((width, len(x[band])))
        grid[..., 1] += first
        px, inside = _met(rays_of(grid, fine) @ onto.T, source)
        x[band], y[band], seen[band] = px[..., 0], px[..., 1], inside & before
    return Places(x, y, seen)


def samples_for(places: Places, samples: int = 1, every: int = 1) -> int:
    """How many places across a pixel it takes for none of the source to be skipped, by the median distance of pixels
    there; where a wide lens or a turn has pixels further apart than that, some are.

    places   `samples` across each pixel; of their rows and columns one in `every` is looked at, the middle ones too
    """
    spacings = []
    for axis in (0, 1):
        first = places.x.shape[1 - axis] // 2 % every
        x, y, seen = (np.moveaxis(values, axis, 0)[:, first::every] for values in places)
        step = np.hypot(np.diff(x, axis=0), np.diff(y, axis=0))[seen[1:] & seen[:-1]]
        spacings.append(samples * float(np.median(step)) if step.size else 1.0)
    return min(max(math.ceil(max(spacings) - SKIPPED), 1), FINEST)


def _met(directions: np.ndarray, source: Intrinsics) -> tuple[np.ndarray, np.ndarray]:
    """The places of the source [..., 2 px] in directions [..., 3], those on its border where it has none, and which
    are in its picture."""
    px = pixels_of(directions, source)
    with np.errstate(invalid="ignore"):
        inside = (px >= -0.5 - BORDER_PX).all(-1) & (px <= np.array(source.size) - 0.5 + BORDER_PX).all(-1)
    lost = np.isnan(px).any(-1)
    px[lost] = _towards(directions[lost], source)
    return px, np.asarray(inside)


def _before_plane(pose: Pose, plane_m: float) -> bool:
    if not plane_m > 0:
        raise UsageError(f"a plane at {plane_m} m; expected a distance greater than 0, or inf")
    return bool(plane_m - pose.translation_m[2] > 1e-9 * max(1.0, abs(pose.translation_m[2])))


def _onto_plane(pose: Pose, plane_m: float) -> np.ndarray:
    """[3, 3]: from directions of the camera to those in which the source sees the same place of the plane."""
    shear = np.eye(3)
    shear[:, 2] += pose.translation_m / (plane_m - pose.translation_m[2])
    return shear @ pose.rotation


def _towards(directions: np.ndarray, source: Intrinsics) -> np.ndarray:
    """The places on the picture's border [n, 2] in the sense of directions that have none."""
    way = np.nan_to_num(directions[:, :2] * source.focal_px)
    length = np.linalg.norm(way, axis=1, keepdims=True)
    way = np.where(length > 0, way / np.where(length > 0, length, 1), (1.0, 0.0))
    centre, last = np.clip(source.centre_px, 0, np.array(source.size) - 1), np.array(source.size) - 1
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # (along an edge, nearly or quite: never there)
        far = np.where(way > 0, (last - centre) / way, np.where(way < 0, -centre / way, np.inf))
    return centre + way * np.min(far, axis=1, keepdims=True)
