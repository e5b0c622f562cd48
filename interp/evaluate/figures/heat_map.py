"""Where the error is: a map in colours with its scale."""

from __future__ import annotations

import math

import numpy as np

from interp.evaluate.figures.layout import check_pictures
from interp.evaluate.figures.lettering import GROUND, letters, write

COLOURS = "magma"
BAR_PX, MARGIN_PX = 10, 6
QUANTILE = 0.995  # of values, that the scale reaches where no other end is asked for
LEAST_CODES = 5.0


def error_codes(truth: np.ndarray, rebuilt: np.ndarray) -> np.ndarray:
    """The error of each pixel, root mean square over the channels, in codes; float64 [H, W].  Raises UsageError."""
    check_pictures(truth=truth, rebuilt=rebuilt)
    return np.sqrt(((truth.astype(np.float64) - rebuilt) ** 2).mean(axis=2))


def top_of(values: np.ndarray) -> float:
    """A round end of a scale that starts at 0, for values that are not negative; NaN is left out."""
    known = values[np.isfinite(values)]
    high = max(float(np.quantile(known, QUANTILE)) if known.size else 0.0, LEAST_CODES)
    power = 10.0 ** math.floor(math.log10(high))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= high * (1 - 1e-9))


def coloured(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Colours uint8 [..., 3] of values from `low`, dark, to `high`, bright (or the other way round); NaN is ground."""
    import matplotlib

    share = np.clip((values - low) / (high - low), 0, 1)
    table = np.rint(255 * matplotlib.colormaps[COLOURS](np.arange(256))[:, :3]).astype(np.uint8)
    made = table[np.rint(255 * np.nan_to_num(share)).astype(np.intp)]
    made[np.isnan(values)] = GROUND
    return made


def panel(values: np.ndarray, low: float = 0.0, high: float | None = None, unit: str = "codes") -> np.ndarray:
    """A map of values [H, W] with a scale on its right, uint8 [H, W + ..., 3].

    For errors as they are; for SSIM give low=1, high=0 and no unit, so that what is worst is brightest.
    """
    end = top_of(values) if high is None else high
    height = values.shape[0]
    top, bottom = f"{end:g} {unit}".strip(), f"{low:g}"
    wide = max(letters(top).shape[1], letters(bottom).shape[1])
    scale = np.full((height, MARGIN_PX + BAR_PX + MARGIN_PX + wide, 3), GROUND, np.uint8)
    scale[:, MARGIN_PX : MARGIN_PX + BAR_PX] = coloured(np.linspace(end, low, height), low, end)[:, None]
    write(scale, top, 2 * MARGIN_PX + BAR_PX, 0)
    write(scale, bottom, 2 * MARGIN_PX + BAR_PX, max(0, height - letters(bottom).shape[0]))
    return np.concatenate([coloured(values, low, end), scale], axis=1)
