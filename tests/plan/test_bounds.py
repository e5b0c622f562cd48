"""Bounds on distances are what the theory of `bounds.scene` says of scenes put together by hand, and what relays do."""

from __future__ import annotations

import math
from dataclasses import fields
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from vid2ev.bounds.distance import (
    EVEN,
    PIXELS_DIFFER,
    Left,
    added,
    bare,
    delayed,
    elsewhere,
    later,
    off_by,
    steeper,
    together,
    unlike,
)
from vid2ev.bounds.scene import DISTANCE_TAU_S, OF_BARE, OF_TILES, QUARTER_EDGES, SPREAD, Scene
from vid2ev.compare.comparison import compare
from vid2ev.physics.photoreceptor_omission import _reach_s, _second_reach_s
from vid2ev.stream import Events

THETA = 0.25
TRAVEL, PUSHED_S, TURNS = 2.0, 0.008, 3.0  # of the first tile: 8 events


def scene(tiles: int = 1, **known: Any) -> Scene:
    """A scene of which nothing is known but this, all of it in the first of its tiles."""
    quarters = len(QUARTER_EDGES) - 1
    found: dict[str, Any] = {each.name: 0.0 for each in fields(Scene)} | {"size": (64, 32 * tiles), "threshold": THETA}
    found |= {name: np.zeros(tiles) for name in (*OF_TILES, *OF_BARE)}
    found |= {name: np.zeros((2, quarters)) for name in (*SPREAD, "by_bare")}
    for name, value in ({"travel": TRAVEL, "pushed_s": PUSHED_S, "turns": TURNS} | known).items():
        if name in (*OF_TILES, *OF_BARE):
            found[name][0] = value
        else:
            found[name] = value
    return Scene(**found)


def spread(*parts: tuple[float, float]) -> np.ndarray:
    """Travel [nat], and of each travel what it is spread by."""
    made = np.zeros((2, len(QUARTER_EDGES) - 1))
    for k, (travel, by) in enumerate(parts):
        made[:, 10 * k] = travel, travel * by
    return made


def near(events: float) -> np.ndarray:
    """Travel that has so many events near it."""
    made = np.zeros((2, len(QUARTER_EDGES) - 1))
    made[:, 20] = TRAVEL, TRAVEL * events
    return made


@pytest.mark.parametrize("tiles", [1, 3])
def test_signals_that_are_off_differ_while_they_are_pushed_and_from_their_turns_on(tiles: int) -> None:
    def bound(error: float, **how: Any) -> float:
        return off_by(seen, np.full(tiles, error * THETA), **{"echoes": False} | how)

    seen = scene(tiles)
    once = THETA * (PUSHED_S / DISTANCE_TAU_S + TURNS) / TRAVEL  # (of signals that are a threshold apart)
    for error in (1e-6, 0.1, 0.4, 0.6, 0.99):
        assert bound(error, one_way=True) == pytest.approx(error * once)
        assert bound(error) == pytest.approx(error * once * (1 + min(1, 2 * error)))
    for levels, error in ((2, 1.0), (2, 1.9), (4, 3.5)):  # (between two signals, at most)
        assert bound(error, one_way=True) == pytest.approx(levels * error * once)
        assert bound(error) == pytest.approx(2 * levels * error * once)
    busy = scene(tiles, pushed_s=100 * PUSHED_S)
    assert off_by(busy, np.full(tiles, 3.5 * THETA), echoes=False) == pytest.approx(4 * 4**2)


def test_a_part_of_an_error_costs_a_part_where_it_is() -> None:
    """Of what there is of it while pixels are pushed and at turns, on average; and of other numbers of levels."""
    error = np.array([0.2, 0.1]) * THETA
    seen = scene(2, by_turns=spread((0.5, 1)))
    pushed, turned = 0.2 * THETA * PUSHED_S / DISTANCE_TAU_S / TRAVEL, 0.2 * THETA * TURNS / TRAVEL
    for of_pushed, of_turned in ((1.0, 0.0), (0.0, 1.0), (0.3, 0.8)):
        parts = np.array([of_pushed, 9.0]), of_turned  # (of each tile, or of all)
        wanted = of_pushed * pushed + of_turned * turned
        assert off_by(seen, error, echoes=False, one_way=True, parts=parts) == pytest.approx(wanted)
        found = off_by(seen, error, echoes=True, one_way=True, parts=parts)
        assert found == pytest.approx(wanted + 0.5 * 0.2 / TRAVEL)  # (what is frozen may be all of it)
    for levels in (1.0, 1.3, 5.0):
        found = off_by(seen, 7.5 * error, echoes=False, one_way=True, levels=levels)
        assert found == pytest.approx(min(7.5 * levels * (pushed + turned), 4 * levels**2))


