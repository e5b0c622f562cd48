"""Lags of light, also those far larger than the signal: what is left of them is known to what the logarithm sees."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.layout import HIGH, INPUT, LAG1, LOW, PITCH, last_light, stride_of
from vid2ev.kernels.scan import commit, scan
from vid2ev.kernels.scratch import NEW, SCRATCH
from vid2ev.kernels.steep import forget_rests, new_lag, note_rests, old_lag
from vid2ev.physics.photoreceptor import step_weights
from vid2ev.sensors.compiled import flags_of, interval_of, numbers_of
from vid2ev.sensors.presets import load_sensor

PIXELS, FRAMES = 2000, 14
SENSORS = {
    "two poles": (),
    "noise": ("photoreceptor_noise=0.03",),
    "a slow second pole": ("photoreceptor_tau_us=10", "follower_tau_us=100000"),
    "one pole": ("follower_tau_us=0",),
    "a first pole as fast as the light": ("bandwidth=light",),
    "the only pole as fast as the light": ("bandwidth=light", "follower_tau_us=0"),
}


@compiled
def stepped(block, rest, scratch, flagged, light, found, flags, num, iv):
    """A step of a block; where its response was and is, and which pixels are flagged, into found [3, pixels]."""
    n, pole = light.size, len(flags.poles)
    forget_rests(scratch)
    for i in range(n):
        scratch[NEW + i] = light[i]
    note_rests(scratch, scan(block, rest, scratch, flagged, 0, n, flags, num, iv))
    for i in range(n):
        found[0, i] = np.float64(block[INPUT * PITCH + i]) - old_lag(block, scratch, pole, i, flags)
        found[1, i] = np.float64(light[i]) - new_lag(scratch, pole, i, flags)
        found[2, i] = flagged[i]
    commit(block, scratch, n, flags)


def light_of(rng: np.random.Generator, brightest: float) -> np.ndarray:
    """Light [FRAMES, PIXELS] in which there are flashes, and dim light after them."""
    light = 10 ** rng.uniform(-3, 0, (FRAMES, PIXELS))
    light[3:6] *= np.where(rng.random(PIXELS) < 0.5, 10 ** rng.uniform(0, brightest, PIXELS), 1)
    light[9, rng.random(PIXELS) < 0.5] *= brightest
    return light.astype(np.float32)


@pytest.mark.parametrize("settings", SENSORS.values(), ids=SENSORS.keys())
def test_the_response_is_known_to_what_the_logarithm_sees(settings):
    """Of two blocks in turn, one without flashes.  Pixels of which float32 cannot tell are flagged, unless bad."""
    spec = load_sensor("paper", settings)
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    rng, scratch, flagged = np.random.default_rng(1), np.zeros(SCRATCH, np.float32), np.zeros(PITCH, np.uint8)
    bad, worst, steep = rng.random(PIXELS) < 0.1, 0.0, 0
    for _ in range(4):
        blocks = []
        for brightest in (6.0, 0.0):
            light = light_of(rng, brightest)
            block, rest = np.zeros(stride_of(flags), np.float32), np.zeros(2 * PITCH, np.float32)
            block[INPUT * PITCH : INPUT * PITCH + PIXELS] = light[0]
            block[HIGH * PITCH : HIGH * PITCH + PIXELS] = np.where(bad, np.inf, 3e38)
            block[LOW * PITCH : LOW * PITCH + PIXELS] = np.where(bad, -np.inf, -3e38)
            if flags.light_bandwidth:
                before = last_light(flags)
                block[before : before + PIXELS] = light[0]
            blocks.append((light, block, rest, np.zeros((2, PIXELS))))
        for k in range(1, FRAMES):
            dt_ns = int(10 ** rng.uniform(4.5, 7))
            iv = interval_of(flags, num, 0, dt_ns, 0, 0, False)
            for light, block, rest, lags in blocks:
                found, was = np.empty((3, PIXELS)), light[k - 1] - lags[len(flags.poles) - 1]
                stepped(block, rest, scratch, flagged, light[k], found, flags, num, iv)
                du, mean = light[k].astype(float) - light[k - 1], 0.5 * (light[k].astype(float) + light[k - 1])
                tau1 = np.full(PIXELS, num.tau1_ns)
                if flags.light_bandwidth:
                    tau1 *= (1 + num.bandwidth_dark) / (mean + num.bandwidth_dark)
                w = np.array([step_weights(dt_ns, tau, num.tau2_ns) for tau in np.unique(tau1)])
                x1, w1, x2, g, w2 = w[np.unique(tau1, return_inverse=True)[1]].T
                large = np.abs(lags[: len(flags.poles)]).max(axis=0) > 2.01 * (was + num.curve.floor)
                e1, e2 = lags
                lags[:] = e1 - x1 * e1 + w1 * du, e2 - x2 * e2 + g * e1 + w2 * du
                now = light[k] - lags[len(flags.poles) - 1]
                large |= np.abs(lags[: len(flags.poles)]).max(axis=0) > 2.01 * (now + num.curve.floor)
                assert found[2, large & ~bad].all() and not found[2, bad].any()
                steep += large.sum()
                if flags.noise:  # (what is seen of the response is kept)
                    seen = block[(LAG1 + 4) * PITCH : (LAG1 + 4) * PITCH + PIXELS]
                    np.testing.assert_allclose(seen, np.log(now + num.curve.dark), atol=2e-6)
                for ours, theirs in ((found[0], was), (found[1], now)):
                    worst = max(worst, (np.abs(ours - theirs) / (theirs + num.curve.floor)).max())
    assert worst < 1e-6 and steep > 1000


def test_a_pixel_is_as_it_is_whatever_its_neighbours_are():
    spec = load_sensor("paper", ())
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    rng, calm = np.random.default_rng(1), PIXELS // 2
    light = rng.uniform(0.5, 1.0, (FRAMES, PIXELS)).astype(np.float32)
    flashes = np.concatenate([light[:, :calm], light_of(rng, 6.0)[:, calm:]], axis=1)
    states = []
    for seen in (light, flashes):
        block, rest = np.zeros(stride_of(flags), np.float32), np.zeros(2 * PITCH, np.float32)
        scratch, flagged, found = np.zeros(SCRATCH, np.float32), np.zeros(PITCH, np.uint8), np.empty((3, PIXELS))
        block[INPUT * PITCH : INPUT * PITCH + PIXELS] = seen[0]
        block[HIGH * PITCH : (HIGH + 1) * PITCH], block[LOW * PITCH : (LOW + 1) * PITCH] = 3e38, -3e38
        for k in range(1, FRAMES):
            iv = interval_of(flags, num, 0, 200_000, 0, 0, False)
            stepped(block, rest, scratch, flagged, seen[k], found, flags, num, iv)
            states.append(np.concatenate([found[:, :calm], block.reshape(-1, PITCH)[:, :calm]]))
    for alone, beside in zip(states[: FRAMES - 1], states[FRAMES - 1 :], strict=True):
        assert np.array_equal(alone, beside)
