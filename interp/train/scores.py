"""How near images are to the truth, as validation measures it: codes of 8 bits, rounded, of 0 ... 255.

    PSNR   10 lg(255^2 / mean squared error), of all pixels, of moving and of static ones; at most 100 dB
    SSIM   with a Gaussian window of sigma 1.5 px, 11 x 11, mean over channels; borders of 5 px left out

A pixel moves if its truth is more than 10 codes away from either key frame in any channel.  Both scores are those of
scikit-image (`peak_signal_noise_ratio`; `structural_similarity` with gaussian_weights, use_sample_covariance=False).

Source of SSIM: Wang et al. (2004), "Image quality assessment: from error visibility to structural similarity", IEEE
TIP 13.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import torch
from torch.nn import functional as F

PEAK = 255.0
HIGHEST_DB = 100.0  # of images without an error
MOVED = 10.0  # codes
SIGMA_PX, RADIUS_PX = 1.5, 5  # 3.5 sigma, as scikit-image cuts it
C1, C2 = (0.01 * PEAK) ** 2, (0.03 * PEAK) ** 2


@dataclass(frozen=True, slots=True)
class Scores:
    """Of one image, or the mean of many; `moving` and `static` are NaN where there are no such pixels."""

    psnr: float
    ssim: float
    moving: float
    static: float

    @staticmethod
    def mean(scores: Sequence[Scores]) -> Scores:
        """Means over images, each over those that have a number."""
        columns = zip(*map(astuple, scores), strict=True)
        return Scores(*(_mean([value for value in column if not math.isnan(value)]) for column in columns))

    def named(self, prefix: str) -> dict[str, float]:
        """Those that are numbers, by name."""
        values = {f"{prefix}{field.name}": float(getattr(self, field.name)) for field in fields(self)}
        return {name: value for name, value in values.items() if not math.isnan(value)}


def scores(images: torch.Tensor, truth: torch.Tensor, frame_0: torch.Tensor, frame_1: torch.Tensor) -> list[Scores]:
    """Scores of images [N, C, H, W] against the truth of as many; frames [C, H, W] are those around; codes 0 ... 1."""
    made, true = rounded(images), rounded(truth)
    keys = rounded(torch.stack([frame_0, frame_1]))
    error = (made - true) ** 2
    moves = ((true[:, None] - keys).abs() > MOVED).any(2).any(1, keepdim=True).expand_as(error)
    similar = ssim(made, true)
    return [Scores(psnr(e), float(s), psnr(e[m]), psnr(e[~m])) for e, m, s in zip(error, moves, similar, strict=True)]


def rounded(images: torch.Tensor) -> torch.Tensor:
    """Codes as 8 bits hold them: whole numbers 0 ... 255, float64."""
    return (images.double().clamp(0, 1) * PEAK).round()


def psnr(squared: torch.Tensor) -> float:
    """PSNR [dB] of squared errors of codes; NaN of none."""
    if not squared.numel():
        return math.nan
    mean = float(squared.mean())
    return min(10 * math.log10(PEAK**2 / mean), HIGHEST_DB) if mean else HIGHEST_DB


def ssim(images: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """SSIM [N] of codes [N, C, H, W] float64; images smaller than 11 px have none (NaN)."""
    if min(images.shape[-2:]) <= 2 * RADIUS_PX:
        return images.new_full((len(images),), math.nan)
    x, y = images.flatten(0, 1)[:, None], truth.flatten(0, 1)[:, None]
    mean_x, mean_y = blurred(x), blurred(y)
    var_x = (blurred(x * x) - mean_x**2).clamp(min=0)  # (the difference may be below 0 by rounding)
    var_y = (blurred(y * y) - mean_y**2).clamp(min=0)
    both = blurred(x * y) - mean_x * mean_y
    found = (2 * mean_x * mean_y + C1) * (2 * both + C2) / ((mean_x**2 + mean_y**2 + C1) * (var_x + var_y + C2))
    return found.mean((1, 2, 3)).unflatten(0, images.shape[:2]).mean(1)


def blurred(x: torch.Tensor) -> torch.Tensor:
    """Means [N, 1, H - 10, W - 10] with a Gaussian window, where it lies within the image."""
    places = torch.arange(-RADIUS_PX, RADIUS_PX + 1, dtype=x.dtype, device=x.device)
    window = torch.exp(-0.5 * (places / SIGMA_PX) ** 2)
    window = window / window.sum()
    return F.conv2d(F.conv2d(x, window[None, None, :, None]), window[None, None, None, :])


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan
