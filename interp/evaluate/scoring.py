"""From a rebuilt frame and the true one to a row."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from interp.candidates.bridge import DARK
from interp.evaluate.group import Group
from interp.evaluate.protocol import range_of
from interp.evaluate.row import Row
from interp.own_codes import light_of
from vid2ev.compare.pictures import highest, lowest, moments, moving, psnr, psnr_of_mean, squared_error
from vid2ev.stream.frames import LUMINANCE
from vid2ev.upsample.motion import MotionEstimator

LEAST_EXPLAINED = 0.25  # of what changes: of pans that are found 0.87 and more, of others up to 0.12; films 0.4 to 0.9


def rows_of(
    sequence: str, method: str, group: Group, made: Sequence[np.ndarray | None], conditions: Mapping[str, Any]
) -> list[Row]:
    """The rows of a group.

    made         the rebuilt frames at its positions, uint8 [H, W, 3]; None for those that are missing
    conditions   of the group (`conditions_of`)
    """
    return [
        Row(
            sequence=sequence, method=method, group=group.number, position=position,
            multiple=len(group.times_us) - 1, t_us=int(group.times_us[position]),
            contrast=contrast_of(true, group.curve),
            **scores_of(picture, true, group.keys), **conditions,
        )
        for position, true, picture in zip(group.positions, group.truth, made, strict=True)
        if picture is not None
    ]  # fmt: skip


def scores_of(made: np.ndarray, true: np.ndarray, keys: np.ndarray) -> dict[str, Any]:
    """The scores of a row, by their names, of pictures uint8 [H, W, 3] with key frames [2, H, W, 3]."""
    channels, found, peak = true.shape[2], moments(made, true), range_of(true)
    total = squared_error(made, true) @ np.ones(channels)  # (of whole numbers: exact)
    moves, worst, squared = moving(true, keys), highest(total), total / channels
    scores: dict[str, Any] = {
        "psnr": psnr(squared, peak), "psnr_255": psnr(squared),
        "psnr_moving": psnr(squared[moves]), "psnr_static": psnr(squared[~moves]), "moving": float(moves.mean()),
        "patch_psnr": psnr_of_mean(worst.value / channels), "patch_x": worst.x, "patch_y": worst.y,
    }  # fmt: skip
    if found is None:
        return scores | {"ssim": math.nan, "ssim_255": math.nan, "patch_ssim": math.nan}
    plane = found.ssim_map()
    ssim = float(found.ssim_map(peak, sample=True).mean())
    return scores | {"ssim": ssim, "ssim_255": float(plane.mean()), "patch_ssim": lowest(plane).value}


def conditions_of(group: Group) -> dict[str, float]:
    """What makes a group hard, by the names of a row."""
    first, last = (light_of(group.curve)[key] @ LUMINANCE for key in group.keys)
    motion = MotionEstimator().between(first, last)
    moved = motion.shift_px if motion.explained >= LEAST_EXPLAINED else math.nan
    height, width = group.events.off_on.shape[-2:]
    return {
        "motion_px": moved,
        "motion_px_per_s": moved * 1e6 / group.gap_us,
        "events_per_px": float(group.events.off_on.double().sum()) / (height * width),
        "blur_px": moved * group.cameras.exposure_us / group.gap_us,
        "disparity_px": group.cameras.disparity_px,
        "offset_us": group.cameras.offset_us,
    }


def contrast_of(true: np.ndarray, curve: str = "srgb") -> float:
    """Standard deviation of the log light of a picture uint8 [H, W, 3] [nat]."""
    return float(np.log(light_of(curve)[true] @ LUMINANCE + np.float32(DARK)).std(dtype=np.float64))
