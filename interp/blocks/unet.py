"""One UNet for all networks: those of RRIN and of Super SloMo are two layouts of it.

    down     convolutions, then a mean over 2 x 2, level by level
    middle   one convolution more at the lowest level (RRIN)
    up       bilinear to twice the size, a convolution, joined with what the level had on the way down, convolutions

Every convolution but some (see `Layout`) is followed by a leaky ReLU of slope 0.1.  The head has none: on flows it
would scale one direction and not the other (Super SloMo's code has it there; Time Lens removed it).

Sources: RRIN, https://github.com/HopLee6/RRIN; Super SloMo, https://github.com/avinashpaliwal/Super-SloMo: the
numbers of channels, kernels and levels.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

SLOPE = 0.1


@dataclass(frozen=True, slots=True)
class Layout:
    """A UNet's levels, from full resolution down.

    widths        channels of each level
    kernels       side of the two convolutions of each level on the way down
    middle        a convolution more at the lowest level
    after_join    convolutions after a join
    leaky_rise    whether the convolution before a join is followed by a leaky ReLU
    """

    widths: tuple[int, ...]
    kernels: tuple[int, ...]
    middle: bool
    after_join: int
    leaky_rise: bool


def rrin_layout(levels: int, base: int) -> Layout:
    """RRIN's: widths base, 2 base, 4 base, ..."""
    widths = tuple(base << level for level in range(levels))
    return Layout(widths, (3,) * levels, middle=True, after_join=2, leaky_rise=False)


def slomo_layout(base: int) -> Layout:
    """Super SloMo's: six levels, the last two alike."""
    widths = tuple(base << min(level, 4) for level in range(6))
    return Layout(widths, (7, 5, 3, 3, 3, 3), middle=False, after_join=1, leaky_rise=True)


class Unet(nn.Module):
    """A UNet of a layout; sides must be multiples of `multiple`."""

    def __init__(self, channels_in: int, channels_out: int, layout: Layout, zero_head: bool = False):
        super().__init__()
        widths = layout.widths
        self.leaky_rise = layout.leaky_rise
        self.multiple = 1 << (len(widths) - 1)
        self.down = nn.ModuleList(
            _leaky(before, width, kernel, 2)
            for before, width, kernel in zip((channels_in, *widths), widths, layout.kernels, strict=False)
        )
        self.middle = _leaky(widths[-1], widths[-1], 3, 1) if layout.middle else nn.Identity()
        below = list(zip(widths[1:], widths[:-1], strict=True))[::-1]
        self.rise = nn.ModuleList(nn.Conv2d(lower, width, 3, padding=1) for lower, width in below)
        self.joined = nn.ModuleList(_leaky(2 * width, width, 3, layout.after_join) for _, width in below)
        self.head = nn.Conv2d(widths[0], channels_out, 3, padding=1)
        if zero_head:
            nn.init.zeros_(self.head.weight)
            nn.init.zeros_(self.head.bias)  # type: ignore[arg-type]

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """[B, channels_out, H, W] of [B, channels_in, H, W]."""
        levels = []
        for number, convolutions in enumerate(self.down):
            x = convolutions(F.avg_pool2d(x, 2) if number else x)
            levels.append(x)
        x = self.middle(x)
        for rise, joined, level in zip(self.rise, self.joined, levels[-2::-1], strict=True):
            x = rise(F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False))
            x = F.leaky_relu(x, SLOPE) if self.leaky_rise else x
            x = joined(torch.cat([x, level], 1))
        return self.head(x)


def _leaky(channels_in: int, channels_out: int, kernel: int, count: int) -> nn.Sequential:
    """So many convolutions, each with its leaky ReLU."""
    layers: list[nn.Module] = []
    for before in (channels_in, channels_out)[:count]:
        layers += [nn.Conv2d(before, channels_out, kernel, padding=kernel // 2), nn.LeakyReLU(SLOPE)]
    return nn.Sequential(*layers)


class HalfSized(nn.Module):
    """A UNet that sees squares of 2 x 2 pixels as channels: a quarter of the places, four times the channels at both
    ends.

    Nothing then has full resolution, which is what takes time on a CPU.  `layout` should have twice the channels.
    """

    def __init__(self, channels_in: int, channels_out: int, layout: Layout, zero_head: bool = False):
        super().__init__()
        self.unet = Unet(4 * channels_in, 4 * channels_out, layout, zero_head)
        self.multiple = 2 * self.unet.multiple

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """[B, channels_out, H, W] of [B, channels_in, H, W]."""
        return F.pixel_shuffle(self.unet(F.pixel_unshuffle(x, 2)), 2)
