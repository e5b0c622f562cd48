"""State pixel by pixel: of as many sensors as there are, each in its place."""

from __future__ import annotations

import numpy as np
import pytest
from numba import typeof

from vid2ev import DvsSpec
from vid2ev.sensors.compiled import UNUSED, flags_of, numbers_of, planes_of
from vid2ev.sensors.pixel_planes import pixel_planes

SIZE, PIXELS = (7, 5), 35
HOT, SHOTS = {"hot_probability": 0.2, "hot_rate_hz": 50.0}, {"shot_rate_hz": 5.0, "hot_probability": 0.0}


def test_planes_that_one_sensor_uses_have_room_for_all():
    """Hot pixels remember their last event; shots do not ask for that, and both are the same kernels."""
    specs = [DvsSpec(refractory_us=0.0, **more) for more in (HOT, SHOTS, HOT)]
    flags = flags_of(specs[0], labels=False)
    assert all(flags_of(spec, labels=False) == flags for spec in specs)
    each = [planes_of(spec, flags, numbers_of(spec, 1, 0), *SIZE)[0] for spec in specs]
    assert [len(planes.t_last) for planes in each] == [PIXELS, UNUSED, PIXELS]
    for order in ([0, 1, 2], [1, 0, 2], [0, 2, 1]):
        planes = pixel_planes([each[k] for k in order], flags, PIXELS)
        assert len(planes.t_last) == len(planes.memory) == 3 * PIXELS
        hot = [k * PIXELS + each[which].hot for k, which in enumerate(order)]
        np.testing.assert_array_equal(planes.hot, np.concatenate(hot))


def test_a_plane_that_no_sensor_uses_has_few_entries():
    specs = [DvsSpec(refractory_us=0.0, **SHOTS), DvsSpec(refractory_us=0.0, **SHOTS, threshold_on=0.4)]
    flags = flags_of(specs[0], labels=False)
    each = [planes_of(spec, flags, numbers_of(spec, 1, 0), *SIZE)[0] for spec in specs]
    assert len(pixel_planes(each, flags, PIXELS).t_last) == UNUSED


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
