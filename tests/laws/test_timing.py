"""With `timing = "frame"` what light causes comes with a frame, whatever else happens in the pixel."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev import Dvs, DvsSpec, Events, Label

SIZE, FRAMES = (32, 16), 30
SHOTS = {"shot_rate_hz": 40.0}


@pytest.mark.parametrize(
    ("refractory", "noise"),
    [
        ("quantised", SHOTS),
        pytest.param("track", SHOTS, marks=pytest.mark.long),
        pytest.param("track", {}, marks=pytest.mark.long),
    ],
)
def test_events_of_light_come_with_the_frames(refractory, noise):
    rng = np.random.default_rng(4)
    t_ns = 777 + np.cumsum(rng.integers(2_000_000, 20_000_000, FRAMES))
    light = np.exp(rng.uniform(-4, 0, (FRAMES, *SIZE[::-1]))).astype(np.float32)
    spec = DvsSpec(timing="frame", refractory=refractory, refractory_us=300.0, **noise)
    sent = Events.concatenate(Dvs(spec, SIZE, seed=3, labels=True).steps(light, t_ns))
    of_light = sent.select(sent.label != Label.SHOT) if noise else sent
    late_us = np.abs(of_light.t[:, None] - t_ns / 1e3).min(axis=1)
    assert len(of_light) > FRAMES * SIZE[0] * SIZE[1] / 3
    assert late_us.max() <= 1.0
    # The frames are further apart than the refractory period, and all that a pixel could send in one comes at once.
    at = of_light.t * SIZE[0] * SIZE[1] + of_light.y.astype(np.int64) * SIZE[0] + of_light.x
    assert len(np.unique(at)) == len(at)
