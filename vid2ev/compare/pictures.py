"""How alike two pictures are: PSNR and SSIM, of whole pictures, and of the worst of all windows in them.

    PSNR = 10 lg(peak^2 / MSE)                                                                  at most 100 dB
    SSIM = (2 m_x m_y + C1) (2 s_xy + C2) / ((m_x^2 + m_y^2 + C1) (s_x^2 + s_y^2 + C2))         C = (0.01 peak)^2,
                                                                                                    (0.03 peak)^2
m, s^2 and s_xy are means, variances and covariance under a Gaussian window of sigma 1.5 px, 11 x 11, where it lies
within the picture.  `peak` is 255, or the range of the true picture, as the Time Lens protocol has it; with `sample`,
variances and covariances are larger by 121 / 120, as that of a sample is.

Everything is float64: pictures are whole numbers, of which differences, squares and sums over windows are exact then.
Both are those of scikit-image (`structural_similarity` with gaussian_weights, and use_sample_covariance=sample).

Source of SSIM: Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli (2004), "Image quality assessment: from error visibility to
structural similarity", IEEE Trans. Image Processing 13(4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from vid2ev.compiling.cache import cached

PEAK = 255.0
HIGHEST_DB = 100.0  # of pictures without an error
SIGMA_PX, RADIUS_PX = 1.5, 5  # 3.5 sigma, as scikit-image cuts it
WINDOW_PX = 99  # of the worst window
MOVED = 10  # codes


class Worst(NamedTuple):
    """The worst window: the mean in it, and its left and top [px]."""

    value: float
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class Moments:
    """What SSIM is made of: means under the window of x, y, x^2 + y^2 and x y, each [H - 10, W - 10, C]."""

    x: np.ndarray
    y: np.ndarray
    squares: np.ndarray
    product: np.ndarray

    def ssim_map(self, peak: float = PEAK, sample: bool = False) -> np.ndarray:
        """SSIM around each pixel, mean over channels, [H - 10, W - 10]; NaN where there is no range."""
        taps = (2 * RADIUS_PX + 1) ** 2
        found = np.full(self.x.shape[:2], np.nan)
        if peak > 0:
            _ssim(self.x, self.y, self.squares, self.product, peak, taps / (taps - 1) if sample else 1.0, found)
        return found


def squared_error(made: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Squares of differences of codes, float64, of the shape of the pictures."""
    difference = np.subtract(made, true, dtype=np.float64)
    return np.square(difference, out=difference)


def moving(true: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Which pixels [H, W] of a picture move: those more than 10 codes away from any of the key frames around it, in any
    channel; uint8 [H, W, C] and [N, H, W, C]."""
    moves = np.zeros(true.shape[:2], np.bool_)
    for key in keys:
        away = np.maximum(true, key) - np.minimum(true, key)  # (8 bits: there is no sign, and none is needed)
        for channel in np.moveaxis(away, -1, 0):
            moves |= channel > MOVED
    return moves


def psnr(squared: np.ndarray, peak: float = PEAK) -> float:
    """PSNR [dB] of squared errors; NaN of none, and against a range of 0."""
    return psnr_of_mean(float(squared.mean()), peak) if squared.size else math.nan


def psnr_of_mean(mean: float, peak: float = PEAK) -> float:
    """PSNR [dB] of a mean squared error; NaN against a range of 0."""
    if not peak > 0 or math.isnan(mean):
        return math.nan
    return min(10 * math.log10(peak**2 / mean), HIGHEST_DB) if mean else HIGHEST_DB


def moments(made: np.ndarray, true: np.ndarray) -> Moments | None:
    """The moments of pictures [H, W] or [H, W, C]; None of those smaller than the window."""
    if min(true.shape[:2]) <= 2 * RADIUS_PX:
        return None
    whole = np.empty((4, *true.shape[:2], true.size // (true.shape[0] * true.shape[1])))
    x, y = (np.ascontiguousarray(each).reshape(whole.shape[1:]) for each in (made, true))
    _products(x, y, whole)
    return Moments(*map(_blurred, whole))


def ssim(made: np.ndarray, true: np.ndarray, peak: float = PEAK, sample: bool = False) -> float:
    """SSIM of pictures of codes [H, W] or [H, W, C], mean over channels; NaN of those smaller than the window."""
    found = moments(made, true)
    return math.nan if found is None else float(found.ssim_map(peak, sample).mean())


def windows(plane: np.ndarray, side: int = WINDOW_PX) -> np.ndarray:
    """Means of a plane [H, W] in all windows of side x side pixels, [H - side + 1, W - side + 1], at a stride of 1.

    A window is no larger than the plane.  Sums of whole numbers are exact.
    """
    down, across = (min(side, length) for length in plane.shape)
    sums = cv2.integral(np.ascontiguousarray(plane, np.float64), sdepth=cv2.CV_64F)
    inside = sums[down:, across:] - sums[:-down, across:] - sums[down:, :-across] + sums[:-down, :-across]
    return inside / (down * across)


def highest(plane: np.ndarray, side: int = WINDOW_PX) -> Worst:
    """The window in which the mean of a plane [H, W], such as the squared error, is highest; the first of several."""
    means = windows(plane, side)
    y, x = np.unravel_index(int(np.argmax(means)), means.shape)
    return Worst(float(means[y, x]), int(x), int(y))


def lowest(plane: np.ndarray, side: int = WINDOW_PX) -> Worst:
    """The window in which the mean of a plane [H, W], such as SSIM, is lowest; the first of several."""
    found = highest(-plane, side)
    return found._replace(value=-found.value)


def _blurred(plane: np.ndarray) -> np.ndarray:
    """Means [H - 10, W - 10, C] under the window, where it lies within the picture."""
    blurred = cv2.sepFilter2D(plane, cv2.CV_64F, _WINDOW, _WINDOW, borderType=cv2.BORDER_REPLICATE)
    return blurred.reshape(plane.shape)[RADIUS_PX:-RADIUS_PX, RADIUS_PX:-RADIUS_PX]


@cached
def _products(made, true, out):  # type: ignore[no-untyped-def]
    for i in range(made.shape[0]):
        for j in range(made.shape[1]):
            for c in range(made.shape[2]):
                x, y = np.float64(made[i, j, c]), np.float64(true[i, j, c])
                out[0, i, j, c], out[1, i, j, c] = x, y
                out[2, i, j, c], out[3, i, j, c] = x * x + y * y, x * y


@cached
def _ssim(mean_x, mean_y, squares, product, peak, scale, out):  # type: ignore[no-untyped-def]
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    channels = mean_x.shape[2]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = 0.0
            for c in range(channels):
                x, y = mean_x[i, j, c], mean_y[i, j, c]
                # (a sum of variances may come out below 0, by rounding)
                variances = max(squares[i, j, c] - (x * x + y * y), 0.0)
                covariance = product[i, j, c] - x * y
                above = (2 * x * y + c1) * (2 * scale * covariance + c2)
                total += above / ((x * x + y * y + c1) * (scale * variances + c2))
            out[i, j] = total / channels


def _window() -> np.ndarray:
    falling = np.exp(-0.5 * (np.arange(-RADIUS_PX, RADIUS_PX + 1) / SIGMA_PX) ** 2)
    return falling / falling.sum()


_WINDOW = _window()
