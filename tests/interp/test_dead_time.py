"""What events count for behind a dead time: the light that was there adds up again, and nothing else changes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from interp.interpolate.take import Options
from interp.representation import blind_runs
from interp.representation.dead_time import MOST, DeadTime, Law, look_back_us
from interp.representation.event_counts import count_events
from vid2ev import Dvs, Events, UsageError, load_sensor

THRESHOLD, BLIND_US = 0.15, 100
PARAMETERS = {"refractory_us": 100.0, "refractory": "track", "timing": "response", "frame_rate_hz": 0.0}


def flash(law: Law, span_us: int) -> Events:
    """Of 64 pixels that become up to 40 times as bright, evenly over a time, and dark again."""
    settings = [f"refractory_us={BLIND_US}", f'refractory="{law}"']
    dvs = Dvs(load_sensor("ideal", [f"threshold_on={THRESHOLD}", f"threshold_off={THRESHOLD}", *settings]), (64, 1))
    dark, bright = np.full((1, 64), 0.02, np.float32), np.linspace(0.2, 0.8, 64, dtype=np.float32)[None]
    shares = np.concatenate([[0], np.linspace(0, 1, 21), np.linspace(1, 0, 21)])
    times_us = np.cumsum([0, 1000, *[span_us / 20] * 20, 1000, *[span_us / 20] * 20])
    light = [dark + np.float32(share) * (bright - dark) for share in shares]
    return Events.concatenate([dvs.step(each, round(1000 * t_us)) for each, t_us in zip(light, times_us, strict=True)])


def rise(events: Events, worth: np.ndarray, sign: int) -> np.ndarray:
    """Log light that the events of a sign stand for in each of the pixels of `flash`."""
    return THRESHOLD * np.bincount(events.x, worth * (events.p == sign), 64)


@pytest.mark.parametrize("law", ["track", "quantised"])
@pytest.mark.parametrize("span_us", [2_000, 4_000])
def test_light_that_was_not_seen_is_made_good(law: Law, span_us: int) -> None:
    events = flash(law, span_us)
    worth = DeadTime(BLIND_US, law).crossings(events.t, events.x.astype(np.int64), events.p)
    true = np.log(np.linspace(0.2, 0.8, 64) / 0.02)
    for sign in (1, 0):
        plain, made_good = (true - rise(events, each, sign) for each in (np.ones(len(events)), worth))
        # (r is that at the end of the time, and the log of even light is fastest at first; after the last event nothing
        # tells; and `quantised` looks like slower light by chance)
        left = {"track": 0.35, "quantised": 0.5}[law]
        assert plain.mean() > 0.4  # nat, of 3
        assert abs(made_good.mean()) < left * plain.mean() and np.abs(made_good).mean() < (left + 0.1) * plain.mean()


@given(st.floats(1e-4, 0.9), st.integers(2, 40))
def test_of_an_even_slope_a_memory_that_tracks_makes_all_good(share: float, number: int) -> None:
    """After each event the signal goes on for R unseen, then a threshold more; `share` is R's of that time."""
    blind_us = 10_000.0
    every_us = blind_us / share
    t_us = np.rint(np.arange(number) * every_us).astype(np.int64)
    worth = DeadTime(blind_us).crossings(t_us, np.zeros(number, np.int64), np.ones(number, np.uint8))
    crossings = np.minimum(every_us / (every_us - blind_us), MOST)  # a threshold each
    np.testing.assert_allclose(worth, [1, *[crossings] * (number - 1)], rtol=2e-3)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3), st.integers(0, 1)), max_size=80), st.integers(1, 4))
def test_pixels_and_signs_have_nothing_to_do_with_each_other(sent: list[tuple[int, int, int]], blind_us: int) -> None:
    """But that of all of them it is told how often light changes how fast."""
    t_us = np.cumsum([each[0] for each in sent], dtype=np.int64)
    pixel, p = (np.array([each[k] for each in sent], np.int64) for k in (1, 2))
    for law in ("track", "quantised"):
        dead_time = DeadTime(blind_us, law)
        worth = dead_time.crossings(t_us, pixel, p)
        assert worth.shape == t_us.shape and (worth >= 1).all() and (worth <= MOST).all()
        twice = dead_time.crossings(
            np.repeat(t_us, 2), np.repeat(2 * pixel, 2) + np.arange(2 * pixel.size) % 2, np.repeat(p, 2)
        )
        np.testing.assert_array_equal(twice[::2], twice[1::2])
        for which in range(4 * (law == "track")):
            alone = pixel == which
            np.testing.assert_array_equal(worth[alone], dead_time.crossings(t_us[alone], 0 * pixel[alone], p[alone]))
        turned = dead_time.crossings(t_us, pixel, 1 - p)
        np.testing.assert_array_equal(turned, worth)


