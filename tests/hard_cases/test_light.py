"""Light that breaks simulators: black, saturated, flashes, not a number, out of every range."""

from __future__ import annotations

import math

import numpy as np
import pytest
from against.clips import AFTER_TRACKING, EVERYTHING, clean, feed, noisy, play, sensor, start
from against.judge import assert_one_to_one, judge_clip
from against.reference import LIGHT_MAX, Pixel

from vid2ev.errors import UsageError
from vid2ev.sensors.cis import Cis, CisSpec
from vid2ev.sensors.dvs import Dvs, DvsSpec

SHAPE = (5, 7)
POLES = [(0.0, 0.0), (300.0, 100.0)]
poles = pytest.mark.parametrize("taus", POLES, ids=["no poles", "two poles"])
orders = pytest.mark.parametrize("order", ["before", "after"])


@pytest.mark.parametrize("light", [0.0, 1e-45, 1.0, 65504.0, 1e30, 3e38])
@pytest.mark.parametrize("curve", ["offset", "toe", "v2e"])
@pytest.mark.parametrize("order", ["before", pytest.param("after", marks=pytest.mark.slow)])
def test_black_or_saturated_all_over_is_silent(light, curve, order):
    """No change, no event, whatever the noise on the thresholds; and none when the light stays after a restore."""
    spec = DvsSpec(log_curve=curve, filter=order)
    frames = np.full((50, *SHAPE), light, np.float32)
    assert len(play(spec, np.arange(50) * 7_000_003, frames)) == 0


@pytest.mark.long
def test_black_keeps_its_noise():
    """All black at 0.1 frames per second: shot noise at its dark rate, several events per pixel and interval."""
    frames = np.zeros((4, 64, 64), np.float32)
    sent = play(noisy(shot_rate_hz=5), np.arange(4) * 10_000_000_000, frames)
    expected = 5 * 30 * 64 * 64
    assert abs(len(sent) - expected) < 5 * math.sqrt(expected)


@orders
@poles
def test_flash_of_nine_decades(order, taus):
    """0 -> 1e6 -> 0 with threshold 0.01: 2072 ON, 2072 OFF, each at its time."""
    light = np.array([0, 0, 1e6, 1e6, 0, 0], np.float32)[:, None, None]
    t_ns = np.cumsum([0, 1_000_000, 1_000_000, 20_000_000, 1_000_000, 60_000_000])
    pixel = Pixel(0.01, 0.01, *taus, filter=order)
    dvs = start(sensor(pixel), light)
    sent = feed(dvs, t_ns, light)
    assert math.floor(math.log(1e9 + 1) / 0.01) == 2072
    assert dvs.counts["on"] == 2072
    assert dvs.counts["off"] in (2071, 2072)  # back to black is the last level itself
    assert dvs.counts["capped"] == 0
    assert judge_clip(pixel, t_ns, light, sent).marginal <= 1


def test_flash_of_nine_decades_with_dead_time():
    light = np.array([0, 0, 1e6, 1e6, 0, 0], np.float32)[:, None, None]
    t_ns = np.cumsum([0, 1_000_000, 1_000_000, 20_000_000, 1_000_000, 60_000_000])
    pixel = Pixel(0.01, 0.01, 300, 100, refractory_us=100)
    assert assert_one_to_one(pixel, t_ns, light, play(sensor(pixel), t_ns, light)) > 30


@pytest.mark.parametrize("order", ["before", "after"])
def test_work_is_bounded_whatever_the_contrast(order):
    """0 -> 1e30 with threshold 1e-4: 762 000 crossings, of which `max_crossings` are solved and the rest is one."""
    light = np.array([0, 1e30, 0], np.float32)[:, None, None] * np.ones((1, 2, 3), np.float32)
    spec = clean(threshold_on=1e-4, threshold_off=1e-4, filter=order)
    dvs = start(spec, light)
    sent = feed(dvs, [0, 1_000_000, 2_000_000], light)
    assert 0 < len(sent) <= 2 * 6 * (spec.max_crossings + 1)
    assert dvs.counts["capped"] == 12


ODD = [np.nan, -np.nan, np.inf, -np.inf, -1.0, -1e-30, 3e38, -0.0]


@pytest.mark.parametrize("odd", ODD)
@orders
@poles
def test_odd_values_are_what_they_stand_for(odd, order, taus):
    """NaN and negative light are 0, infinite light 1e30; the pixel recovers, its neighbours do not notice.

    A ramp to 1e30 leaves no digit for what the light was before: there the sum of the events is held to the signal.
    """
    rng = np.random.default_rng(1)
    plain = rng.uniform(0.05, 1, (12, *SHAPE)).astype(np.float32)
    light = plain.copy()
    light[4:6, 2, 3] = odd
    light[8, 0, 0] = odd
    t_ns = np.arange(12) * 20_000_000
    pixel = Pixel(0.2, 0.2, *taus, filter=order)
    dvs = start(sensor(pixel), light)
    sent = feed(dvs, t_ns, light)
    meant = light.copy()
    meant[~(light > 0)] = 0
    meant[light > LIGHT_MAX] = LIGHT_MAX
    if not odd > 1:
        judge_clip(pixel, t_ns, meant, sent)
    for y, x in ((2, 3), (0, 0)):
        mine = sent.p[(sent.x == x) & (sent.y == y)].astype(int)
        assert abs(np.log((light[11, y, x] + 1e-3) / (light[0, y, x] + 1e-3)) - 0.2 * (2 * mine - 1).sum()) < 0.2001
        assert len(mine) < 5_000
    others = play(sensor(pixel), t_ns, plain)
    here = ((sent.x == 3) & (sent.y == 2)) | ((sent.x == 0) & (sent.y == 0))
    there = ((others.x == 3) & (others.y == 2)) | ((others.x == 0) & (others.y == 0))
    assert np.array_equal(sent.t[~here], others.t[~there])
    assert dvs.counts["not_finite"] == (0 if odd == 0 else 3)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -5.0])
