"""Nothing drifts: after a hundred million events a pixel's levels are where they were."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import clean, start

from vid2ev.sensors.dvs import DvsSpec

from .combinations import TWO_POLES

pytestmark = pytest.mark.long

SENSORS = {
    "ideal": clean(filter="after", threshold_on=1e-3, threshold_off=1e-3),
    "two poles": clean(**TWO_POLES, filter="after", threshold_on=1e-3, threshold_off=1e-3),
    "thresholds apart": clean(filter="after", threshold_on=0.0031, threshold_off=0.0011),
}


def flicker(spec: DvsSpec, events: float) -> tuple[int, np.ndarray, np.ndarray]:
    """Flicker over 4 nat, above a level that no threshold divides, until so many events are sent: how many were, and
    what is in the pixel after each of the first and the last cycles [nat]."""
    pair = [np.full((1, 1), value, np.float32) for value in (0.0517, 0.0517 * np.exp(4.0))]
    dvs = start(spec, pair[0])
    dvs.step(pair[0], 0)
    sent, t_ns, seen = 0, 0, []
    while sent < events:
        for light in (pair[1], pair[0]):
            t_ns += 10_000_000
            sent += len(dvs.step(light, t_ns))
        seen = [*seen[:3], *seen[3:][-2:], np.concatenate(dvs.inside(np.arange(1)))]
    assert sent == dvs.counts["on"] + dvs.counts["off"] and dvs.counts["capped"] == 0
    return sent, np.array(seen[:3]), np.array(seen[-3:])


def assert_no_drift(spec: DvsSpec, events: float) -> None:
    sent, first, last = flicker(spec, events)
    assert sent >= events
    step = min(spec.threshold_on, spec.threshold_off)
    assert np.abs(last[:, :2] - first[0, :2]).max() < 1e-6  # the signal
    apart = spec.threshold_on + spec.threshold_off
    assert np.abs(last[:, 2] - last[:, 3] - apart).max() < 1e-9
    # The signal is between the levels, so these are within a step of each other; without thresholds apart they are the
    # same again and again, to the rounding of a hundred million sums.
    assert (last[:, 1] < last[:, 2] + 4e-6).all() and (last[:, 1] > last[:, 3] - 4e-6).all()
    if spec.threshold_on == spec.threshold_off:
        moved = (last[:, 2] - first[1, 2]) / step
        assert np.abs(moved - np.rint(moved)).max() < 1e-4 and np.abs(moved).max() < 1.001


@pytest.mark.parametrize("name", SENSORS)
def test_a_million_events_leave_no_drift(name):
    assert_no_drift(SENSORS[name], 1e6)


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("name", SENSORS)
def test_a_hundred_million_events_leave_no_drift(name):
    assert_no_drift(SENSORS[name], 1e8)
