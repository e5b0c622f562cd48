"""The scan leaves out no pixel that has an event: a sensor that is made to solve every pixel sends the same."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import AFTER_TRACKING, EVERYTHING, clean, feed, start

from vid2ev import load_sensor
from vid2ev.kernels.layout import HIGH, LOW, PITCH
from vid2ev.sensors.dvs import Dvs, DvsSpec

SENSORS = {
    "default": DvsSpec(),
    "two poles": clean(photoreceptor_tau_us=300, follower_tau_us=100),
    "two poles after the log": clean(photoreceptor_tau_us=300, follower_tau_us=100, filter="after"),
    "leak before the log": clean(photoreceptor_tau_us=300, leak_rate_hz=200),
    "leak after the log": clean(photoreceptor_tau_us=300, leak_rate_hz=200, filter="after"),
    "shots between": clean(
        photoreceptor_tau_us=300, filter="after", leak_rate_hz=200, shot_rate_hz=300, crossing_noise=0.04
    ),
    "everything": EVERYTHING,
    "after, tracking": AFTER_TRACKING,
    "v2e-noisy": load_sensor("v2e-noisy"),
}
RARE = ["leak before the log", "leak after the log", "shots between", "after, tracking"]  # nobody else's kernels


def solve_all(dvs: Dvs) -> None:
    """Let the levels that the scan compares, of a sensor of one block, be such that all pixels but bad ones are
    beyond them."""
    state = dvs.state()
    planes = state["fast"].reshape(-1, PITCH)
    good = planes[HIGH] < np.inf
    planes[HIGH, good], planes[LOW, good] = -np.inf, np.inf
    dvs.restore(state)


@pytest.mark.parametrize(
    "spec",
    [pytest.param(spec, marks=[pytest.mark.long] * (name in RARE), id=name) for name, spec in SENSORS.items()],
)
def test_no_pixel_that_has_an_event_is_left_out(spec):
    """Light goes here and there in steps about as long as the time constants, so that many signals turn within one."""
    rng = np.random.default_rng(4)
    short, contrast = np.arange(100) >= 60, np.repeat([0.25, 1.0], [60, 40])  # (short: noise is resolved)
    t_ns = np.cumsum(np.where(short, 1e4, 10 ** rng.uniform(3.5, 6.5, 100))).astype(np.int64)
    light = np.exp(-1.5 + contrast[:, None, None] * rng.normal(size=(100, 30, 60))).astype(np.float32)
    assert as_many(spec, t_ns, light) > 1_000


@pytest.mark.long
@pytest.mark.parametrize("filter_at", ["before", "after"])
def test_noise_makes_a_signal_turn_that_goes_one_way_without(filter_at):
    """Of light that goes up or down while its noise goes the other way."""
    spec = clean(photoreceptor_tau_us=100, follower_tau_us=1000, filter=filter_at, photoreceptor_noise=0.05)
    light = np.exp(np.random.default_rng(4).normal(-1.5, 1.0, (60, 30, 60))).astype(np.float32)
    assert as_many(spec, np.arange(60) * 125_000, light) > 10_000


def as_many(spec: DvsSpec, t_ns: np.ndarray, light: np.ndarray) -> int:
    """How many events a sensor sends, which are those of one that is made to solve every pixel."""
    scans, solves = (start(spec, light, seed=2, skip=False) for _ in range(2))
    sent = 0
    for frame, t in zip(light, t_ns.tolist(), strict=True):
        ours, theirs = scans.step(frame, t), solves.step(frame, t)
        for name in "txyp":
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), (name, t)
        solve_all(solves)
        sent += len(ours)
    return sent


@pytest.mark.parametrize(
    "spec",
    [pytest.param(spec, marks=[pytest.mark.long] * (name in RARE), id=name) for name, spec in SENSORS.items()],
)
def test_cold_pixels_send_nothing(spec):
    """Nor do they of the light where they have noise, and turns within an interval are looked for in all pixels."""
    rng = np.random.default_rng(6)
    t_ns = np.cumsum(np.where(np.arange(40) % 2, 1e4, 1e6)).astype(np.int64)  # (noise is resolved in the short ones)
    light = np.exp(rng.normal(size=(40, 30, 60))).astype(np.float32)
    dvs = start(spec.model_copy(update={"cold_probability": 0.5}), light, seed=2)
    sent, cold = feed(dvs, t_ns, light), dvs.maps()["cold"]
    assert 0.4 < cold.mean() < 0.6 and len(sent) > 1000
    assert not cold[sent.y, sent.x].any()


@pytest.mark.long
def test_cold_pixels_send_nothing_of_a_leak_that_light_in_float32_has_no_room_for():
    """Of 79 nats from frame to frame, by 1e6 times the light of white."""
    spec = clean(leak_rate_hz=1e6, threshold_on=0.2, threshold_off=0.2, cold_probability=0.5)
    light = np.full((3, 8, 8), 1e6, np.float32)
    dvs = start(spec, light)
    sent, cold = feed(dvs, [0, 395_000, 790_000], light), dvs.maps()["cold"]
    assert np.count_nonzero(~cold) * 2 * 394 <= len(sent) <= np.count_nonzero(~cold) * 2 * 395
    assert not cold[sent.y, sent.x].any()