def test_what_comes_after_a_disagreement_is_counted_once_for_each_that_may_have_been() -> None:
    """Of `by_turns`: travel, and that times the turns before it; never more than all of it."""
    seen = scene(2, by_turns=spread((0.5, 1), (0.3, 4), (0.2, 100)))
    plain = off_by(seen, np.array([0.1, 0.2]) * THETA, echoes=False)
    echo = (0.5 * 0.2 + 0.3 * 0.8 + 0.2) / TRAVEL  # (by the largest error of all tiles)
    assert off_by(seen, np.array([0.1, 0.2]) * THETA, echoes=True) == pytest.approx(plain + echo)
    assert elsewhere(seen) == pytest.approx(1.0 / TRAVEL)


@pytest.mark.parametrize("tiles", [1, 3])
def test_bends_are_rounded_off_and_turns_freeze(tiles: int) -> None:
    nothing = np.zeros(tiles)
    of_first = np.arange(tiles) == 0
    seen = scene(tiles, bend=300.0)
    variance_s2, frozen = 1e-7, 0.02
    area = variance_s2 * 300.0 / 2
    none = np.zeros_like(seen.by_turns)
    often = PIXELS_DIFFER * area / (PUSHED_S * THETA)
    bent = area / DISTANCE_TAU_S * (1 + 2 * often) / TRAVEL
    assert 0.01 < often < 0.5
    assert delayed(seen, variance_s2 * of_first, nothing, none) == pytest.approx(bent)
    often = PIXELS_DIFFER * frozen / (TURNS * THETA)
    turned = frozen * (1 + 2 * often) / TRAVEL
    assert 0.01 < often < 0.5
    assert delayed(seen, nothing, frozen * of_first, none) == pytest.approx(turned)
    both = PIXELS_DIFFER * (area / (PUSHED_S * THETA) + frozen / (TURNS * THETA))
    sum_ = (area / DISTANCE_TAU_S + frozen) * (1 + min(1.0, 2 * both)) / TRAVEL
    assert delayed(seen, variance_s2 * of_first, frozen * of_first, none) == pytest.approx(sum_)
    large = 100.0 * frozen
    assert delayed(seen, nothing, large * of_first, none) == pytest.approx(2 * large / TRAVEL)
    after = spread((0.5, 0.1 * THETA), (0.3, 2 * THETA))
    assert delayed(seen, nothing, nothing, after) == pytest.approx((0.05 + 0.3) / TRAVEL)
    steep = delayed(seen, nothing, nothing, none, steep_nat_s=3e-5, steep_nat=0.01)
    assert steep == pytest.approx(2 * (3e-5 / DISTANCE_TAU_S + 0.01) / TRAVEL)


def test_bends_are_left_in_memories_that_jump() -> None:
    """Of events at other times, of those at turns, and of those after these: by r slope / theta [nat/ms^2]."""
    stir_s2 = 2e-8  # s^2: 0.02 ms^2
    apart, turns, before = spread((0.4, 3e-3)), spread((0.6, 0.5)), spread((0.2, 2.0))
    none = np.zeros_like(apart)
    strays = {"by_strays": apart, "by_strays_at_turns": turns, "by_strays_before": before}
    seen = scene(by_stirs=apart, by_stirs_at_turns=turns, by_stirs_before=before, **strays)
    stir_ms2 = 0.02
    at_times = 0.4 * 3e-3 * stir_ms2 / DISTANCE_TAU_S
    at_turns, after = 0.6 * 0.5 * stir_ms2 / THETA, 0.2 * 2.0 * stir_ms2 / THETA
    share = 0.5 * stir_ms2 / THETA
    wanted = ((1 + 2 * share) * (at_times + at_turns) + after) / TRAVEL
    for left in (Left(stir_s2, 1e9, 0.0), Left(0.0, 0.0, stir_s2)):
        assert delayed(seen, np.zeros(1), np.zeros(1), none, left=left) == pytest.approx(wanted)
    both = delayed(seen, np.zeros(1), np.zeros(1), none, left=Left(stir_s2, 1e9, stir_s2))
    assert both == pytest.approx(2 * wanted)


