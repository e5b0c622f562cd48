"""Backward warps: a picture seen where a flow leads.

    g(I, F)(x) = I(x + F(x))        bilinear; F in pixels, channel 0 across, 1 down

Beyond the border of the picture is its border.  Zero flow gives back the very bits, whole numbers give whole shifts,
and a flow that is NaN counts as none: torch's sampling on a CPU would read outside of its memory there.

Sampling takes places as fractions g of the picture, x = ((g + 1) n - 1) / 2.  That is exact for whole x where n is a
power of two, so the picture is first made that large, on its right and at its bottom, where no place is looked up.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from interp.precision import in_full_precision


@in_full_precision
def warp(images: torch.Tensor, flow: torch.Tensor, corner: tuple[int, int] | None = None) -> torch.Tensor:
    """Pictures [B, C, H, W] where a flow leads: [B, C, h, w] for a flow [B, 2, h, w] px.

    Of N flows for each picture, [B, N, 2, h, w], it gives [B, N, C, h, w] without copies of the pictures.

    corner   row and column of the pictures at which the flow begins, where it is of a part of them
    """
    here = pixel_places(*flow.shape[-2:], device=flow.device, dtype=flow.dtype)
    places = here + torch.nan_to_num(flow)
    return sample(images, places) if corner is None else sample_part(images, places, corner)


def both_warped(
    frame_0: torch.Tensor, frame_1: torch.Tensor, flows: torch.Tensor, corner: tuple[int, int] | None = None
) -> torch.Tensor:
    """Two pictures [B, C, H, W] where flows [B, N, 4, h, w] px to the one and the other lead: [B, N, 2, C, h, w]."""
    return torch.stack([warp(frame_0, flows[:, :, :2], corner), warp(frame_1, flows[:, :, 2:], corner)], 2)


@in_full_precision
def sample(images: torch.Tensor, places: torch.Tensor) -> torch.Tensor:
    """Pictures [B, C, H, W] at places [B, 2, h, w] or [B, N, 2, h, w] px; as `warp`.  Places must not be NaN."""
    height, width = images.shape[-2:]
    across, down = _power_of_two(width), _power_of_two(height)
    x, y = places.to(images.dtype).unbind(-3)
    grid = torch.stack([(2 * x.clamp(0, width - 1) + 1) / across - 1, (2 * y.clamp(0, height - 1) + 1) / down - 1], -1)
    larger = F.pad(images, (0, across - width, 0, down - height))
    if places.ndim == 4:
        return F.grid_sample(larger, grid, mode="bilinear", padding_mode="border", align_corners=False)
    below = grid.flatten(1, 2)  # the N pictures as one, below each other
    found = F.grid_sample(larger, below, mode="bilinear", padding_mode="border", align_corners=False)
    return found.unflatten(2, grid.shape[1:3]).transpose(1, 2)


@in_full_precision
def sample_part(images: torch.Tensor, places: torch.Tensor, corner: tuple[int, int] = (0, 0)) -> torch.Tensor:
    """Pictures, of any type, at places from a corner on; no more of them is touched than is looked at."""
    looked_at, from_there = [], []
    for start, place, side in zip(corner, reversed(places.unbind(-3)), images.shape[-2:], strict=True):
        inside = (place + start).clamp(0, side - 1)
        first = int(inside.min())
        looked_at.append(slice(first, int(inside.max()) + 2))
        from_there.append(inside - first)
    rows, columns = looked_at
    return sample(images[..., rows, columns].to(places.dtype), torch.stack(from_there[::-1], -3))


def pixel_places(height: int, width: int, **kind: object) -> torch.Tensor:
    """Where the pixels of a picture are: [2, H, W], across and down."""
    down, across = torch.meshgrid(torch.arange(height, **kind), torch.arange(width, **kind), indexing="ij")  # type: ignore[call-overload]
    return torch.stack([across, down])


def flows_at(flows: torch.Tensor, times: torch.Tensor) -> torch.Tensor:
    """Flows [B, N, 4, H, W] from N times in 0 ... 1 between two frames to the first and the second of them.

        F_t0 = -(1 - t) t F_01 + t^2 F_10        F_t1 = (1 - t)^2 F_01 - t (1 - t) F_10

    flows [B, 4, H, W] px: F_01, F_10; times [B, N].  Straight and even motion (Jiang et al. (2018), "Super SloMo",
    CVPR).
    """
    t = times[:, :, None, None, None]
    forth, back = flows[:, None, :2], flows[:, None, 2:]
    return torch.cat([-(1 - t) * t * forth + t**2 * back, (1 - t) ** 2 * forth - t * (1 - t) * back], dim=2)


def _power_of_two(side: int) -> int:
    return 1 << (side - 1).bit_length()