def all_ways(runs: list[list[int]], blind_us: float) -> list[float]:
    """The means of m of runs of events, one after the other, as the docstring has them: of all ways to choose the m of
    a run, each as likely as the product of what is said of it."""
    intervals = [np.diff(run) for run in runs]
    every = np.concatenate(intervals)
    short, longer = blind_runs.SHORT * blind_us, 2 * blind_us
    slow, fast = np.sum((every >= short) & (every < longer)), np.sum((every >= blind_us - 1) & (every < short))
    a = blind_runs.EVEN + blind_runs.STEEP * math.log((1 + slow) / (1 + fast))
    a = min(max(a, blind_runs.LEAST), blind_runs.GREATEST)
    shared, means = len(every) / sum(map(len, runs)), list[float]()
    for ds in intervals:
        q = (len(ds) + blind_runs.USUAL * shared) / (len(ds) + 1 + blind_runs.USUAL)
        told = list[dict[int, float]]()
        for d in ds:
            told.append({1: 1.0})
            for m in range(2, MOST + 1 if d >= blind_us - 1 else 2):
                z = (blind_us - (m - 1) * d / m) * m / d / blind_runs.JITTER
                if (within := 0.5 * math.erfc(-z / math.sqrt(2))) < blind_runs.UNLIKELY:
                    break
                told[-1][m] = m ** (1 - a) * q ** (m - 1) * within
        total, sums = 0.0, np.zeros(len(ds))
        for way in itertools.product(*told):
            nats = np.diff(np.log(np.array(way) / ds))
            follow = np.prod(blind_runs.LEAP + 1 / (1 + (nats / blind_runs.PACE) ** 2))
            likely = follow * math.prod(each[m] for each, m in zip(told, way, strict=True))
            total, sums = total + likely, sums + likely * np.array(way)
        means += [1.0, *(sums / total)]
    return means


@settings(max_examples=60)
@given(
    st.lists(st.lists(st.floats(0.6, 3.5), max_size=4), min_size=1, max_size=5),
    st.sampled_from([1.0, 40.0, 1000.5]),
    st.integers(0, 1),
)
def test_of_a_run_it_is_the_mean_of_all_ways_that_it_may_have_come_about(
    shares: list[list[float]], blind_us: float, sign: int
) -> None:
    """Events of pixels that begin one after the other, each a run whose intervals are these shares of R."""
    runs = [
        (7 * k + np.cumsum([0, *np.ceil(np.array(run) * blind_us)])).astype(int).tolist()
        for k, run in enumerate(shares)
    ]
    events = sorted((t_us, pixel) for pixel, run in enumerate(runs) for t_us in run)
    t_us, pixel = np.array(events, np.int64).T
    worth = DeadTime(blind_us, "quantised").crossings(t_us, pixel, np.full(len(events), sign, np.uint8))
    expected = np.array(all_ways(runs, blind_us))[np.argsort(np.argsort(pixel, kind="stable"), kind="stable")]
    np.testing.assert_allclose(worth, expected, rtol=1e-5)


def test_light_that_was_slow_is_not_taken_for_fast_at_once() -> None:
    """Of 500 pixels whose intervals fall to 1.2 R and grow again, from step to step by a seventh."""
    steps = 1.15 ** np.abs(np.arange(-14, 15)) * 1.2 * BLIND_US
    t_us = np.tile(np.cumsum(np.concatenate([[0], steps])).astype(np.int64), (500, 1)).T
    pixel = np.broadcast_to(np.arange(500), t_us.shape)
    worth = DeadTime(BLIND_US, "quantised").crossings(t_us.ravel(), pixel.ravel(), np.ones(t_us.size, np.uint8))
    assert 1 <= worth.mean() < 1.06 and worth.max() < 1.5
    # (and where there are no slow ones beside them, they are of light of any pace)
    between = slice(13 * 500, 18 * 500)
    alone = DeadTime(BLIND_US, "quantised").crossings(
        t_us.ravel()[between], pixel.ravel()[between], np.ones(5 * 500, np.uint8)
    )
    assert alone[500:].mean() > 2


def test_a_lamp_that_is_slow_enough_is_not_taken_for_a_flash() -> None:
    """Light of the mains, of whose crossings few are within R of each other."""
    depth, phase = np.linspace(0.3, 0.9, 64, dtype=np.float32)[None], np.linspace(0, 6, 64, dtype=np.float32)[None]
    times_us = np.arange(0, 40_000, 250)
    light = [0.5 * (1 + depth * np.sin(2e-4 * np.pi * t_us + phase, dtype=np.float32)) for t_us in times_us]
    sent = []
    for blind_us in (BLIND_US, 0):
        dvs = Dvs(load_sensor("ideal", ["crossing_noise=0.035", f"refractory_us={blind_us}"]), (64, 1))
        sent.append(
            Events.concatenate([dvs.step(*seen) for seen in zip(light, (1000 * times_us).tolist(), strict=True)])
        )
    events, all_of_them = sent
    worth = DeadTime(BLIND_US, "quantised").crossings(events.t, events.x.astype(np.int64), events.p)
    assert len(all_of_them) > len(events) > 1000
    assert abs(worth.sum() - len(all_of_them)) <= len(all_of_them) - len(events)