def test_what_many_bends_leave_goes_no_farther_than_the_root_of_their_squares() -> None:
    """Of numbers by the root of r^2 slope / theta [nat/ms^1.5]; or the sum of all, if that is less."""
    variance_s2, reach_s = 2e-8, 5e-5  # 0.02 ms^2 and 0.05 ms
    stirs, apart, turns, before = spread((9.0, 9.0)), spread((0.4, 3e-3)), spread((0.6, 0.5)), spread((0.2, 2.0))
    strays = {"by_strays": apart, "by_strays_at_turns": turns, "by_strays_before": before}
    seen = scene(by_stirs=stirs, by_stirs_at_turns=stirs, by_stirs_before=stirs, **strays)
    nat = math.sqrt(EVEN * 0.02 * 0.05)
    at_times, at_turns, after = 0.4 * 3e-3 * nat / DISTANCE_TAU_S, 0.6 * 0.5 * nat / THETA, 0.2 * 2.0 * nat / THETA
    wanted = ((1 + 2 * 0.5 * nat / THETA) * (at_times + at_turns) + after) / TRAVEL
    none = np.zeros_like(apart)
    found = delayed(seen, np.zeros(1), np.zeros(1), none, left=Left(variance_s2, reach_s, 0.0))
    assert found == pytest.approx(wanted)
    seen = scene(by_stirs=0.1 * apart, by_stirs_at_turns=none, by_stirs_before=none, **strays)
    found = delayed(seen, np.zeros(1), np.zeros(1), none, left=Left(variance_s2, 1e9, 0.0))
    assert found == delayed(seen, np.zeros(1), np.zeros(1), none, left=Left(0.0, 0.0, variance_s2))


def ramp(t: np.ndarray, *poles: float) -> np.ndarray:
    """What poles, none or two that differ, make of light that goes up by t from 0 on; delayed by others before."""
    if not poles:
        return np.maximum(t, 0.0)
    first, second = poles
    after = np.maximum(t, 0.0)
    left = first**2 * np.exp(-after / first) - second**2 * np.exp(-after / second)
    return np.where(t > 0.0, after - first - second + left / (first - second), 0.0)


@pytest.mark.parametrize("ratio", [0.02, 0.1, 0.3, 0.999, 3.0, 20.0])
def test_what_a_bend_leaves_is_narrow(ratio: float) -> None:
    """Of both poles beside their mean delay, and of the second behind the first beside its own: the integral of its
    square is no more than `EVEN` of reach times its integral, variance / 2."""
    t, step = np.linspace(0.0, 40 * max(1.0, ratio), 400_001, retstep=True)
    both = ramp(t, 1.0, ratio) - ramp(t - 1.0 - ratio)
    second = ramp(t, 1.0, ratio) - ramp(t - ratio, 1.0, 1e-9)
    reaches = _reach_s(1.0, ratio), _second_reach_s(np.array(1.0), ratio)
    for left, variance, reach in zip((both, second), (1 + ratio**2, ratio**2), reaches, strict=True):
        assert left.min() > -1e-6 and left.max() <= 1.001 * reach
        assert left.sum() * step == pytest.approx(variance / 2, rel=0.01)
        assert (left**2).sum() * step <= EVEN * reach * variance / 2


@pytest.mark.parametrize("share", [0.31, 1.0, 1.9, 17.0])
def test_several_levels_between_two_signals_count_squared(share: float) -> None:
    """At a phase that is even there are floor(x) or one more of them: what that adds to x, by the edges of quarters."""
    phases = (np.arange(4096) + 0.5) / 4096
    for k in np.flatnonzero((share * QUARTER_EDGES > 0.5) & (share * QUARTER_EDGES < 40)):
        felt, levels = np.zeros((2, len(QUARTER_EDGES) - 1)), share * QUARTER_EDGES[k]
        felt[:, k - 1] = 1.0, 7.0
        exact, found = np.mean(np.floor(levels + phases) ** 2) / levels - 1.0, steeper(felt, share)
        assert found == 0.0 if levels <= 1 else exact - 1e-3 <= found <= min(exact + 0.26, np.floor(levels))


def test_events_that_are_late_cost_as_much_of_tau() -> None:
    seen = scene(2)
    for late_s in (1e-7, 1e-5):
        often = PIXELS_DIFFER * late_s * TRAVEL / (PUSHED_S * THETA)
        wanted = (1 + min(1, 2 * often)) * late_s / DISTANCE_TAU_S
        assert later(seen, late_s, np.ones(2)) == pytest.approx(wanted)
    assert later(seen, 1e-9, np.array([3.0, 9.0])) == pytest.approx(1e-6, rel=0.01)  # (no denser than `bunched`)
    dense = scene(2, by_slope=near(7.0))
    assert later(dense, 1e-9, np.array([3.0, 9.0])) == pytest.approx(3e-6, rel=0.01)
    assert later(dense, 1e-9, np.array([20.0, 9.0])) == pytest.approx(8e-6, rel=0.01)


