"""The protocol is that of the field: its script's numbers, from pictures on disk."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from footage_made import pictures, write_hsergb, write_predictions
from skimage.metrics import structural_similarity

from interp.evaluate.protocol import Protocol, range_of
from interp.evaluate.run import evaluate
from vid2ev import UsageError
from vid2ev.compare.pictures import HIGHEST_DB


def scores_of_the_field(truth: np.ndarray, made: np.ndarray, skip: int) -> dict[int, tuple[float, float]]:
    """PSNR and SSIM of the frames that are not key frames, as rpg_event_based_frame_interpolation_evaluation calls
    scikit-image, but for a range that is no 8-bit number."""
    found = {}
    for k, (true, picture) in enumerate(zip(truth, made, strict=True)):
        if k % (skip + 1) == 0:
            continue
        peak = float(true.max()) - float(true.min())
        error = np.mean((true.astype(float) - picture.astype(float)) ** 2)
        ssim = structural_similarity(true, picture, data_range=peak, channel_axis=-1, gaussian_weights=True)
        found[k] = 10 * math.log10(peak**2 / error), ssim
    return found


@pytest.mark.parametrize("top", [256, 90])
def test_scores_are_those_of_the_field(tmp_path: Path, top: int) -> None:
    truth = pictures(17, top=top)
    made = np.clip(truth + np.random.default_rng(3).normal(0, 6, truth.shape), 0, 255).round().astype(np.uint8)
    write_hsergb(tmp_path / "data" / "seq", truth)
    write_predictions(tmp_path / "theirs" / "seq", made)
    options: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"]}
    found = evaluate([str(tmp_path / "data")], tmp_path / "report", **options)
    expected = scores_of_the_field(truth, made, 7)
    assert [8 * row.group + row.position for row in found.rows] == list(expected)
    for row, (k, (psnr, ssim)) in zip(found.rows, expected.items(), strict=True):
        assert row.psnr == pytest.approx(psnr, abs=1e-9) and row.ssim == pytest.approx(ssim, abs=1e-12)
        assert row.psnr_255 == pytest.approx(psnr + 20 * math.log10(255 / range_of(truth[k])), abs=1e-9)
    pooled = found.summary["methods"]["theirs"]["pooled"]["psnr"]
    values = [psnr for psnr, _ in expected.values()]
    assert (pooled["mean"], pooled["std"]) == pytest.approx((np.mean(values), np.std(values)), abs=1e-9)


def test_a_range_of_255_does_not_overflow() -> None:
    true = np.zeros((16, 16, 3), np.uint8)
    true[0, 0] = 255
    assert range_of(true) ** 2 == 65025


def test_the_truth_itself_is_perfect_and_counted_as_such(tmp_path: Path) -> None:
    truth = pictures(9)
    write_hsergb(tmp_path / "seq", truth)
    write_predictions(tmp_path / "same" / "seq", truth)
    found = evaluate([str(tmp_path / "seq")], tmp_path / "report", baselines=(), predictions=[tmp_path / "same"])
    assert found.summary["methods"]["same"]["perfect"] == len(found.rows) == 7
    for row in found.rows:
        assert row.psnr == row.psnr_255 == row.patch_psnr == HIGHEST_DB
        assert row.ssim == pytest.approx(1) and row.patch_ssim == pytest.approx(1)


@pytest.mark.parametrize(
    ("skip", "insert", "positions", "picked"),
    [
        (7, 7, range(1, 8), range(7)),
        (7, 3, (2, 4, 6), range(3)),
        (7, 15, range(1, 8), range(1, 15, 2)),
        (5, 1, (3,), (0,)),
    ],
)
def test_frames_are_scored_at_whose_place_one_was_made(skip: int, insert: int, positions: Any, picked: Any) -> None:
    protocol = Protocol(skip, insert)
    assert protocol.positions == tuple(positions) and protocol.picked == list(picked)
    targets = protocol.targets(np.arange(skip + 2) * 1000)
    np.testing.assert_allclose(targets[protocol.picked], np.array(protocol.positions) / (skip + 1), atol=1e-15)
    assert protocol.steps % (skip + 1) == 0 and protocol.steps >= 32


def test_frames_are_rebuilt_at_their_own_times_or_evenly() -> None:
    times = np.array([100, 110, 130, 190, 200])
    np.testing.assert_allclose(Protocol(3, 3).targets(times), [0.1, 0.3, 0.9])
    np.testing.assert_allclose(Protocol(3, 3, "even").targets(times), [0.25, 0.5, 0.75])
    np.testing.assert_allclose(Protocol(3, 1).targets(times), [0.5])


def test_codes_are_rounded_or_truncated() -> None:
    images = torch.tensor([-1.0, 0.4 / 255, 0.6 / 255, 254.6 / 255, 1.0, 2.0]).reshape(1, 1, 1, -1)
    assert Protocol().coded(images).ravel().tolist() == [0, 0, 1, 255, 255, 255]
    assert Protocol(rounding="truncate").coded(images).ravel().tolist() == [0, 0, 0, 254, 255, 255]


def test_what_cannot_be_scored_is_refused() -> None:
    with pytest.raises(UsageError, match="none of the frames made"):
        Protocol(7, 4)
    with pytest.raises(UsageError, match="at least 1"):
        Protocol(0, 1)


@pytest.mark.parametrize(
    "settings", [{"skip": 0}, {"skip": 7.5}, {"insert": "7"}, {"times": "evenly"}, {"rounding": "floor"}]
)
def test_settings_that_are_none_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=f"{next(iter(settings))} .*: expected"):
        Protocol(**settings)


def test_what_is_asked_for_is_a_list_and_a_limit_a_number(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "seq", pictures(9))
    for name in ("networks", "baselines", "predictions"):
        with pytest.raises(UsageError, match="linear: expected a list"):
            evaluate([str(tmp_path / "seq")], tmp_path / "report", **{name: "linear"})
    for alone in (tmp_path / "seq", str(tmp_path / "seq")):
        with pytest.raises(UsageError, match="seq: expected a list"):
            evaluate(alone, tmp_path / "report")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="no data set"):
        evaluate([], tmp_path / "report", baselines=["linear"])
    for limit in (0, -1, 1.5, True):
        with pytest.raises(UsageError, match=rf"limit {limit}: expected a whole number"):
            evaluate([tmp_path / "seq"], tmp_path / "report", baselines=["linear"], limit=limit)  # type: ignore[arg-type]
    for name in ("protocol", "simulated"):
        with pytest.raises(UsageError, match=f"{name} 'clean': expected a {name.title()}"):
            evaluate([tmp_path / "seq"], tmp_path / "report", baselines=["linear"], **{name: "clean"})
    assert len(evaluate([tmp_path / "seq"], tmp_path / "report", baselines=["linear"], limit=1).rows) == 7
