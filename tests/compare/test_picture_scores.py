"""PSNR and SSIM are scikit-image's, and the worst window is the worst of all."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from vid2ev.compare.pictures import HIGHEST_DB, highest, lowest, moments, psnr, squared_error, ssim, windows


def drawn(shape: tuple[int, ...], top: int = 255) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(top)
    true = draw.integers(0, top + 1, shape)
    return np.clip(true + draw.normal(0, top / 20, shape), 0, top).round().astype(np.uint8), true.astype(np.uint8)


@pytest.mark.parametrize("shape", [(11, 11), (24, 31), (24, 31, 3), (40, 13, 1)])
@pytest.mark.parametrize("sample", [True, False])
@pytest.mark.parametrize("top", [255, 40])
def test_scores_are_those_of_scikit_image(shape: tuple[int, ...], sample: bool, top: int) -> None:
    made, true = drawn(shape, top)
    options: dict[str, Any] = {"gaussian_weights": True, "use_sample_covariance": sample, "data_range": top}
    channels = {"channel_axis": -1} if len(shape) == 3 else {}
    theirs, plane = structural_similarity(true, made, full=True, **options, **channels)
    assert ssim(made, true, top, sample) == pytest.approx(theirs, abs=1e-12)
    found = moments(made, true)
    assert found is not None
    plane = plane.mean(axis=2) if len(shape) == 3 else plane
    np.testing.assert_allclose(found.ssim_map(top, sample), plane[5:-5, 5:-5], atol=1e-12, rtol=0)
    theirs = peak_signal_noise_ratio(true, made, data_range=top)
    assert psnr(squared_error(made, true), top) == pytest.approx(theirs, abs=1e-12)


def test_what_is_not_defined_is_no_number() -> None:
    flat = np.full((16, 16, 3), 127, np.uint8)
    assert psnr(squared_error(flat, flat)) == HIGHEST_DB
    assert math.isnan(psnr(np.empty(0))) and math.isnan(psnr(squared_error(flat, flat), 0.0))
    assert ssim(flat, flat) == pytest.approx(1, abs=1e-12)
    assert math.isnan(ssim(flat, flat, 0.0)) and math.isnan(ssim(flat[:8], flat[:8]))
    assert 0 < ssim(flat, np.zeros_like(flat)) < 0.01


def test_the_worst_window_is_the_worst_of_all() -> None:
    draw = np.random.default_rng(0)
    plane = draw.integers(0, 3 * 255**2, (30, 45)).astype(float)
    means = sliding_window_view(plane, (9, 9)).sum((2, 3)) / 81
    np.testing.assert_array_equal(windows(plane, 9), means)  # sums of whole numbers are exact
    worst, best = highest(plane, 9), lowest(plane, 9)
    assert (worst.value, best.value) == (means.max(), means.min())
    assert means[worst.y, worst.x] == worst.value and means[best.y, best.x] == best.value


def test_an_error_is_found_where_it_is() -> None:
    plane = np.zeros((120, 200))
    plane[110, 150] = 1.0
    worst = highest(plane)
    assert worst.value == 1 / 99**2  # exactly: nothing is left over of other windows
    assert (worst.x, worst.y) == (52, 12)  # the first, from above and from the left, that holds it
    assert highest(plane[:50, :60]) == (0.0, 0, 0)  # a window no larger than the picture
