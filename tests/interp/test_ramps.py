"""Ramps: through both key frames, and by the slow way the same pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from interp.candidates.bridge import DARK, bridge, ratios_of
from interp.candidates.ramps import Risen, in_doubt, ramps, risen
from interp.light import luminance, to_codes, to_light
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts

C = 0.2
STEPS = 8


def of_one_pixel(net: list[int]) -> EventCounts:
    """Events of one pixel: ON where above 0, OFF where below."""
    counts = torch.tensor(net)
    off_on = torch.stack([(-counts).clamp(min=0), counts.clamp(min=0)])[None, :, :, None, None]
    return EventCounts(off_on, torch.full((1, 2), C))


def slowly(off_on: np.ndarray, contrast: tuple[float, float], t: float) -> tuple[float, float]:
    """E(t) and N(t) of one pixel as the docstring has them; off_on [2, S]; events of a sub-interval share its middle
    and what they stand for."""
    steps = off_on.shape[1]
    events = list[tuple[float, float]]()
    for s in range(steps):
        off, on = (int(each) for each in off_on[:, s])
        each = (contrast[1] * on - contrast[0] * off) / max(on + off, 1)
        events += [((s + 0.5) / steps, each)] * (on + off)
    change = number = last = came = 0.0
    for k, (at, nats) in enumerate(events):
        v = 0.5 if k == 0 else 1.0
        if at <= t:
            change, number, last, came = change + v * nats, number + v, at, nats
            continue
        way = (t - last) / (at - last)
        turns = came * nats < 0
        gone = way**2 if k == 0 or turns else way
        return change + gone * v * nats + turns * 3 * way * (1 - way) * came, number + gone * v
    if not events:
        return 0.0, 0.0
    after = 0.5 * (1 - ((1 - t) / (1 - last)) ** 2)
    return change + after * events[-1][1], number + after


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.floats(0, 1))
def test_it_is_the_law_pixel_by_pixel(seed: int, steps: int, t: float) -> None:
    draw = np.random.default_rng(seed)
    off_on = draw.poisson(draw.uniform(0.05, 1), (1, 2, steps, 3, 4))
    contrast = draw.uniform(0.1, 0.4, 2)
    t = (math.floor(t * steps * 4) + 0.5) / (steps * 4 + 0.5)  # (nowhere near a middle, on whose side rounding decides)
    found = risen(EventCounts(torch.from_numpy(off_on), torch.tensor(contrast[None])), torch.tensor([[t]]))
    for y, x in np.ndindex(3, 4):
        change, number = slowly(off_on[0, :, :, y, x], (contrast[0], contrast[1]), t)
        assert math.isclose(float(found.change[0, 0, 0, y, x]), change, abs_tol=1e-5)
        assert math.isclose(float(found.number[0, 0, 0, y, x]), number, abs_tol=1e-5)
        total, most = slowly(off_on[0, :, :, y, x], (contrast[0], contrast[1]), 1.0)
        assert math.isclose(float(found.change[0, 0, 0, y, x] + found.left[0, 0, 0, y, x]), total, abs_tol=1e-5)
        assert math.isclose(float(found.number[0, 0, 0, y, x] + found.more[0, 0, 0, y, x]), most, abs_tol=1e-5)


def test_it_goes_through_both_key_frames() -> None:
    first, second = 0.05 + 0.9 * torch.rand(2, 2, 3, 6, 7)
    events = EventCounts(torch.randint(0, 3, (2, 2, STEPS, 6, 7)), torch.full((2, 2), C))
    made = ramps(first, second, events, torch.tensor([[0.0, 1.0], [0.0, 1.0]]))
    torch.testing.assert_close(made, torch.stack([first, second], 1), atol=1e-4, rtol=0)


def test_without_events_it_is_the_bridge() -> None:
    first, second = torch.rand(2, 1, 3, 6, 7)
    times = torch.tensor([[0.1, 0.5, 0.9]])
    nothing = EventCounts.none(1, (6, 7), STEPS)
    torch.testing.assert_close(ramps(first, second, nothing, times), bridge(first, second, nothing, times))


def test_a_lone_event_of_noise_is_a_hump_of_half_its_height() -> None:
    key = torch.full((1, 1, 1, 1), 0.5)
    times = torch.tensor([[0.5 / STEPS, 3.499 / STEPS, 3.501 / STEPS, 6.0 / STEPS]])
    made = ramps(key, key, of_one_pixel([0, 0, 0, 1, 0, 0, 0, 0]), times)
    logs = torch.log(luminance(to_light(made, "srgb")) + DARK).flatten() - math.log(float(to_light(key, "srgb")) + DARK)
    risen_by = [0.5 * (0.5 / 3.5) ** 2, 0.5, 0.5, 1 - 0.5 * (2 / 4.5) ** 2]  # of the event
    weights = [(n + 2 * float(t)) / 3 for n, t in zip(risen_by, times[0], strict=True)]  # of it, and 2 spread evenly
    expected = [C * (n - w) for n, w in zip(risen_by, weights, strict=True)]
    torch.testing.assert_close(logs, torch.tensor(expected), atol=1e-3, rtol=0)
    assert float(logs.abs().max()) < 0.5 * C


def test_doubt_is_what_is_missed_where_half_of_it_may_have_come() -> None:
    dark, bright = (torch.full((1, 1, 1, 1), light) for light in (0.1, 0.3))
    times = torch.tensor([[0.0, 0.25, 0.75, 1.0]])
    doubt = in_doubt(dark, bright, risen(of_one_pixel([0, 0, 0, 1, 0, 0, 0, 0]), times), times, "linear").flatten()
    missed = math.log(0.301 / 0.101) - C  # half the event before it, half after
    early = (0.5 * (0.25 / 0.4375) ** 2 + 2 * 0.25) / 3  # w before the event, in the middle of 3/8 ... 4/8
    late = (1 - 0.5 * (0.25 / 0.5625) ** 2 + 2 * 0.75) / 3
    expected = [0.0, *(missed * math.sqrt(w * (1 - w)) for w in (early, late)), 0.0]
    torch.testing.assert_close(doubt, torch.tensor(expected), atol=1e-5, rtol=0)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1))
def test_backwards_in_time_it_is_the_same(seed: int, t: float) -> None:
    """Of light that only rises, or falls: what has risen until t is then left of what falls.

    (Light that turns goes a whole threshold back to the level before, forwards and backwards not the same one, and goes
    beyond the last one before it turned.)
    """
    draw = np.random.default_rng(seed)
    falls = torch.from_numpy(draw.random((3, 4)) < 0.5)
    some = torch.from_numpy(draw.poisson(draw.uniform(0.05, 1), (STEPS, 3, 4)))
    off_on = torch.stack([some * falls, some * ~falls])[None]
    t = (math.floor(t * STEPS * 4) + 0.5) / (STEPS * 4 + 1)
    one = torch.full((1, 2), C)
    there = risen(EventCounts(off_on, one), torch.tensor([[t]]))
    back = risen(EventCounts(off_on.flip(1, 2), one), torch.tensor([[1 - t]]))
    for name, reverse in (("change", "left"), ("number", "more")):
        sign = -1 if name == "change" else 1
        torch.testing.assert_close(getattr(there, name), sign * getattr(back, reverse), atol=1e-5, rtol=0)


@pytest.mark.parametrize("thresholds", [0.4, 1.0, 2.5, 6.3])
def test_light_that_changes_slowly_is_neither_ahead_nor_behind(thresholds: float) -> None:
    """Straight in the logarithm, over all phases of the levels: the mean is the truth to a thirtieth of a threshold."""
    steps, phases, rise = 64, 200, thresholds * C
    at = (np.arange(phases) + 0.5) / phases + np.linspace(0, thresholds, steps + 1)[:, None]
    on = torch.from_numpy(np.diff(np.floor(at), axis=0))
    off_on = torch.stack([torch.zeros_like(on), on])[None, :, :, None]
    times = torch.linspace(0.02, 0.98, 25)[None]
    found = risen(EventCounts(off_on, torch.full((1, 2), C)), times)
    zero = torch.zeros(1, 1, 1, 1, phases)
    light = found.change + found.drift(times) * found.missed(zero, zero + rise)
    off = light.mean((0, 2, 3, 4)) - rise * times[0]
    assert float(off.abs().max()) < 0.03 * C
    torch.testing.assert_close(off, -off.flip(0), atol=0.02 * C, rtol=0)  # as much ahead as behind


def seen(light: np.ndarray, memory: float, steps: int) -> np.ndarray:
    """Events [2, steps] of light in thresholds, from a memory on."""
    off_on, each = np.zeros((2, steps)), (len(light) - 1) // steps
    for k, level in enumerate(light[1:]):
        while abs(level - memory) >= 1:
            rises = level > memory
            memory += 1 if rises else -1
            off_on[int(rises), k // each] += 1
    return off_on


@pytest.mark.parametrize("cycles", [1, 2])
@pytest.mark.parametrize("thresholds", [2.5, 4.1])
def test_light_that_turns_goes_on_before_it_comes_back(thresholds: float, cycles: int) -> None:
    """Over all phases of the levels: the mean is the truth to a fifth of a threshold (it was nearly a whole one)."""
    steps, phases = 128, 50
    moments = np.linspace(0, 1, 8 * steps + 1)
    light = thresholds * (1 - np.cos(2 * np.pi * cycles * moments)) / 2
    off_on = np.stack([seen(light, -(phase + 0.5) / phases, steps) for phase in range(phases)], -1)
    times = torch.linspace(0.02, 0.98, 25)[None]
    found = risen(EventCounts(torch.from_numpy(off_on)[None, :, :, None], torch.full((1, 2), C)), times)
    zero = torch.zeros(1, 1, 1, 1, phases)
    made = found.change + found.drift(times) * found.missed(zero, zero)
    truth = torch.from_numpy(np.interp(times[0], moments, light)) * C
    assert float((made.mean((0, 2, 3, 4)) - truth).abs().max()) < 0.2 * C


@pytest.mark.parametrize("steps", [5, 16])
def test_what_comes_back_is_none_of_what_has_changed_in_the_end(steps: int) -> None:
    counts = EventCounts(torch.randint(0, 3, (1, 2, steps, 6, 7)), torch.full((1, 2), C))
    middles = (torch.arange(steps)[None] + 0.5) / steps
    found = risen(counts, torch.cat([torch.tensor([[0.0, 1.0]]), middles], 1))
    assert float(found.beyond[:, :2].abs().max()) == 0
    assert float(found.beyond.abs().max()) <= 0.75 * C + 1e-6  # (3 f (1 - f), where nothing is beyond a threshold)
    torch.testing.assert_close(found.left[:, 1], torch.zeros(1, 1, 6, 7), atol=1e-5, rtol=0)


def test_networks_are_given_thirds_of_usual_events_and_half_the_log_of_their_number() -> None:
    """In this order and these units the weights that come with the package have learnt them."""
    change, left, number, more, beyond = torch.randn(5, 1, 2, 1, 3, 5)
    found = Risen(change, left, number.abs(), more.abs(), beyond).channels()
    expected = [change / 0.45, left / 0.45, torch.log(1 + number.abs()) / 2, torch.log(1 + more.abs()) / 2]
    torch.testing.assert_close(found, torch.cat(expected, 2))


def test_colours_are_those_of_a_picture_of_the_instant_if_there_is_one() -> None:
    first, second = 0.3 + 0.4 * torch.rand(2, 1, 3, 6, 7)
    events, times = of_one_pixel([0, 1, 0, 0, -2, 0, 0, 0]), torch.tensor([[0.3, 0.6]])
    events = EventCounts(events.off_on.expand(-1, -1, -1, 6, 7), events.contrast)
    pictures = 0.4 + 0.3 * torch.rand(1, 2, 3, 6, 7)  # (not so saturated that a colour would be below black)
    found = to_light(ramps(first, second, events, times, around=pictures), "srgb")
    torch.testing.assert_close(ratios_of(found), ratios_of(to_light(pictures, "srgb")), rtol=0, atol=1e-4)
    plain = to_light(ramps(first, second, events, times), "srgb")
    torch.testing.assert_close(luminance(found), luminance(plain), rtol=1e-4, atol=1e-6)


def test_light_that_rises_steadily_is_nearer_than_by_stairs() -> None:
    steps, rise = 64, 3.3 * C
    errors = {"ramps": 0.0, "bridge": 0.0}
    times = torch.linspace(0.02, 0.98, 25)[None]
    for phase in (0.1, 0.3, 0.5, 0.7, 0.9):
        crossings = [(k + phase) * C / rise for k in range(4) if (k + phase) * C < rise]
        net = np.bincount([int(t * steps) for t in crossings], minlength=steps).tolist()
        dark = torch.tensor(0.1)
        light = torch.exp(torch.log(dark + DARK) + rise * torch.tensor([0.0, 1.0])) - DARK
        first, second = (to_codes(each.reshape(1, 1, 1, 1), "srgb") for each in light)
        for name, method in (("ramps", ramps), ("bridge", bridge)):
            made = luminance(to_light(method(first, second, of_one_pixel(net), times), "srgb"))  # type: ignore[operator]
            off = torch.log(made.flatten() + DARK) - torch.log(dark + DARK) - rise * times[0]
            errors[name] += float(off.square().sum())
    assert errors["ramps"] < 0.7 * errors["bridge"]  # (0.62: straight lines, which parabolas are not)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 1), st.floats(0, 1))
def test_parts_of_events_are_parts_of_what_events_say(seed: int, part: float, t: float) -> None:
    """Counts from between pixels: E and N of a pixel's lone events are in proportion, and no count is below zero."""
    draw = np.random.default_rng(seed)
    lone, many = np.zeros((1, 2, STEPS, 3, 4)), part * draw.poisson(0.7, (1, 2, STEPS, 3, 4))
    for y, x in np.ndindex(3, 4):
        lone[0, draw.integers(2), draw.integers(STEPS), y, x] = 1
    contrast, times = torch.tensor([[0.1, 0.3]]), torch.tensor([[t]])
    whole = risen(EventCounts(torch.from_numpy(lone), contrast), times)
    parts = risen(EventCounts(torch.from_numpy(part * lone), contrast), times)
    for name in ("change", "left", "number", "more"):
        torch.testing.assert_close(getattr(parts, name), part * getattr(whole, name), atol=1e-5, rtol=1e-4)
    found = risen(EventCounts(torch.from_numpy(many), contrast), times)
    assert found.number.min() >= -1e-5 and found.more.min() >= -1e-5
    assert torch.isfinite(found.channels()).all()


@pytest.mark.parametrize(("events", "frames"), [((50, 75), (101, 151)), ((47, 63), (100, 134))])
def test_of_pixels_between_pixels_both_ends_are_still_the_key_frames(
    events: tuple[int, int], frames: tuple[int, int]
) -> None:
    draw = torch.Generator().manual_seed(0)
    counts = EventCounts(torch.poisson(torch.full((1, 2, 32, *events), 0.3), generator=draw), torch.full((1, 2), 0.2))
    first, last = torch.rand(2, 1, 3, *frames, generator=draw)
    laid, times = over(counts, frames), torch.tensor([[0.0, 0.5, 1.0]])
    found = risen(laid, times)
    assert found.more.min() >= 0 and found.drift(times).max() <= 1
    assert torch.isfinite(in_doubt(first, last, found, times)).all()
    made = ramps(first, last, laid, times)
    torch.testing.assert_close(made[0, [0, 2]], torch.cat([first, last]), atol=1e-4, rtol=0)
