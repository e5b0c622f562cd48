"""Photoreceptor noise sends events as often as it leaves levels and comes back, however dense frames are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from against.clips import clean, hold, play

from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream import Events


def at_rest(spec: DvsSpec, seconds: float, every_ns: int, shape: tuple[int, int]) -> Events:
    """Events of steady light, frames `every_ns` apart."""
    return play(spec, *hold(0.5, np.arange(0, round(seconds * 1e9) + 1, every_ns), shape))


def excursions(sent: Events, shape) -> tuple[int, int]:
    """How often pixels left the level they started from, upwards and downwards."""
    at = sent.y.astype(np.int64) * shape[1] + sent.x
    order = np.argsort(at, kind="stable")
    step = np.where(sent.p[order] == 1, 1, -1)
    run = np.cumsum(step) - step
    start_of = np.concatenate([[0], np.flatnonzero(np.diff(at[order])) + 1])
    base = np.repeat(run[start_of], np.diff(np.append(start_of, len(step))))
    home = run - base == 0
    return int(np.count_nonzero(home & (step == 1))), int(np.count_nonzero(home & (step == -1)))


@pytest.mark.parametrize(("hz", "pixels", "seconds"), [
    pytest.param(100, 4096, 0.5, marks=pytest.mark.long), (1_000, 4096, 0.5),
    pytest.param(10_000, 2048, 1.0, marks=pytest.mark.long), pytest.param(30_000, 1024, 2.0, marks=pytest.mark.long),
    pytest.param(100_000, 2048, 1.0, marks=pytest.mark.long),
])  # fmt: skip
@pytest.mark.parametrize("order", ["before", pytest.param("after", marks=pytest.mark.slow)])
def test_photoreceptor_noise_makes_events_at_rices_rate(hz, pixels, seconds, order):
    """Excursions beyond a level 3.5 sigma away: exp(-theta^2 / 2 sigma^2) / (2 pi sqrt(tau1 tau2)), each way.

    An event is sent when the level is left and another when it is met again; a second excursion counts only
    after the return, which makes the rate of a right sensor some 7 % less than Rice's.
    """
    sigma = 0.2 / 3.5
    spec = clean(threshold_on=0.2, threshold_off=0.2, photoreceptor_noise=sigma, photoreceptor_tau_us=300,
                 follower_tau_us=100, filter=order)  # fmt: skip
    shape = (pixels // 64, 64)
    sent = at_rest(spec, seconds, 1_000_000_000 // hz, shape)
    expected = math.exp(-(3.5**2) / 2) / (2 * math.pi * math.sqrt(300e-6 * 100e-6)) * pixels * seconds
    up, down = excursions(sent, shape)
    assert expected > 4000
    assert up / expected == pytest.approx(1, abs=0.15)
    assert down / expected == pytest.approx(1, abs=0.15)
    # What goes up comes down: beside the excursions there are the returns, and little else.
    assert len(sent) / (2 * (up + down)) == pytest.approx(1, abs=0.05)


def followed(
    tau1_us: float, tau2_us: float, sigma: float, theta: float, step_us: float, steps: int, pixels: int
) -> float:
    """Events/s of a pixel at rest whose noise is followed step by step."""
    rng, spread = np.random.default_rng(0), sigma * math.sqrt((tau1_us + tau2_us) / tau1_us)
    keep1, keep2, warm = math.exp(-step_us / tau1_us), math.exp(-step_us / tau2_us), int(8 * tau2_us / step_us)
    first, second = spread * rng.standard_normal(pixels), np.zeros(pixels)
    memory, sent = np.zeros(pixels), 0
    for k in range(warm + steps):
        after = keep1 * first + spread * math.sqrt(1 - keep1**2) * rng.standard_normal(pixels)
        second = keep2 * second + (1 - keep2) * 0.5 * (first + after)
        first = after
        if k >= warm:
            rungs = np.trunc((second - memory) / theta)
            sent += int(np.abs(rungs).sum())
            memory += theta * rungs
    return sent / (pixels * steps * step_us * 1e-6)


@pytest.mark.long
@pytest.mark.parametrize(("tau2_us", "step_us", "steps"), [(300, 5, 15_000), (30, 0.5, 60_000)])
@pytest.mark.parametrize("every_ns", [100_000, 1_000_000, 10_000_000])
def test_noise_that_frames_are_too_few_for_sends_as_much_as_the_noise_itself(every_ns, tau2_us, step_us, steps):
    """3 sigma: Rice's rate is 8 % above it where the poles are alike, 25 % where one is ten times as fast."""
    sigma, seconds, shape = 0.2 / 3, 0.3, (64, 64)
    spec = clean(threshold_on=0.2, threshold_off=0.2, photoreceptor_noise=sigma, photoreceptor_tau_us=300,
                 follower_tau_us=tau2_us)  # fmt: skip
    sent = len(at_rest(spec, seconds, every_ns, shape)) / (shape[0] * shape[1] * seconds)
    assert sent == pytest.approx(followed(300, tau2_us, sigma, 0.2, step_us, steps, 2000), rel=0.06)


@pytest.mark.parametrize("kind", ["quantised", "track"])
@pytest.mark.parametrize("refractory_us", [1, 1000])
def test_of_noise_that_frames_are_too_few_for_a_blind_pixel_sends_what_leaves_its_level(refractory_us, kind):
    """What it sends of the way back is nothing, however soon it sees again."""
    noise = dict(threshold_on=0.2, threshold_off=0.2, photoreceptor_noise=0.2 / 3, photoreceptor_tau_us=300,
                 follower_tau_us=100)  # fmt: skip
    free = at_rest(clean(**noise), 0.4, 1_000_000, (64, 64))
    blind = at_rest(clean(**noise, refractory=kind, refractory_us=refractory_us), 0.4, 1_000_000, (64, 64))
    assert len(blind) / sum(excursions(free, (64, 64))) == pytest.approx(1, abs=0.03)


def test_noise_goes_by_the_thresholds_that_a_shot_has_drawn():
    """Within an interval, too: other thresholds are passed at another rate from there on."""
    spec = clean(threshold_on=0.2, threshold_off=0.2, crossing_noise=0.06, photoreceptor_noise=0.05,
                 photoreceptor_tau_us=300, follower_tau_us=100, shot_rate_hz=20, shot_light_factor=1)  # fmt: skip
    often, once = (len(at_rest(spec, 1, every_ns, (32, 64))) for every_ns in (1_000_000, 1_000_000_000))
    assert once == pytest.approx(often, rel=0.03)


@pytest.mark.parametrize(("blind", "most"), [
    ({}, 2 * (50 + 2)), ({"refractory_us": 1000.0, "refractory": "track"}, 40 + 1)
])  # fmt: skip
@pytest.mark.parametrize("thresholds", [(0.15, 0.15), (0.1, 0.2)])
def test_noise_far_beyond_thresholds_is_bounded_work(blind, most, thresholds):
    """Of time constants of a picosecond, which would be 10^10 crossings from frame to frame."""
    on, off = thresholds
    spec = clean(threshold_on=on, threshold_off=off, photoreceptor_noise=1, photoreceptor_tau_us=1e-6,
                 follower_tau_us=1e-6, max_crossings=50, **blind)  # fmt: skip
    dvs, light = Dvs(spec, (2, 1)), np.ones((1, 2), np.float32)
    dvs.step(light, 0)
    for k in range(1, 4):
        before = dvs.counts
        assert 2 < len(dvs.step(light, 40_000_000 * k)) <= 2 * most
        assert (dvs.counts["capped"] > before["capped"]) == (not blind)
