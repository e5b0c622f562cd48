"""One step of dt is two of dt/2: where light is linear between frames, a frame more on the line changes nothing."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import clean, start
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.sensors.dvs import Dvs, DvsSpec
from vid2ev.stream import Events

from .combinations import DEAD, TWO_POLES

pytestmark = pytest.mark.long

NAT, US = 1e-6, 1
LINES = {
    "nothing": {},
    "one pole": {"photoreceptor_tau_us": 300},
    "two poles": TWO_POLES,
    "equal poles": {"photoreceptor_tau_us": 150, "follower_tau_us": 150},
    "slow poles": {"photoreceptor_tau_us": 20_000, "follower_tau_us": 3_000},
    "quantised": TWO_POLES | DEAD,
    "paper": {"mismatch": 0.015, "crossing_noise": 0.035, "refractory_us": 100, "random_phase": True, **TWO_POLES},
}


def exact_halves(rng: np.random.Generator, frames: int, shape: tuple[int, int]) -> np.ndarray:
    """Light of 12 bits, which has its halves, quarters and eighths exactly in float32."""
    return (rng.integers(1, 4096, (frames, *shape)) / 4096).astype(np.float32)


def halved(t_ns: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The clip with a frame more in the middle of each interval."""
    times, frames = np.empty(2 * len(t_ns) - 1, np.int64), np.empty((2 * len(light) - 1, *light.shape[1:]), np.float32)
    times[::2], times[1::2] = t_ns, (t_ns[1:] + t_ns[:-1]) // 2
    frames[::2], frames[1::2] = light, (light[1:] + light[:-1]) / 2
    return times, frames


def seen(spec: DvsSpec, t_ns: np.ndarray, light: np.ndarray, every: int) -> tuple[Events, np.ndarray, Dvs]:
    """The events, and the signal [nat] of each pixel at every so many frames."""
    dvs, parts, signals = start(spec, light), [], []
    for k, (t, frame) in enumerate(zip(t_ns.tolist(), light, strict=True)):
        parts.append(dvs.step(frame, t))
        if k % every == 0:
            signals.append(dvs.inside(np.arange(frame.size)).signal)
    return Events.concatenate(parts), np.array(signals), dvs


def by_pixel(sent: Events, width: int) -> Events:
    return sent.select(np.argsort(sent.y.astype(np.int64) * width + sent.x, kind="stable"))


def apart(spec: DvsSpec, t_ns: np.ndarray, light: np.ndarray, times: int = 1) -> tuple[float, float, float]:
    """How far whole steps are from halves of halves [nat], [us] in events, and the share of events that are not in
    both."""
    fine_t, fine = t_ns, light
    for _ in range(times):
        fine_t, fine = halved(fine_t, fine)
    sent, coarse_y, _ = seen(spec, t_ns, light, 1)
    more, fine_y, _ = seen(spec, fine_t, fine, 2**times)
    width = light.shape[2]
    one, other = by_pixel(sent, width), by_pixel(more, width)
    nat = float(np.abs(coarse_y - fine_y).max())
    if len(one) != len(other) or not np.array_equal(one.p, other.p) or not np.array_equal(one.x, other.x):
        return nat, np.inf, abs(len(one) - len(other)) / max(len(one), 1)
    return nat, float(np.abs(one.t - other.t).max(initial=0)), 0.0


@pytest.mark.parametrize("keys", LINES.values(), ids=LINES.keys())
@settings(max_examples=12, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.floats(1, 4.3), st.sampled_from([1, 3]))
def test_linear_light_may_be_cut_in_halves(keys, seed, length, times):
    """The filter before the log: to 1e-6 nat at the frames, and 1 us in every event."""
    rng = np.random.default_rng(seed)
    step_ns = 8 * int(1000 * 10**length)
    light, t_ns = exact_halves(rng, 9, (3, 5)), np.arange(9) * step_ns
    nat, us, missing = apart(clean(threshold_on=0.17, threshold_off=0.21, **keys), t_ns, light, times)
    assert nat < NAT and us <= US and missing == 0


AFTER = {
    "nothing": {"filter": "after"},
    "one pole": {"filter": "after", "photoreceptor_tau_us": 300},
    "two poles": {"filter": "after", **TWO_POLES},
}


@pytest.mark.parametrize("keys", AFTER.values(), ids=AFTER.keys())
@pytest.mark.parametrize("step_ns", [80_000, 1_000_000, 33_000_000])
def test_light_that_is_linear_in_the_log_may_be_cut_in_halves_of_it(keys, step_ns):
    """The filter after the log, which takes the log of the light for a line: to 1e-6 nat and 1 us, in halves of it.

    Octaves and their geometric means are rounded to float32, which is 6e-8 nat, and 1 us at 0.06 nat/s.
    """
    octaves = np.random.default_rng(1).integers(-5, 5, (9, 3, 5)).astype(np.float64)
    t_ns = np.arange(9) * step_ns
    fine = np.exp2(halved(t_ns, octaves)[1].astype(np.float64)).astype(np.float32)
    spec = clean(threshold_on=0.17, threshold_off=0.21, dark_level=1e-12, **keys)
    sent, coarse_y, _ = seen(spec, t_ns, np.exp2(octaves).astype(np.float32), 1)
    more, fine_y, _ = seen(spec, halved(t_ns, octaves)[0], fine, 2)
    one, other = by_pixel(sent, 5), by_pixel(more, 5)
    assert np.abs(coarse_y - fine_y).max() < NAT and len(one) == len(other) > 100
    assert np.array_equal(one.p, other.p) and np.abs(one.t - other.t).max() <= US


@pytest.mark.parametrize("keys", AFTER.values(), ids=AFTER.keys())
def test_of_linear_light_the_log_is_a_chord_and_its_error_falls_with_the_square_of_the_contrast(keys):
    """The filter after the log, and light that is linear: a step of contrast c nat is off by up to c^2 / 8 between its
    frames.  That is the model (log light linear between frames, ESIM and v2e), not rounding; ten times smaller steps
    have a hundred times less of it."""
    spec = clean(threshold_on=0.02, threshold_off=0.02, **keys)
    off = {}
    for contrast in (0.4, 0.04, 0.004):
        light = (0.5 * (1 + np.linspace(0, 1, 9) * contrast)).astype(np.float32)[:, None, None]
        t_ns = np.arange(9) * 1_000_000
        fine_t, fine = halved(t_ns, light)
        coarse = np.interp(fine_t, t_ns, np.log(light[:, 0, 0].astype(float) + 1e-3))
        off[contrast] = np.abs(coarse - np.log(fine[:, 0, 0].astype(float) + 1e-3)).max()
        nat, _, _ = apart(spec, t_ns, light)
        step = contrast / 8
        assert off[contrast] <= step**2 / 8 + 1e-7 and nat <= step**2 / 8 + NAT
    assert 80 < off[0.4] / off[0.04] < 125
