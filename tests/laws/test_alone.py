"""A pixel that is walked alone, by scalar code, sends the same as in company.

Noise that an interval does not resolve has all pixels walked alone; here it is too little to cause an event.
"""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import clean, play

TAUS = {"photoreceptor_tau_us": 300, "follower_tau_us": 100}
SENSORS = {
    "two poles": TAUS | {"leak_rate_hz": 50},
    "a knee": TAUS | {"leak_rate_hz": 50, "log_curve": "toe"},
    "after the log": TAUS | {"filter": "after"},
    "a first pole as fast as the light": TAUS | {"bandwidth": "light"},
    "blind after an event": TAUS | {"leak_rate_hz": 50, "refractory": "track", "refractory_us": 200},
    "straight lines": TAUS | {"timing": "linear", "leak_rate_hz": 5},
    "with the frames": TAUS | {"timing": "frame", "leak_rate_hz": 5},
}


@pytest.mark.long
@pytest.mark.parametrize("settings", SENSORS.values(), ids=SENSORS.keys())
def test_who_is_walked_alone_sends_the_same(settings):
    rng = np.random.default_rng(5)
    light = np.exp(np.cumsum(rng.normal(0, 0.5, (40, 8, 12)), axis=0) - 1).astype(np.float32)
    sent = []
    for noise in ({}, {"photoreceptor_noise": 1e-6}):
        events = play(clean(**settings, **noise), np.arange(40) * 1_000_000 + 300, light)
        sent.append(events.select(np.lexsort((events.t, events.x, events.y))))
    together, alone = sent
    assert len(together) > 1000
    assert all(np.array_equal(getattr(together, name), getattr(alone, name)) for name in "xyp")
    assert np.abs(together.t - alone.t).max() <= 1
