"""The leak turns the signal round where the light alone would not, and what it crosses meanwhile is sent."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev import Dvs, DvsSpec, Events

THRESHOLD, LEAK_NAT_PER_S = 0.05, 50.0  # 1000 Hz
DURATION_S, TAU_S = 0.03, 0.005


def crossings(signal: np.ndarray) -> list[tuple[int, int]]:
    """Index and polarity of each crossing of levels one threshold apart, from signal[0] on."""
    memory, found, i = signal[0], [], 0
    while True:
        beyond = np.flatnonzero(np.abs(signal[i:] - memory) >= THRESHOLD)
        if beyond.size == 0:
            return found
        i += int(beyond[0])
        up = bool(signal[i] > memory)
        memory += THRESHOLD if up else -THRESHOLD
        found.append((i, int(up)))


@pytest.mark.parametrize(
    ("order", "tau_s", "log_curve"),
    [
        ("before", 0.0, "offset"),
        ("before", TAU_S, "offset"),
        pytest.param("before", TAU_S, "toe", marks=pytest.mark.long),
        pytest.param("after", TAU_S, "offset", marks=pytest.mark.long),
    ],
)
def test_a_leak_that_falling_light_overtakes(order, tau_s, log_curve):
    """Light falls along a line and takes the signal back to about where it was, but the leak has lifted it meanwhile.

    The signal has no turning point of the filter's own, and ends between its levels.
    """
    dark = 1e-3 if log_curve == "offset" else 0.0
    t_s = np.linspace(0.0, DURATION_S, 600_001)
    way_s = t_s - tau_s * -np.expm1(-t_s / tau_s) if tau_s else t_s  # the response to a slope of 1/s
    fallen = LEAK_NAT_PER_S * DURATION_S - 0.3 * THRESHOLD
    if order == "before":
        slope = (1.0 + dark) * np.expm1(-fallen) / way_s[-1]
        last, signal = 1.0 + slope * DURATION_S, np.log(1.0 + slope * way_s + dark)
    else:
        slope = -fallen / way_s[-1]
        last, signal = (1.0 + dark) * np.exp(slope * DURATION_S) - dark, slope * way_s
    expected = crossings(signal + LEAK_NAT_PER_S * t_s)
    spec = DvsSpec(
        threshold_on=THRESHOLD, threshold_off=THRESHOLD, mismatch=0, crossing_noise=0, refractory_us=0, filter=order,
        random_phase=False, photoreceptor_tau_us=1e6 * tau_s, follower_tau_us=0, leak_rate_hz=1000.0,
        log_curve=log_curve, dark_level=dark or 1e-3,
    )  # fmt: skip
    sensor = Dvs(spec, (1, 1))
    sensor.step(np.ones((1, 1)), 0)
    sent = sensor.step(np.full((1, 1), last), round(1e9 * DURATION_S))
    assert len(expected) >= 4 and {p for _, p in expected} == {0, 1}
    assert sent.p.tolist() == [p for _, p in expected]
    np.testing.assert_allclose(sent.t, 1e6 * t_s[[i for i, _ in expected]], atol=1.0)


@pytest.mark.parametrize(
    ("order", "follower_us"),
    [
        pytest.param("after", 0.0, marks=pytest.mark.long),
        pytest.param("after", 200.0, marks=pytest.mark.long),
        ("before", 0.0),
    ],
)
def test_a_dip_that_the_leak_makes_up_for_before_the_next_frame(order, follower_us):
    """Light that was falling rises: the signal falls on for a while, and the leak has lifted it beyond where it was by
    the next frame.  The same light in fifty steps has the same events."""
    rng, pixels = np.random.default_rng(0), 500
    nats = np.cumsum([np.zeros(pixels), -rng.uniform(0.3, 1.2, pixels), rng.uniform(0, 0.4, pixels)], axis=0)
    spec = DvsSpec(
        threshold_on=0.2, threshold_off=0.2, mismatch=0, crossing_noise=0, refractory_us=0, filter=order,
        random_phase=False, photoreceptor_tau_us=1000, follower_tau_us=follower_us, leak_rate_hz=250.0, dark_level=1e-9,
    )  # fmt: skip
    sent = []
    for steps in (1, 50):
        sensor, events = Dvs(spec, (pixels, 1)), []
        for place in np.linspace(0, 2, 2 * steps + 1):
            k = min(int(place), 1)
            log = nats[k] + (place - k) * (nats[k + 1] - nats[k])
            line = np.exp(nats[k]) + (place - k) * (np.exp(nats[k + 1]) - np.exp(nats[k]))
            light = line if order == "before" else np.exp(log)
            events.append(sensor.step(light[None].astype(np.float32), round(place * 5_000_000)))
        both = Events.concatenate(events)
        sent.append(both.select(np.lexsort((both.t, both.x))))
    coarse, fine = sent
    assert len(coarse) > 800 and np.array_equal(coarse.x, fine.x) and np.array_equal(coarse.p, fine.p)
    assert np.abs(coarse.t - fine.t).max() <= 2


@pytest.mark.parametrize("gap_s", [0.5, 4.0])
@pytest.mark.parametrize("log_curve", ["offset", "toe", "v2e"])
@pytest.mark.parametrize("light", [(0.0, 0.0), (0.5, 0.5), (1e-4, 3.0), (0.0, 1e5), (0.05, 0.1)], ids=str)
def test_a_leak_that_outruns_all_light(light, log_curve, gap_s):
    """Between two frames it rises by 200 nats, a level in light by more than float32 has numbers for, or by 1600, the
    square of which is beyond those of float64: every event is still when light along a line and the leak have gone so
    many thresholds, also right at a knee."""
    threshold, leak_nat_per_s = 0.4, 400.0  # 1000 Hz
    t_s, seen = [0.0, gap_s, 2 * gap_s], np.array([*light, light[1]], np.float32)
    spec = DvsSpec(
        threshold_on=threshold, threshold_off=threshold, mismatch=0, crossing_noise=0, refractory_us=0,
        random_phase=False, photoreceptor_tau_us=0, follower_tau_us=0, leak_rate_hz=1000.0, dark_level=1e-5,
        log_curve=log_curve,
    )  # fmt: skip

    def signal(at_s: np.ndarray) -> np.ndarray:
        lit, knee = np.interp(at_s, t_s, seen.astype(np.float64)), 20 / 255
        dim = lit / knee - 1 + np.log(knee) if log_curve == "toe" else lit / knee * np.log(20) - np.log(255)
        seen_with_knee = np.where(lit < knee, dim, np.log(np.maximum(lit, knee)))
        return (np.log(lit + 1e-5) if log_curve == "offset" else seen_with_knee) + leak_nat_per_s * at_s

    start, end = signal(np.array([0.0, t_s[-1]]))
    levels = start + threshold * np.arange(1, int((end - start) / threshold - 1e-6) + 1)
    early, late = np.zeros(len(levels)), np.full(len(levels), t_s[-1])
    for _ in range(60):
        middle = 0.5 * (early + late)
        above = signal(middle) >= levels
        early, late = np.where(above, early, middle), np.where(above, middle, late)
    sensor = Dvs(spec, (1, 1))
    sent = Events.concatenate([sensor.step(seen[k : k + 1, None], round(1e9 * t_s[k])) for k in range(3)])
    late = late[late < t_s[-1] - 2e-6]  # (the last one may come with the last frame, or after it)
    assert (sent.p == 1).all() and len(late) > 1900 * gap_s
    np.testing.assert_allclose(sent.t[sent.t < 1e6 * t_s[-1] - 2], 1e6 * late, atol=1.0)
