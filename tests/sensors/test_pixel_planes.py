"""State pixel by pixel: of as many sensors as there are, each in its place."""

from __future__ import annotations

import numpy as np
import pytest
from numba import typeof

from vid2ev import DvsSpec
from vid2ev.kernels.cuda.memory import Simulated
from vid2ev.sensors.compiled import UNUSED, flags_of, numbers_of, planes_of
from vid2ev.sensors.pixel_planes import blank_planes, pixel_planes, uploaded

SIZE, PIXELS = (7, 5), 35
HOT, SHOTS = {"hot_probability": 0.2, "hot_rate_hz": 50.0}, {"shot_rate_hz": 5.0, "hot_probability": 0.0}


def blank(specs, flags, numbers):
    return blank_planes(Simulated(), specs, flags, numbers, SIZE)


def test_planes_that_one_sensor_uses_have_room_for_all():
    """Hot pixels remember their last event; shots do not ask for that, and both are the same kernels."""
    specs = [DvsSpec(refractory_us=0.0, **more) for more in (HOT, SHOTS, HOT)]
    flags = flags_of(specs[0], labels=False)
    assert all(flags_of(spec, labels=False) == flags for spec in specs)
    numbers = [numbers_of(spec, seed, 0) for seed, spec in enumerate(specs)]
    each = [planes_of(spec, flags, num, *SIZE) for spec, num in zip(specs, numbers, strict=True)]
    assert [len(planes.t_last) for planes, _ in each] == [PIXELS, UNUSED, PIXELS]
    for order in ([0, 1, 2], [1, 0, 2], [0, 2, 1]):
        planes, bad = blank([specs[k] for k in order], flags, [numbers[k] for k in order])
        assert len(planes.t_last) == len(planes.memory) == 3 * PIXELS
        np.testing.assert_array_equal(bad, np.concatenate([each[k][1] for k in order]))
        np.testing.assert_array_equal(planes.theta, np.concatenate([each[k][0].theta for k in order]))


def test_planes_of_one_sensor_are_those_of_the_cpu():
    """But for the hot pixels, whose events are proposed apart."""
    for more in ({}, HOT, SHOTS, {"shading": (0.0, -0.3)}, {"mismatch": 0.0}, {"filter": "after"}):
        spec = DvsSpec(**more)
        flags, num = flags_of(spec, labels=False), numbers_of(spec, 3, 1)
        alone = uploaded(Simulated(), pixel_planes(planes_of(spec, flags, num, *SIZE)[0], flags, PIXELS))
        blank_ones, _ = blank([spec], flags, [num])
        for name, plane in alone._asdict().items():
            other = getattr(blank_ones, name)
            assert other.dtype == plane.dtype and (name == "hot" or other.shape == plane.shape), name
        np.testing.assert_array_equal(blank_ones.theta, alone.theta)
        np.testing.assert_array_equal(blank_ones.shade, alone.shade)


def test_a_plane_that_no_sensor_uses_has_few_entries():
    specs = [DvsSpec(refractory_us=0.0, **SHOTS), DvsSpec(refractory_us=0.0, **SHOTS, threshold_on=0.4)]
    flags = flags_of(specs[0], labels=False)
    assert len(blank(specs, flags, [numbers_of(spec, 1, 0) for spec in specs])[0].t_last) == UNUSED


@pytest.mark.parametrize("labels", [False, True])
def test_kernels_are_the_same_whatever_is_kept(labels):
    """Mismatch, shading and dead time make no other types, and so no other kernels."""
    changes = (
        {},
        {"mismatch": 0.0},
        {"refractory_us": 0.0},
        {"shading": (-0.2,)},
        {"mismatch": 0.0, "refractory_us": 0},
    )
    types = set()
    for change in changes:
        spec = DvsSpec(crossing_noise=0.01, **change)
        flags, numbers = flags_of(spec, labels), numbers_of(spec, 1, 0)
        types.add((flags, typeof(planes_of(spec, flags, numbers, *SIZE)[0]), typeof(numbers)))
    assert len(types) == 1
