"""Layers of light as `layer_kernel.lay` lays them, on whatever device of torch's: many pictures at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch

AT_A_TIME = 1 << 22  # pixels of pictures; each takes some 100 bytes meanwhile


class Laid(NamedTuple):
    """Where a layer is in some pictures, each as `layer_kernel.lay` takes it: `place` [n, 4] and `waves` [n, 3]."""

    layer: torch.Tensor
    place: torch.Tensor
    waves: torch.Tensor
    mirrored: bool


def seen(layers: Sequence[Laid], size: tuple[int, int]) -> torch.Tensor:
    """Light [n, H, W, 3] float32 of layers, one before the other, in pictures of a size (width, height)."""
    count, (width, height) = len(layers[0].place), size
    out = layers[0].layer.new_zeros(count, height, width, 3)
    each = max(1, AT_A_TIME // (width * height))
    for begin in range(0, count, each):
        part = slice(begin, begin + each)
        for one in layers:
            _lay(one._replace(place=one.place[part], waves=one.waves[part]), out[part])
    return out


def _lay(one: Laid, out: torch.Tensor) -> None:
    (rows, columns), (height, width) = one.layer.shape[:2], out.shape[1:3]
    x, y = _places(one.place, one.waves, height, width)
    column, row = x.floor(), y.floor()
    across, down = _spline((x - column).float()), _spline((y - row).float())
    flat, sums = one.layer.reshape(-1, 4), out.new_zeros(*out.shape[:3], 4)
    for k in range(4):
        at_y, weight_y = _within(row.long() - 1 + k, down[k], rows, one.mirrored)
        for m in range(4):
            at_x, weight_x = _within(column.long() - 1 + m, across[m], columns, one.mirrored)
            sums += (weight_y * weight_x)[..., None] * flat[at_y * columns + at_x]
    out.mul_(1 - sums[..., 3:]).add_(sums[..., :3])


def _places(place: torch.Tensor, waves: torch.Tensor, height: int, width: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Columns and rows of the layer [n, H, W], float64, that pixels look at."""
    down = torch.arange(height, device=place.device, dtype=torch.float64) + 0.5 - height / 2
    right = torch.arange(width, device=place.device, dtype=torch.float64) + 0.5 - width / 2
    tall, long, phase = (each[:, None] for each in waves.unbind(1))
    sway = tall * torch.sin(2 * torch.pi * (down / long + phase))
    right, down = right + sway[..., None], down[:, None]
    x, y, along, turned = (each[:, None, None] for each in place.unbind(1))
    return x + right * along - down * turned - 0.5, y + right * turned + down * along - 0.5


def _spline(share: torch.Tensor) -> tuple[Any, ...]:
    """Weights of four pixels about a place `share` behind the second."""
    rest = 1 - share
    return (
        rest**3 / 6, 2 / 3 - share**2 * (1 - share / 2), 2 / 3 - rest**2 * (1 - rest / 2), share**3 / 6
    )  # fmt: skip


def _within(at: torch.Tensor, weight: torch.Tensor, length: int, mirrored: bool) -> tuple[torch.Tensor, torch.Tensor]:
    """Places along an axis, and weights: beyond its ends it goes on mirrored, or there is nothing."""
    if mirrored:
        at = at % (2 * length)
        return torch.minimum(at, 2 * length - 1 - at), weight
    return at.clamp(0, length - 1), torch.where((at >= 0) & (at < length), weight, 0)
