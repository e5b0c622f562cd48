"""Light beyond a frame sensor's range: what events carry on is right, and never contradicts the frames."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from interp.candidates.beyond import (
    ABOVE,
    AROUND_PX,
    BELOW,
    BELOW_AROUND,
    BELOW_SHARE,
    BOTTOM,
    BRIGHTEST,
    DARK,
    DARKEST,
    KEPT,
    NOISE_PX,
    TOP,
    carried,
)
from interp.light import from_ratios, to_ratios


def one(value: float) -> torch.Tensor:
    return torch.full((1, 1, 1, 1), value)


def followed(light: list[float], limits: tuple[float, float] = (0.0, 1.0)) -> list[float]:
    """What is found of the light of one pixel, of whose changes events tell all."""
    before, found, ends = None, [], torch.tensor([limits])
    for k, now in enumerate(light):
        change = torch.log(one(now) / one(light[k - 1])) if k else one(0.0)
        seen = min(max(now, limits[0]), limits[1])
        before, beyond = carried(one(seen), change, before, ends)
        inside = limits[0] + BOTTOM * (limits[1] - limits[0]) < seen < limits[0] + TOP * (limits[1] - limits[0])
        assert bool(beyond) != inside
        found.append(float(before))
    return found


@pytest.mark.parametrize("scale", [1.0, 0.3])
def test_light_that_leaves_the_range_is_followed_and_found_again(scale: float) -> None:
    light = [scale * each for each in (0.3, 0.9, 3.0, 6.0, 4.0, 0.8, 0.02, 2e-4, 1e-4, 0.3)]
    found = followed(light, (0.0, scale))
    for k, (true, made) in enumerate(zip(light, found, strict=True)):
        if k in (2, 3, 4, 7, 8):  # beyond the range, for one, two, three frames
            end, usual = (TOP, ABOVE) if k < 5 else (BOTTOM, BELOW + BELOW_SHARE + BELOW_AROUND)
            farthest = max(abs(math.log(each / end) - usual) for each in ((3.0, 6.0) if k < 5 else (2e-4, 1e-4)))
            pulled = (1 - KEPT) * (k - 1 if k < 5 else k - 6) * farthest
            assert abs(math.log(made / true)) <= pulled + 1e-5
        else:
            assert made == pytest.approx(true, rel=1e-6)


def test_what_was_never_within_begins_as_it_is_usually() -> None:
    made, beyond = carried(torch.tensor([0.1, 0.5, 0.6])[None, None, None], one(0.0), None, torch.tensor([[0.1, 0.6]]))
    assert beyond.flatten().tolist() == [True, False, True]
    deep = math.exp(BELOW + (BELOW_SHARE + BELOW_AROUND) / 3)  # (a third of the picture, and of what is around)
    assert made.flatten().tolist() == pytest.approx([(0.1 + BOTTOM * 0.5) * deep, 0.5, (0.1 + TOP * 0.5) * 4 / 3])


def test_the_more_of_a_picture_is_dark_the_darker_it_is_and_most_far_from_what_is_seen() -> None:
    found = []
    for dark in (20, 60):  # columns of 80
        frame = torch.full((1, 1, 40, 80), 0.5)
        frame[..., :dark] = 0.1
        found.append(carried(frame, torch.zeros_like(frame), None, torch.tensor([[0.1, 0.6]]))[0][0, 0, 20].log())
    assert (found[0][:16].diff().abs() < 1e-6).all() and (found[0][15:20].diff() > 0.02).all()
    torch.testing.assert_close(found[1][:16] - found[0][:16], torch.full((16,), 0.5 * BELOW_SHARE))


@given(st.lists(st.tuples(st.floats(-0.2, 1.3), st.floats(-30, 30)), min_size=1, max_size=20))
def test_frames_are_never_contradicted(steps: list[tuple[float, float]]) -> None:
    before = None
    for value, change in steps:
        before, _ = carried(one(value), one(change), before)
        made, top, bottom = float(before), TOP * (1 - 1e-6), BOTTOM * (1 + 1e-6)
        if BOTTOM < value <= BOTTOM + (1 - TOP):  # (noise, or not: what was below stays so)
            continue
        if value >= TOP:
            assert top <= made <= BRIGHTEST * (1 + 1e-6)
        elif value <= BOTTOM:
            assert DARKEST / 2 < made <= bottom
        else:
            assert made == pytest.approx(value)


def around(plane: np.ndarray, across_px: int) -> np.ndarray:
    """Means over squares around each pixel of a plane, over what there is."""
    reach, padded = across_px // 2, np.pad(plane.astype(np.float64), across_px // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1, 2 * reach + 1))
    return np.nanmean(windows, axis=(2, 3))


def slowly(frame: np.ndarray, change: np.ndarray, before: np.ndarray | None, limits: tuple[float, float]) -> Any:
    """The docstring for one grey frame [H, W]: light, and where it is beyond the range."""
    span = limits[1] - limits[0]
    bottom, top = max(limits[0] + BOTTOM * span, DARKEST), limits[0] + TOP * span
    above, low = frame >= top, frame <= bottom + (1 - TOP) * (top - bottom)
    below = (frame <= bottom) | (low & (around(frame, NOISE_PX) <= bottom + DARK * (top - bottom)))
    deep = BELOW + BELOW_SHARE * below.mean() + BELOW_AROUND * around(below, AROUND_PX)
    if before is None:  # as it is usually: a third above the top, so deep below the bottom
        before = np.where(above, top * 4 / 3, np.where(below, bottom * np.exp(deep), frame))
    nats = np.log(np.clip(before, DARKEST, BRIGHTEST)) + change
    below |= low & (nats < np.log(bottom))
    found = frame.copy()
    for place in np.argwhere(above | below):
        y, x = place
        end, usual = (top, math.log(4 / 3)) if above[y, x] else (bottom, deep[y, x])
        away = usual + KEPT * (nats[y, x] - math.log(end) - usual)
        away = max(away, 0) if above[y, x] else min(away, 0)
        found[y, x] = min(max(end * math.exp(away), DARKEST), BRIGHTEST)
    return found, above | below


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(0.0, 1.0), (0.05, 0.6), (0.0, 0.001)]), st.floats(0.1, 6))
def test_it_is_the_law_pixel_by_pixel(seed: int, limits: tuple[float, float], pace: float) -> None:
    """Of two sequences of frames of which parts are beyond the range, near its ends and far within; of each alone."""
    draw = np.random.default_rng(seed)
    span, states, found = limits[1] - limits[0], [None, None], None
    for _ in range(6):
        levels = draw.choice(
            [-0.1, 2e-4, 2e-3, 0.01, 0.4, 0.99, 1.2], (2, 1, 12, 14), p=[0.3, 0.1, 0.1, 0.1, 0.1, 0.1, 0.2]
        )
        levels[:, :, :6, :7] = 3e-4 + 0.02 * (draw.random((2, 1, 6, 7)) < 0.1)  # dark, with noise
        frame = (limits[0] + span * levels * draw.uniform(0.95, 1.05, levels.shape)).astype(np.float32)
        change = draw.normal(0, pace, levels.shape).astype(np.float32)
        found, beyond = carried(torch.from_numpy(frame), torch.from_numpy(change), found, torch.tensor([limits] * 2))
        for k in range(2):
            states[k], expected = slowly(frame[k, 0].astype(np.float64), change[k, 0], states[k], limits)
            np.testing.assert_array_equal(beyond[k, 0], expected)
            np.testing.assert_allclose(found[k, 0], states[k], rtol=1e-4)


def test_single_pixels_that_noise_lifts_from_the_bottom_are_below_it() -> None:
    torch.manual_seed(0)
    noisy = (0.005 * torch.randn(1, 1, 40, 40)).clamp(min=0)
    noisy[..., 20:] += 0.02  # what is dark, and was seen
    beyond = carried(noisy, one(0.0), None)[1][0, 0]
    assert beyond[:, 2:17].float().mean() > 0.9 and not beyond[:, 23:].any()


def test_noise_beyond_the_range_does_not_drift_off() -> None:
    # The reason that is given for `KEPT`: 5 events/s of 0.2 nat at 30 frames/s, as many up as down.
    torch.manual_seed(0)
    frame, before, spread = torch.ones(1, 1, 64, 64), None, []
    rate = torch.full_like(frame, 2.5 / 30)
    for _ in range(900):
        change = 0.2 * (torch.poisson(rate) - torch.poisson(rate))
        before, _ = carried(frame, change, before)
        spread.append(float(before.log().std()))
    assert 0.2 < spread[-1] < 0.45 and spread[-1] < 1.1 * spread[450]


def test_ratios_and_light_are_one_to_one() -> None:
    light = torch.tensor([-0.01, 0.0, 1e-6, 0.01, 1.0, 30.0], dtype=torch.float32)
    torch.testing.assert_close(from_ratios(to_ratios(light)), light, rtol=1e-5, atol=1e-9)
    assert to_ratios(torch.tensor([0.0, 1.0])).tolist() == pytest.approx([0, 1])
