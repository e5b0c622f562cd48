"""Differences between images, and what is wanted of flows: means over all their values, in float32 also under autocast.

    Charbonnier   mean sqrt(d^2 + e^2), e = 0.001: near 0 a parabola, so that what is exactly right has slope 0 and
                  not infinity
    pyramid       sum over levels of mean |L_k(d)|, L_k the k-th level of the Laplacian pyramid; kornia's pyrdown and
                  pyrup are none: they lose the last of an odd number of pixels
    smoothness    mean |dF/dx| + mean |dF/dy|
    log error     mean over images of ln(mean d^2 + e), e = 1e-6, where PSNR is 60 dB: PSNR in another unit, so that a
                  decibel counts the same in pictures that are nearly right as in those that are far off

Sources: Charbonnier et al. (1994), "Two deterministic half-quadratic regularization algorithms for computed imaging",
ICIP; Burt and Adelson (1983), "The Laplacian pyramid as a compact image code", IEEE Trans. Communications 31(4);
smoothness and warps, Jiang et al. (2018), "Super SloMo", CVPR.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from interp.precision import in_full_precision
from interp.warp import warp

EPSILON = 1e-3
LEAST_ERROR = 1e-6
LEVELS = 5
BINOMIAL = (1 / 16, 4 / 16, 6 / 16, 4 / 16, 1 / 16)


@in_full_precision
def charbonnier(images: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """A smooth absolute difference; EPSILON for 0."""
    return torch.sqrt((images - truth) ** 2 + EPSILON**2).mean()


@in_full_precision
def absolute(images: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """The mean absolute difference."""
    return (images - truth).abs().mean()


@in_full_precision
def log_error(images: torch.Tensor, truth: torch.Tensor, where: torch.Tensor | None = None) -> torch.Tensor:
    """How far images [..., C, H, W] are from the truth, by ratio; where it says so, if it does."""
    error = (images - truth) ** 2
    if where is None:
        return torch.log(error.mean((-3, -2, -1)) + LEAST_ERROR).mean()
    number = where.sum((-3, -2, -1))
    mean = (error * where).sum((-3, -2, -1)) / number.clamp(min=1)
    return (torch.log(mean + LEAST_ERROR) * (number > 0)).sum() / (number > 0).sum().clamp(min=1)


@in_full_precision
def pyramid(images: torch.Tensor, truth: torch.Tensor, levels: int = LEVELS) -> torch.Tensor:
    """The difference of images [..., C, H, W] in the levels of a Laplacian pyramid, as far as there are pixels for
    them."""
    difference = (images - truth).flatten(0, -4) if images.ndim > 4 else images - truth
    return torch.stack([level.abs().mean() for level in laplacian(difference, levels)]).sum()


@in_full_precision
def laplacian(images: torch.Tensor, levels: int = LEVELS) -> list[torch.Tensor]:
    """The levels of the Laplacian pyramid of images [B, C, H, W], from fine to coarse, as far as there are pixels for
    them: what each loses in the next one, which has every other pixel from the first on, and of the last all."""
    found, rest = list[torch.Tensor](), images
    while len(found) < levels - 1 and min(rest.shape[-2:]) >= 2:
        lower = _blurred(rest)[..., ::2, ::2]
        found.append(rest - _expanded(lower, rest.shape[-2:]))
        rest = lower
    return [*found, rest]


@in_full_precision
def smoothness(flows: torch.Tensor) -> torch.Tensor:
    """How much flows [..., c, H, W] px change from pixel to pixel; 0 of a single pixel."""
    across, down = flows.diff(dim=-1).abs(), flows.diff(dim=-2).abs()
    return across.sum() / max(across.numel(), 1) + down.sum() / max(down.numel(), 1)


@in_full_precision
def between_frames(flows: torch.Tensor, frame_0: torch.Tensor, frame_1: torch.Tensor) -> torch.Tensor:
    """How badly flows [B, 4, H, W] px carry two frames [B, C, H, W] into each other: mean absolute differences, both
    ways."""
    return absolute(warp(frame_1, flows[:, :2]), frame_0) + absolute(warp(frame_0, flows[:, 2:]), frame_1)


def _blurred(x: torch.Tensor) -> torch.Tensor:
    """A binomial blur over 5 x 5 pixels, [B, C, H, W], continued by its border."""
    kernel = x.new_tensor(BINOMIAL).expand(x.shape[1], 1, 1, 5)
    x = F.conv2d(F.pad(x, (2, 2, 0, 0), mode="replicate"), kernel, groups=x.shape[1])
    return F.conv2d(F.pad(x, (0, 0, 2, 2), mode="replicate"), kernel.transpose(2, 3), groups=x.shape[1])


def _expanded(x: torch.Tensor, size: torch.Size) -> torch.Tensor:
    """x [B, C, h, w] with twice the pixels, of which its own are every other from the first on, up to a size (H, W)."""
    height, width = size
    return _doubled(_doubled(x, width).mT, height).mT


def _doubled(x: torch.Tensor, width: int) -> torch.Tensor:
    """Across, the binomial blur of x with zeros in between, times two, continued by its border."""
    continued = F.pad(x, (1, 1, 0, 0), mode="replicate")
    before, after = continued[..., :-2], continued[..., 2:]
    at, between = (before + 6 * x + after) / 8, (x + after) / 2
    return torch.stack([at, between], -1).flatten(-2)[..., :width]
