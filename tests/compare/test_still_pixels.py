"""Pixels that see still light against known rates, and those of chance."""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def still_pixels(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(EXAMPLES)
    return importlib.import_module("still_pixels")


def test_rates_against_light(still_pixels: ModuleType) -> None:
    light = np.tile(np.linspace(0.01, 0.99, 200), (150, 1))
    light[:, :20] = np.nan
    random = np.random.default_rng(3)
    seconds, rate = 2.0, 4.0 - 3.0 * np.nan_to_num(light)
    counts = random.poisson(np.stack([0.25 * rate, 0.75 * rate]) * seconds)
    rows = still_pixels.rates_by_light(counts, light, seconds, np.linspace(0, 1, 6))
    assert sum(row.pixels for row in rows) == 180 * 150
    for row in rows:
        assert abs(row.rate_hz - (4 - 3 * row.light)) < 5 * row.error_hz
        assert row.error_hz == pytest.approx(math.sqrt(row.rate_hz / (row.pixels * seconds)))
        assert row.on_share == pytest.approx(0.75, abs=0.03)
    assert still_pixels.rates_by_light(counts, light, seconds, np.array([2.0, 3.0])) == []


@pytest.mark.parametrize("mean", [0.01, 0.5, 8.0, 60.0])
def test_of_pixels_of_chance_none_is_hot_and_hot_ones_are_found(still_pixels: ModuleType, mean: float) -> None:
    counts = np.random.default_rng(5).poisson(mean, (200, 300))
    assert np.count_nonzero(counts >= still_pixels.hot_from(counts)) <= 3
    counts[::50, ::50] = 40 + 5 * int(mean)
    assert 24 <= np.count_nonzero(counts >= still_pixels.hot_from(counts)) <= 27


def test_the_hot_of_silent_pixels(still_pixels: ModuleType) -> None:
    assert still_pixels.hot_from(np.zeros((4, 4), int)) == 1
    assert still_pixels.hot_from(np.array([[0, 0, 0, 9]])) <= 9
