"""Scores are scikit-image's, and parts of an image are told apart."""

from __future__ import annotations

import math

import pytest
import torch
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from interp.train.fit import Outcome
from interp.train.scores import Scores, rounded, scores
from interp.train.told import table
from vid2ev.compare.pictures import HIGHEST_DB


@pytest.mark.parametrize("size", [(11, 11), (24, 31)])
def test_psnr_and_ssim_are_those_of_scikit_image(size: tuple[int, int]) -> None:
    truth = torch.rand(3, 3, *size)
    made = truth + 0.05 * torch.randn(3, 3, *size)
    a, b = rounded(made), rounded(truth)
    for x, y, own in zip(a, b, scores(made, truth, truth[0], truth[0]), strict=True):
        theirs = structural_similarity(
            y, x, data_range=255, channel_axis=-1, gaussian_weights=True, use_sample_covariance=False
        )
        assert own.ssim == pytest.approx(theirs, abs=1e-12)  # the same sums in float64
        assert own.psnr == pytest.approx(peak_signal_noise_ratio(y, x, data_range=255), abs=1e-9)


def test_codes_are_rounded_as_8_bits_are() -> None:
    codes = torch.tensor([-1.0, 0.0, 0.4999 / 255, 0.501 / 255, 1.0, 2.0])
    assert rounded(codes[None, None, None]).ravel().tolist() == [0, 0, 0, 1, 255, 255]


def test_moving_and_static_pixels_are_scored_apart() -> None:
    frame = torch.full((3, 16, 16), 0.4)
    truth = frame.clone()[None]
    truth[:, 0, :8] += 11 / 255  # moves, by one channel
    made = truth.clone()
    made[:, :, :8] += 10 / 255
    found = scores(made, truth, frame, frame)[0]
    assert found.static == HIGHEST_DB
    assert found.moving == pytest.approx(20 * math.log10(255 / 10))
    assert found.psnr == pytest.approx(20 * math.log10(255 / 10) + 10 * math.log10(2))


def test_what_is_not_there_is_left_out_of_means() -> None:
    one, other = Scores(30.0, 0.9, math.nan, 30.0), Scores(20.0, 0.8, 20.0, math.nan)
    assert Scores.mean([one, other]) == Scores(25.0, pytest.approx(0.85), 20.0, 30.0)
    assert "static" not in other.named("x.")
    small = scores(torch.zeros(1, 1, 8, 8), torch.zeros(1, 1, 8, 8), torch.zeros(1, 8, 8), torch.zeros(1, 8, 8))[0]
    assert math.isnan(small.ssim) and small.psnr == HIGHEST_DB


@pytest.mark.parametrize(("network", "parts"), [("rrin", "moving static"), ("hdr", "above below")])
def test_a_table_says_what_its_columns_are_of(network: str, parts: str) -> None:
    """Of HDR they are parts of what is beyond the range of the frames."""
    outcome = Outcome(7, 7, 0, 7, {"scenes": {"network": Scores(30.0, 0.9, 28.0, 32.0)}})
    head, row = table(outcome, network).splitlines()
    assert head.split() == ["scenes", "PSNR", "SSIM", *parts.split()] and row.split()[0] == "network"
    assert len(head) == len(row)
