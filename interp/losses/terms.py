"""Differences between images, and what is wanted of flows: means over all their values, in float32 also under autocast.

    Charbonnier   mean sqrt(d^2 + e^2), e = 0.001: near 0 a parabola, so that what is exactly right has slope 0 and
                  not infinity
    pyramid       sum over levels of mean |L_k(d)|, L_k the k-th level of the Laplacian pyramid
    smoothness    mean |dF/dx| + mean |dF/dy|
    log error     mean over images of ln(mean d^2 + e), e = 1e-6, where PSNR is 60 dB: PSNR in nepers, so that a decibel
                  counts the same in pictures that are nearly right as in those that are far off
    log unlikeness   mean over images of ln(1 - SSIM + e), e = 0.0001, by ratio as well; SSIM as it is scored,
                  in windows of 11 x 11 px wherever they fit

Sources: Charbonnier et al. (1994), "Two deterministic half-quadratic regularization algorithms for computed imaging",
ICIP; Burt and Adelson (1983), "The Laplacian pyramid as a compact image code", IEEE Trans. Communications 31(4);
smoothness and warps, Jiang et al. (2018), "Super SloMo", CVPR; SSIM, Wang et al. (2004), "Image quality assessment",
IEEE Trans. Image Processing 13(4), and as a loss Zhao et al. (2017), "Loss functions for image restoration with neural
networks", IEEE Trans. Computational Imaging 3(1).
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from interp.precision import in_full_precision
from interp.warp import warp

EPSILON = 1e-3
LEAST_ERROR = 1e-6
LEAST_UNLIKENESS = 1e-4
WINDOW, WINDOW_PX = 11, 1.5  # side and sigma of SSIM's windows
SSIM_1, SSIM_2 = 0.01**2, 0.03**2
LEVELS = 5
BINOMIAL = (1 / 16, 4 / 16, 6 / 16, 4 / 16, 1 / 16)


@in_full_precision
def charbonnier(images: torch.Tensor, truth: torch.Tensor, epsilon: float = EPSILON) -> torch.Tensor:
    """A smooth absolute difference; epsilon for 0."""
    return torch.sqrt((images - truth) ** 2 + epsilon**2).mean()


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
def log_unlikeness(images: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """How unlike images [..., C, H, W] are to the truth, by ratio; 0 where they are smaller than a window."""
    if min(images.shape[-2:]) < WINDOW:
        return images.new_zeros(())
    shape, count = (-1, *images.shape[-3:]), images.shape[-3]
    made, true = images.reshape(shape), truth.reshape(shape)
    means = _windowed(torch.cat([made, true, made * made, true * true, made * true], 1)).split(count, 1)
    x, y, xx, yy, xy = means
    spread = (xx - x * x).clamp(min=0) + (yy - y * y).clamp(min=0)
    like = (2 * x * y + SSIM_1) * (2 * (xy - x * y) + SSIM_2) / ((x * x + y * y + SSIM_1) * (spread + SSIM_2))
    return torch.log((1 - like.mean((1, 2, 3))).clamp(min=0) + LEAST_UNLIKENESS).mean()


@in_full_precision
def pyramid(images: torch.Tensor, truth: torch.Tensor, levels: int = LEVELS) -> torch.Tensor:
    """The difference of images [..., C, H, W] in the levels of a Laplacian pyramid, as far as there are pixels for
    them."""
    rest = (images - truth).flatten(0, -4) if images.ndim > 4 else images - truth
    total = rest.new_zeros(())
    for _ in range(levels - 1):
        if min(rest.shape[-2:]) < 2:
            break
        lower = _blurred(rest)[..., ::2, ::2]
        total = (
            total + (rest - F.interpolate(lower, rest.shape[-2:], mode="bilinear", align_corners=False)).abs().mean()
        )
        rest = lower
    return total + rest.abs().mean()


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


def _windowed(x: torch.Tensor) -> torch.Tensor:
    """Means of x [B, C, H, W] over windows that fit in, weighed by a Gaussian: [B, C, H - 10, W - 10]."""
    place = torch.arange(WINDOW, device=x.device, dtype=x.dtype) - WINDOW // 2
    kernel = torch.exp(-0.5 * (place / WINDOW_PX) ** 2)
    kernel = (kernel / kernel.sum()).expand(x.shape[1], 1, 1, WINDOW)
    x = F.conv2d(x, kernel, groups=x.shape[1])
    return F.conv2d(x, kernel.transpose(2, 3), groups=x.shape[1])
