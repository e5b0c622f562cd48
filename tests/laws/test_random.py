"""Random numbers are independent: across pixels, seeds, cameras and effects, as seen in the events."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from against.clips import hold, noisy, per_pixel, play, uneven

from vid2ev.sensors.dvs import Dvs

SHAPE = (96, 128)
PIXELS = SHAPE[0] * SHAPE[1]
UP, DOWN = 1, -1


def time_of(nth: int, way: int, seed: int = 0, camera: int = 0, **keys) -> np.ndarray:
    """When each pixel sends its nth event on an even ramp of the log light [nat since the start], [H, W]."""
    spec = uneven(threshold_on=0.2, threshold_off=0.2, **keys)
    nats = 0.2 * nth + 0.4
    light = np.exp(way * np.array([0.0, nats])).astype(np.float32)
    frames = np.broadcast_to(light[:, None, None], (2, *SHAPE))
    sent = play(spec, [0, 1_000_000_000], frames, seed=seed, camera=camera)
    at = sent.y.astype(np.int64) * SHAPE[1] + sent.x
    order = np.argsort(at, kind="stable")
    first = np.searchsorted(at[order], np.arange(PIXELS))
    return (sent.t[order][first + nth - 1] * 1e-6 * nats).reshape(SHAPE)


def counted(seed: int = 0, camera: int = 0, **keys) -> np.ndarray:
    """How many events each pixel sends at rest in 1 s, [H, W]."""
    t_ns, light = hold(0.1, np.arange(0, 1_000_000_001, 100_000_000), SHAPE)
    return per_pixel(play(noisy(**keys), t_ns, light, seed=seed, camera=camera), SHAPE).astype(float)


MAPS = {
    "ON mismatch": lambda **of: time_of(1, UP, mismatch=0.03, **of),
    "OFF mismatch": lambda **of: time_of(1, DOWN, mismatch=0.03, **of),
    "phase": lambda **of: time_of(1, UP, random_phase=True, **of),
    "crossing noise, first ON": lambda **of: time_of(1, UP, crossing_noise=0.03, **of),
    "crossing noise, second ON": lambda **of: (
        time_of(2, UP, crossing_noise=0.03, **of) - time_of(1, UP, crossing_noise=0.03, **of)
    ),
    "crossing noise, first OFF": lambda **of: time_of(1, DOWN, crossing_noise=0.03, **of),
    "shot": lambda **of: counted(shot_rate_hz=20, **of),
    "hot": lambda **of: counted(hot_probability=0.3, hot_rate_hz=50, **of) > 0,
    "hot rate": lambda **of: counted(hot_probability=1.0, hot_rate_hz=20, **of),
    "cold": lambda **of: counted(cold_probability=0.3, leak_rate_hz=20, **of) > 0,
}


@pytest.fixture(scope="module")
def maps() -> dict[tuple, np.ndarray]:
    found = {(name, 0, 0): make() for name, make in MAPS.items()}
    for seed, camera in ((1, 0), (0, 1), (2**32, 0)):
        found |= {(name, seed, camera): MAPS[name](seed=seed, camera=camera) for name in MAPS}
    return {key: np.asarray(value, float) for key, value in found.items()}


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def test_no_two_maps_are_alike(maps):
    """Every pair of effects, seeds and cameras: below 5 standard errors, and most of them below 2."""
    pairs = [correlation(maps[a], maps[b]) * math.sqrt(PIXELS) for a, b in itertools.combinations(maps, 2)]
    worst = dict(zip(itertools.combinations(maps, 2), pairs, strict=True))
    assert max(np.abs(pairs)) < 5, max(worst, key=lambda pair: abs(worst[pair]))
    assert np.mean(np.abs(pairs) < 2) > 0.9


@pytest.mark.parametrize("name", MAPS)
def test_neighbours_are_independent(maps, name):
    """Pixels beside, above, across, and 1024 apart (the length of a block)."""
    of = maps[name, 0, 0]
    flat = of.ravel()
    for a, b in (
        (of[:, :-1], of[:, 1:]),
        (of[:-1], of[1:]),
        (of[:-1, :-1], of[1:, 1:]),
        (of[:, :-2], of[:, 2:]),
        (flat[:-1024], flat[1024:]),
        (flat[0::2], flat[1::2]),
    ):
        assert abs(correlation(a, b)) < 5 / math.sqrt(a.size)


@pytest.mark.parametrize("name", ["ON mismatch", "OFF mismatch", "crossing noise, first ON"])
def test_thresholds_are_gaussian(maps, name):
    z = (maps[name, 0, 0] - 0.2) / 0.03
    assert abs(z.mean()) < 5 / math.sqrt(PIXELS)
    assert z.var() == pytest.approx(1, abs=5 * math.sqrt(2 / PIXELS))
    assert abs((z**3).mean()) < 5 * math.sqrt(15 / PIXELS)
    assert (z**4).mean() == pytest.approx(3, abs=5 * math.sqrt(96 / PIXELS))
    assert 2.5 < np.abs(z).max() <= 4.001


def test_a_pixel_keeps_its_draws_whatever_the_size_of_its_effects(maps):
    """The same draw at another strength: thresholds scale, no pixel changes places."""
    stronger = time_of(1, UP, mismatch=0.045)
    assert (stronger - 0.2) / 0.045 == pytest.approx((maps["ON mismatch", 0, 0] - 0.2) / 0.03, abs=1e-4)


def test_a_hot_pixel_is_not_cold_and_of_the_others_the_share_that_is_said_is():
    spec = noisy(hot_probability=0.4, cold_probability=0.5)
    found = Dvs(spec, SHAPE[::-1], seed=3).maps()
    assert not np.any(found["hot"] & found["cold"])
    for name, share in (("hot", 0.4), ("cold", 0.5 * (1 - 0.4))):
        assert found[name].mean() == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share) / PIXELS)), name
