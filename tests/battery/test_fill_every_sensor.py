"""Straight into grids is through events, and many frames at a time is one by one: of every sensor, to the bit."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.sensors.dvs import Dvs
from vid2ev.stream import Events
from vid2ev.views.grid import NetCounts, Windows
from vid2ev.views.time_surface import ActiveEvents
from vid2ev.views.voxel import Voxel

from .combinations import Sensor, everyday
from .drawn_clips import SIZE, Clip, clips

pytestmark = pytest.mark.long


def two_of_each(times_us: list[int], windows_us: list[list[int]]) -> list[tuple]:
    """Grids with edges and windows at these times, twice."""
    edges = np.unique([*times_us, times_us[0] + 10])
    voxels = partial(Voxel, bins=3, polarity=True)
    kinds = [
        lambda: NetCounts(SIZE, edges),
        lambda: NetCounts(SIZE, edges, dtype=np.int16, polarity=True),
        lambda: Windows(SIZE, voxels, windows_us),
        lambda: Windows(SIZE, ActiveEvents, windows_us),
    ]
    return [(kind(), kind()) for kind in kinds]


@pytest.mark.parametrize("sensor", everyday(), ids=lambda sensor: sensor.name)
@settings(max_examples=8)
@given(data=st.data())
def test_straight_into_grids_is_through_events_of_every_sensor(sensor: Sensor, data: st.DataObject) -> None:
    clip: Clip = data.draw(clips(sensor.light))
    options = {"labels": sensor.labels, "transfer": "srgb"}
    alone = Dvs(sensor.spec, SIZE, clip.seed, **options)
    each = [alone.step(frame, t) for frame, t in zip(clip.frames, clip.t_ns.tolist(), strict=True)]
    whole = Events.concatenate(each)
    first, last = int(clip.t_ns[0] // 1000), int(clip.t_ns[-1] // 1000)
    time_us = st.integers(first - 5, last + 5)
    if len(whole):
        time_us = st.one_of(time_us, st.sampled_from(np.unique(whole.t).tolist()))
    times = data.draw(st.lists(time_us, min_size=1, max_size=9))
    windows = [sorted(data.draw(st.tuples(time_us, time_us))) for _ in range(3)]
    other = Dvs(sensor.spec, SIZE, clip.seed + 1 & 2**64 - 1, skip=data.draw(st.booleans()), **options)
    for through, straight in two_of_each(times, windows):
        through.add(whole)
        other.renew(sensor.spec, clip.seed)
        for some in (slice(0, clip.cut), slice(clip.cut, None)):
            other.fill(straight, clip.frames[some], clip.t_ns[some])
        np.testing.assert_array_equal(straight.take(), through.take())
        assert other.counts == alone.counts
    other.renew(sensor.spec, clip.seed)
    for ours, theirs in zip(other.steps(clip.frames, clip.t_ns), each, strict=True):
        for name in ("t", "x", "y", "p", "label"):
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