def test_what_is_not_behind_a_dead_time_counts_as_one() -> None:
    slow = np.arange(20, dtype=np.int64) * int(3 * BLIND_US)
    sooner = np.arange(20, dtype=np.int64) * (BLIND_US // 2)
    signs = np.arange(20, dtype=np.int64) % 2
    for law, t_us, p in (("quantised", slow, signs * 0), ("quantised", sooner, signs * 0), ("track", sooner, signs * 0),
                         ("track", sooner * 3, signs), ("quantised", sooner * 3, signs)):  # fmt: skip
        assert (DeadTime(BLIND_US, law).crossings(t_us, 0 * t_us, p) == 1).all()


def test_more_crossings_than_sixteen_bits_tell_are_counted_all() -> None:
    t = 100 * np.arange(1, 100_001, dtype=np.int64)
    here = np.zeros(len(t), np.uint16)
    events = Events(t, here, here, np.ones(len(t), np.uint8))
    counts = count_events(events, (1, 1), 0, int(t[-1]), steps=1, dead_time=DeadTime(1000.0))
    assert float(counts.off_on.sum()) == len(t)


def test_counts_are_of_crossings_where_the_dead_time_is_known() -> None:
    t_us = np.array([1000, 1150, 6000, 6200], np.int64)
    zeros = np.zeros(4, np.uint16)
    events = Events(t_us, zeros, zeros, np.array([1, 1, 0, 0], np.uint8))
    found = count_events(events, (2, 1), 0, 10_000, 2, dead_time=DeadTime(BLIND_US)).off_on[0, :, :, 0]
    torch.testing.assert_close(found[..., 0].float(), torch.tensor([[0.0, 1 + 2], [1 + 3, 0]]), rtol=1e-3, atol=0)
    assert (found[..., 1] == 0).all()
    none = count_events(events, (2, 1), 0, 10_000, 2).off_on
    assert none.dtype == torch.uint8 and none.sum() == 4
    empty = count_events(Events.empty(), (2, 1), 0, 10_000, 2, dead_time=DeadTime(BLIND_US)).off_on
    assert (empty == 0).all()


@pytest.mark.parametrize("gap_us", [500, 700, 2000])
def test_of_gap_after_gap_as_much_is_made_good_as_of_all_at_once(gap_us: int) -> None:
    """What a pixel's first event in a gap stands for is told by the last before it."""
    events, dead_time = flash("track", 4_000), DeadTime(BLIND_US)
    end_us = -(-int(events.t[-1]) // gap_us) * gap_us
    back_us = look_back_us(dead_time)
    size, parts = (64, 1), torch.zeros(2, 1, 64)
    for start_us in range(0, end_us, gap_us):
        near = events.select(events.t > start_us - back_us)  # (and all that come after, which do not count)
        parts += count_events(near, size, start_us, start_us + gap_us, 1, dead_time=dead_time).off_on[0, :, 0].float()
    whole = count_events(events, size, 0, end_us, 1, dead_time=dead_time).off_on[0, :, 0].float()
    torch.testing.assert_close(parts, whole, rtol=0.01, atol=0.1)  # (float16, and what came longer before)
    alone = sum(
        count_events(events.stretch(*np.searchsorted(events.t, [at + 1, at + gap_us + 1])), size, at, at + gap_us, 1,
                     dead_time=dead_time).off_on.sum()
        for at in range(0, end_us, gap_us)
    )  # fmt: skip
    assert alone < 0.98 * whole.sum()


def test_of_sensors_that_send_by_a_clock_nothing_is_known() -> None:
    assert DeadTime.of(PARAMETERS) == DeadTime(100.0, "track")
    assert DeadTime.of(load_sensor("paper").model_dump()) == DeadTime(100.0, "quantised")
    for other in ({"timing": "frame"}, {"frame_rate_hz": 1000.0}, {"refractory_us": 0.0}):
        assert DeadTime.of(PARAMETERS | other) is None
    with pytest.raises(ValueError, match="refractory period"):
        DeadTime.of(PARAMETERS | {"refractory": "blind"})
    with pytest.raises(ValueError, match="refractory period"):
        DeadTime.of(PARAMETERS | {"refractory_us": float("nan")})


def test_what_is_asked_for_is_taken_in_place_of_what_is_said() -> None:
    said = DeadTime(100.0, "quantised")
    assert Options().dead_time(said) == said and Options().dead_time() is None
    assert Options(refractory_us=0).dead_time(said) is None
    assert Options(refractory_us=300).dead_time(said) == DeadTime(300, "quantised")
    assert Options(refractory_us=300).dead_time() == DeadTime(300, "track")
    for wrong in (-1.0, 0.5, float("nan"), 1e10):
        with pytest.raises(UsageError, match="expected 1 to"):
            Options(refractory_us=wrong)
