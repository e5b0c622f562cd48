"""How near images are to the truth, as validation measures it: codes of 8 bits, rounded, of 0 ... 255.

    PSNR   10 lg(255^2 / mean squared error), of all pixels, of moving and of static ones; at most 100 dB
    SSIM   with a Gaussian window of sigma 1.5 px, 11 x 11, mean over channels; borders of 5 px left out

A pixel moves if its truth is more than 10 codes away from either key frame in any channel.  Both scores are those of
`vid2ev.compare.pictures`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np
import torch

from vid2ev.compare.pictures import PEAK, moving, psnr, squared_error, ssim


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
    keys = rounded(torch.stack([frame_0, frame_1]))
    found = []
    for made, true in zip(rounded(images), rounded(truth), strict=True):
        error, moves = squared_error(made, true), moving(true, keys)
        found.append(Scores(psnr(error), ssim(made, true), psnr(error[moves]), psnr(error[~moves])))
    return found


def rounded(images: torch.Tensor) -> np.ndarray:
    """Images [N, C, H, W] as codes of 8 bits, uint8 [N, H, W, C]."""
    codes = (images.double().clamp(0, 1) * PEAK).round().to(torch.uint8)
    return codes.movedim(1, -1).contiguous().cpu().numpy()


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan
