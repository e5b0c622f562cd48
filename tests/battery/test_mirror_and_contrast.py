"""Symmetry and order: a mirrored signal gives mirrored events, more contrast no fewer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from against.clips import clean, per_pixel, play
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.stream import Events

from .combinations import DEAD, TWO_POLES

pytestmark = pytest.mark.long

SHAPE = (3, 4)
UNEVEN = 1 - 1e-4 * math.pi
AFTER = {
    "ideal": {"filter": "after"},
    "one pole": {"filter": "after", "photoreceptor_tau_us": 300},
    "two poles": {"filter": "after", **TWO_POLES},
    "quantised": {"filter": "before", "timing": "linear", **DEAD},
    "track": {"filter": "after", **TWO_POLES, **DEAD, "refractory": "track"},
}
octaves = st.lists(st.integers(-13, 13), min_size=24, max_size=96).map(lambda seen: seen[: len(seen) // 12 * 12])
steps = st.lists(st.floats(0, 8).map(lambda e: int(10**e)), min_size=8, max_size=8)


def assert_mirrored(up: Events, down: Events) -> None:
    assert np.array_equal(up.t, down.t) and np.array_equal(up.x, down.x) and np.array_equal(up.y, down.y)
    assert np.array_equal(up.p, 1 - down.p)


@pytest.mark.parametrize("keys", [value for name, value in AFTER.items() if name != "quantised"],
                         ids=[name for name in AFTER if name != "quantised"])  # fmt: skip
@settings(max_examples=60, derandomize=True)
@given(octaves, steps, st.floats(0.05, 1), st.floats(0.05, 1), st.sampled_from(["offset", "toe", "v2e"]))
def test_a_mirrored_signal_gives_mirrored_events_to_the_bit(keys, octaves, steps, one, other, curve):
    """y -> -y and the thresholds exchanged: ON for OFF, at the very microsecond.

    Light in whole octaves has exact logarithms, above the knee of a lin-log, and without a dark level that counts.
    Where multiples of both thresholds cancel, light comes back to exactly a level, and the dark level does count: 8 of
    1.0 and 160 of 0.05.  So one is not a ratio of small numbers to the other.
    """
    other *= UNEVEN
    seen = np.array(octaves).reshape(-1, *SHAPE)
    seen = np.clip(seen, -3, 3) if curve != "offset" else seen
    t_ns = np.cumsum([0, *steps])[: len(seen)]
    spec = {**keys, "log_curve": curve, "dark_level": 1e-12}
    up, down = (
        play(clean(threshold_on=on, threshold_off=off, **spec), t_ns, np.exp2(way * seen.astype(np.float32)))
        for way, on, off in ((1, one, other), (-1, other, one))
    )
    assert_mirrored(up, down)


contrasts = st.lists(st.floats(0, 4), min_size=2, max_size=6).map(sorted)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("keys", [
    {}, {"filter": "after"}, TWO_POLES, {"filter": "after", **TWO_POLES}, {"timing": "linear", **TWO_POLES},
    {"photoreceptor_tau_us": 300}, {"photoreceptor_tau_us": 300, "filter": "after"},
], ids=lambda keys: ", ".join(f"{key} {value}" for key, value in keys.items()) or "nothing")  # fmt: skip
@settings(max_examples=25, derandomize=True)
@given(st.lists(st.floats(0, 1), min_size=3, max_size=8), steps, contrasts, st.sampled_from(["offset", "toe", "v2e"]))
def test_more_contrast_never_gives_fewer_events(keys, way, path, steps, contrasts, curve):
    """Of light that only rises (or falls), in each pixel at every instant: ln light is way x contrast x a path."""
    path = np.maximum.accumulate([0.0, *path])
    t_ns = np.cumsum([0, *steps])[: len(path)]
    light = 0.3 * np.exp(way * np.outer(path[: len(t_ns)], contrasts))[:, None, :]
    sent = play(clean(log_curve=curve, **keys), t_ns, light.astype(np.float32))
    until = np.unique(np.concatenate([t_ns // 1000, sent.t]))
    for t_us in until[-40:]:
        # (of two events that are due in the same microsecond either may be the earlier one)
        early, late = (per_pixel(sent, (1, len(contrasts)), sent.t <= t) for t in (t_us - 1, t_us + 1))
        assert (early[0, :-1] <= late[0, 1:]).all()
    assert (np.diff(per_pixel(sent, (1, len(contrasts)))[0]) >= -1 * (np.diff(contrasts) < 1e-5)).all()


@pytest.mark.parametrize("keys", [{"filter": "after"}, {"filter": "after", **TWO_POLES}], ids=["ideal", "two poles"])
@pytest.mark.parametrize("seed", range(3))
def test_of_any_light_more_contrast_gives_more_events_on_average(keys, seed):
    """Turning points may fall just short of a level at one contrast and reach it at a smaller one; over the phases of
    the pixels that is as often as not, and the mean number of events rises."""
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0, 0.2, 40))
    t_ns = np.arange(40) * 1_000_000
    counts = []
    for contrast in (0.8, 1.0, 1.25, 1.6):
        light = np.broadcast_to(np.exp(contrast * path)[:, None, None], (40, 64, 64))
        spec = clean(random_phase=True, threshold_on=0.3, threshold_off=0.3, dark_level=1e-12, **keys)
        counts.append(len(play(spec, t_ns, light)))
    assert (np.diff(counts) > 5 * np.sqrt(4096 * 0.25)).all()