def test_recordings_with_nothing_in_common_are_as_far_apart_as_their_events_are_dense() -> None:
    seen = scene(2, by_slope=near(0.6), bend_at_turns=50.0)
    assert seen.bunched == pytest.approx(1.6)
    assert unlike(seen, 1.6, 0.0) == pytest.approx(1.6) and unlike(seen, 1.6) == pytest.approx(3.2)
    assert unlike(seen, 1.5, 0.01) == pytest.approx(1.5 * (1 + 50.0 * 0.01 / TRAVEL))
    assert unlike(seen, 1.6, np.array([0.01, 5.0])) == pytest.approx(1.6 * (1 + 50.0 * 0.01 / TRAVEL))


def test_light_without_a_shading_is_apart_for_a_while_and_from_turns_on() -> None:
    apart, frozen = 2e-5, 0.03
    known = {"bare_apart": apart, "bare_frozen": frozen, "bare_travel": 3.0, "by_bare": spread((0.5, 0.1 * THETA))}
    seen = scene(2, **known)
    often = PIXELS_DIFFER * (apart / PUSHED_S + frozen / TURNS) / THETA
    wanted = (1 + 2 * often) * (apart / DISTANCE_TAU_S + frozen) / (0.5 * (TRAVEL + 3.0))
    assert often < 0.5 and bare(seen, echoes=False) == pytest.approx(wanted)
    assert bare(seen, echoes=True) == pytest.approx(wanted + 0.05 / TRAVEL)
    far = scene(2, **known | {"bare_apart": 1.0})
    assert bare(far, echoes=False) == pytest.approx(8.0)  # (4 for each event of either)
    assert bare(scene(2, travel=0.0), echoes=True) == 0.0
    assert bare(scene(2, travel=0.0, **known), echoes=True) > 0.0


def test_of_scenes_in_which_nothing_moves_nothing_is_changed() -> None:
    still, error = scene(2, travel=0.0), np.ones(2)
    assert (
        off_by(still, error, echoes=True)
        == delayed(still, error, error, still.by_turns, left=Left(1.0, 1.0, 1.0))
        == 0.0
    )
    assert later(still, 1.0, error) == unlike(still, 9.0) == elsewhere(still) == 0.0


def test_noise_that_comes_or_goes_costs_half_an_event_each() -> None:
    """Of van Rossum's distance, beside events that are the same; and roots add up."""
    t = np.arange(0, 3_000_000, 100_000)
    zeros = np.zeros(len(t), np.uint16)
    events = Events(t, zeros, zeros, np.ones(len(t), np.uint8))
    few = events.select(t % 300_000 == 0)
    distance = compare(events, few, (1, 1)).distance
    assert added(len(few), len(events) - len(few), 0.0) == pytest.approx(distance, rel=1e-6)
    assert added(len(few), 20, 0.125) == pytest.approx(0.125 + distance, rel=1e-6)
    assert added(5.0, 0.0, 0.125) == 0.0
    assert together(0.01, 0.04, 0.25) == pytest.approx(0.64) and together() == 0.0


def relays(signal: np.ndarray, levels: np.ndarray) -> Events:
    """The events of pixels on one signal [nat, a sample a microsecond]: each goes on from its own level."""
    t, x, p = [], [], []
    for pixel, level in enumerate(levels):
        here, memory = 0, float(level)
        while True:
            away = np.abs(signal[here:] - memory) >= THETA - 1e-12
            if not away.any():
                break
            here += int(np.argmax(away))
            up = signal[here] > memory
            memory += THETA if up else -THETA
            t.append(here), x.append(pixel), p.append(up)
    order = np.argsort(t, kind="stable")
    y = np.zeros(len(t), np.uint16)
    return Events(np.array(t)[order], np.array(x, np.uint16)[order], y, np.array(p, np.uint8)[order])


@pytest.mark.parametrize("legs", [1, 5])
def test_relays_on_two_signals_are_as_far_apart_as_is_said(legs: int) -> None:
    """One is a little above the other, from soon after their beginning on; on average over the phases."""
    error, slope, long_us = 0.04 * THETA, 2e-4, 20_000  # nat/us: an event each 1250 us
    ends = np.cumsum([0.0, *(slope * long_us * (-1) ** k for k in range(legs))])
    signal = np.interp(np.arange(legs * long_us + 1), np.arange(legs + 1) * long_us, ends)
    other = signal + error * np.minimum(np.arange(len(signal)) / 200, 1)
    levels = (np.arange(400) + 0.5) / 400 * THETA - THETA / 2
    found = compare(relays(signal, levels), relays(other, levels), (len(levels), 1)).distance
    travel = sum(abs(b - a) - THETA * (k > 0) for k, (a, b) in enumerate(pairwise(ends)))
    seen = scene(travel=travel, pushed_s=1e-6 * travel / slope, turns=legs - 1.0)
    said = off_by(seen, np.array([error]), echoes=False, one_way=True)
    assert 0.9 * said <= found <= said
