"""Events of a sensor with another place, lens or resolution, in the geometry of the frames.

A count of events is how often the log of light has gone through a threshold: it belongs to a place, like light, not
to an area.  So a pixel of the frame takes the counts from where it looks in the event camera, between four of its
pixels. Where pixels of the frame are larger, these are means over as many pixels.  Where it looks at nothing, there
are none.

Where the cameras are calibrated, `places_of` says where pixels look, through both lenses, by depth or at infinity
(which is rectification).  Where they are not, `over` lays one picture over the other, and the network has to learn
the rest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch

from interp.representation.event_counts import EventCounts, Places
from interp.warp import sample_part

if TYPE_CHECKING:
    from vid2ev.rig.intrinsics import Intrinsics
    from vid2ev.rig.pose import Pose


class Look(NamedTuple):
    """Where pixels of frames look at an event camera.

    where  [H, W, 2] px (x, y) of the event camera; NaN is a place that is not known
    exact  whether that is so of all that they see, and not of what is far away alone
    """

    where: torch.Tensor
    exact: bool


Part = tuple[slice, slice]
ALL: Part = slice(None), slice(None)


def carried(counts: EventCounts, places: torch.Tensor, within: Part = ALL) -> EventCounts:
    """Counts [B, 2, S, h, w] at places [H, W, 2] px (x, y) of the event camera: [B, 2, S, H, W] float32.

    NaN is a place that is not known.

    within   rows and columns of the places: that part alone
    """
    return _carried(counts, places[within], _pixels_across(places, counts.off_on.shape[-2:]))


def over(counts: EventCounts, size: tuple[int, int], within: Part = ALL) -> EventCounts:
    """Counts laid over frames of a size (height, width): at the places that they know, or else edge on edge, as for
    cameras that are not calibrated.

    within   rows and columns of the frames: that part alone
    """
    if counts.places is not None:
        alone = [replace(counts, off_on=each[None]) for each in counts.off_on]
        known = zip(alone, counts.places.where, counts.places.across, strict=True)
        laid = [_carried(one, where[within], across) for one, where, across in known]
        return replace(laid[0], off_on=torch.cat([each.off_on for each in laid]))
    if counts.off_on.shape[-2:] == size:
        return counts if within == ALL else replace(counts, off_on=counts.off_on[(..., *within)])
    return carried(counts, places_over(counts, size), within)


def at_places(counts: EventCounts, where: torch.Tensor) -> EventCounts:
    """Counts that are to be carried to places [B, H, W, 2] px (x, y) of the event camera."""
    size = counts.off_on.shape[-2:]
    return replace(counts, places=Places(where, tuple(_pixels_across(each, size) for each in where)))


def _carried(counts: EventCounts, places: torch.Tensor, across: float) -> EventCounts:
    height, width = counts.off_on.shape[-2:]
    seen = _seen(places, (height, width))
    factor = max(1, round(across))
    maps = counts.pooled(factor).off_on.flatten(1, 2)
    # (what is beyond the sensor is looked for at its edge, and not counted)
    on_it = torch.nan_to_num(places).clamp(min=-0.5).minimum(places.new_tensor([width, height]) - 0.5)
    where = ((on_it + 0.5) / factor - 0.5).permute(2, 0, 1)
    found = sample_part(maps, where.expand(len(maps), -1, -1, -1).float()).mul_(seen)
    laid = found.unflatten(1, counts.off_on.shape[1:3])
    return replace(counts, off_on=laid, footprint=_footprint(across), places=None)


def places_over(counts: EventCounts, size: tuple[int, int]) -> torch.Tensor:
    """Where pixels of frames of a size (height, width) lie on the event camera, edge on edge: [H, W, 2] px (x, y)."""
    height, width = counts.off_on.shape[-2:]
    across = (torch.arange(size[1]) + 0.5) * (width / size[1]) - 0.5
    down = (torch.arange(size[0]) + 0.5) * (height / size[0]) - 0.5
    return torch.stack([across.expand(size), down[:, None].expand(size)], -1).to(counts.off_on.device)


def places_of(
    frame_camera: Intrinsics,
    frame_pose: Pose,
    event_camera: Intrinsics,
    event_pose: Pose,
    depth_m: np.ndarray | float = np.inf,
) -> torch.Tensor:
    """Where pixels of the frame camera look in the event camera: [H, W, 2] px float32; NaN where it is not known.

    depth_m   of what the frame camera sees, [H, W] or one number
    The poses are those of the cameras in one and the same frame.
    """
    from vid2ev.rig.truth import pixel_map

    depth = np.broadcast_to(np.asarray(depth_m, np.float64), frame_camera.size[::-1])
    return torch.from_numpy(pixel_map(frame_camera, frame_pose, depth, event_camera, event_pose))


def footprint_of(size: tuple[int, int], event_size: tuple[int, int]) -> int:
    """How many pixels of frames a pixel of an event camera is wide that is laid over them, edge on edge."""
    return max(1, round(size[0] / event_size[0]))


def footprint_over(counts: EventCounts, size: tuple[int, int]) -> int:
    """The footprint that counts have, laid `over` frames of a size (height, width)."""
    if counts.places is not None:
        return _footprint(counts.places.across[0])
    height, width = counts.off_on.shape[-2:]
    return counts.footprint if (height, width) == size else footprint_of(size[::-1], (width, height))


def _footprint(across: float) -> int:
    # (places in float32 are off in their last digits, which must not decide what is halfway)
    return max(1, round(round(1 / max(across, 1e-9), 3)))


def _seen(places: torch.Tensor, size: tuple[int, ...]) -> torch.Tensor:
    """Which places [H, W, 2] are on a sensor of a size (height, width)."""
    return ((places > -0.5) & (places < places.new_tensor(size[::-1]) - 0.5)).all(-1)


def _pixels_across(places: torch.Tensor, size: tuple[int, ...]) -> float:
    """How many pixels of an event camera of a size a pixel of the frame is wide, in the middle of all; of frames of one
    column how high."""
    places = places if places.shape[1] > 1 else places.transpose(0, 1)
    seen = _seen(places, size)
    across = (places[:, 1:] - places[:, :-1]).norm(dim=-1)[seen[:, 1:] & seen[:, :-1]]
    return float(across.median()) if len(across) else 1.0