def test_odd_values_in_the_first_frame(odd):
    light = np.array([odd, 0.5, 0.5], np.float32)[:, None, None]
    sent = play(clean(filter="before"), [0, 1_000_000, 2_000_000], light)
    start_at = 0.0 if not odd > 0 else LIGHT_MAX
    change = math.log(0.501) - math.log(start_at + 1e-3)
    assert len(sent) == math.floor(abs(change) / 0.15)
    assert (sent.p == (change > 0)).all()


@pytest.mark.long  # (its kernel is nobody else's, and has everything in it)
def test_odd_values_with_every_effect_on_stay_finite():
    rng = np.random.default_rng(2)
    light = 10 ** rng.uniform(-6, 6, (14, 33, 35))
    light[rng.random(light.shape) < 0.1] = np.nan
    light[rng.random(light.shape) < 0.1] = np.inf
    light[rng.random(light.shape) < 0.1] *= -1
    for spec in (EVERYTHING, AFTER_TRACKING, EVERYTHING.model_copy(update={"log_curve": "v2e"})):
        dvs = start(spec.model_copy(update={"photoreceptor_noise": 0.1}), light)
        t_ns = np.cumsum(10 ** rng.uniform(0, 8, 14)).astype(np.int64) + np.arange(14)
        sent = feed(dvs, t_ns, light)
        assert len(sent) > 10_000
        for name, plane in dvs.state().items():
            assert not np.isnan(np.asarray(plane, float)).any(), name
        # It recovers: into a steady scene there is noise left, below the poles' 918 Hz each way.
        calm = np.full((3, 33, 35), 0.3)
        feed(dvs, t_ns[-1] + np.array([1, 2, 3]) * 100_000_000, calm)
        late = feed(dvs, [int(t_ns[-1]) + 400_000_000], calm[:1])
        assert len(late) < 33 * 35 * 4 * 918 // 10


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("sign", [1, -1])
def test_a_lens_that_shades_beyond_all_numbers_makes_finite_light(sign):
    """r is up to 1000 in a picture of one column, and its 16th power beyond float32; the brightest light is 1e30."""
    shading = (0.0,) * 15 + (sign * 1e6,)
    light = np.stack([np.full((2000, 1), level) for level in (0.0, np.inf, 0.0, 1.0)]).astype(np.float32)
    dvs = Dvs(EVERYTHING.model_copy(update={"shading": shading}), (1, 2000))
    cis = Cis(CisSpec(colour=False, shading=shading, exposure_us=0.0, frame_rate_hz=1000.0), (1, 2000))
    for k, frame in enumerate(light):
        sent, made = dvs.step(frame, 10**6 * k), cis.step(frame, 10**6 * k)
        assert np.all(sent.y < 2000) and all(np.isfinite(plane).all() for plane in dvs.inside(np.arange(2000)))
        assert len(made) == 1 and (made[0].codes[[0, -1]] > 1000).all() == (sign > 0 and frame.any())
    assert np.isfinite(dvs.maps()["shading"]).all() and np.isfinite(cis.maps()["shading"]).all()


def test_a_level_that_returns_exactly_does_not_drift():
    """20 000 frames between two codes: each cycle has the same events, and the sum is zero."""
    light = np.where(np.arange(20_001) % 2, 200 / 255, 100 / 255).astype(np.float32)
    sent = play(clean(threshold_on=0.13, threshold_off=0.13), np.arange(20_001) * 1_000_000, light[:, None, None])
    per_edge = math.floor(math.log((200 / 255 + 1e-3) / (100 / 255 + 1e-3)) / 0.13)
    which = (sent.t - 1) // 1000
    counts = np.bincount(which, minlength=20_000)
    assert (counts == per_edge).all()
    assert (np.bincount(which, sent.p, 20_000) == per_edge * (1 - np.arange(20_000) % 2)).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, bool, complex])
def test_codes_are_not_taken_for_light(dtype):
    dvs = Dvs(clean(), (7, 5))
    with pytest.raises(UsageError, match="transfer"):
        dvs.step(np.ones(SHAPE, dtype), 0)


@pytest.mark.parametrize("shape", [(7, 5), (35,), (1, 5, 7), (5, 8), (0, 0)])
def test_another_shape_is_refused(shape):
    with pytest.raises(UsageError, match=r"\(5, 7\)"):
        Dvs(clean(), (7, 5)).step(np.ones(shape, np.float32), 0)


def test_a_threshold_beyond_all_numbers_of_float32_leaves_the_other_polarity_as_it_is():
    """As one that no light reaches does, also in the dark after a flash, where lags are steep."""
    frames = np.array([1e4, 1e4, 0, 0, 0], np.float32)[:, None, None]
    out_of_reach, beyond = (
        play(clean(threshold_on=on, photoreceptor_tau_us=300, follower_tau_us=100), np.arange(5) * 2_000_000, frames)
        for on in (20.0, 100.0)
    )
    assert len(out_of_reach) > 50
    np.testing.assert_array_equal(beyond.t, out_of_reach.t)
