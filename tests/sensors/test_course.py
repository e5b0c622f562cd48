"""The course of a pixel is what the sensor has in it and sends of it, frame by frame."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import clean

from vid2ev.sensors.course import course_of
from vid2ev.sensors.dvs import Dvs
from vid2ev.stream import Events, Frame

SIZE, PIXEL = (5, 4), (3, 1)


@pytest.mark.parametrize("first", [0, 1, 7, 11])
def test_from_a_frame_on_are_the_events_after_it(first: int) -> None:
    """Also where events come at the very time of a frame: these are of the interval that it ends."""
    rng, spec = np.random.default_rng(0), clean(filter="after", timing="frame")
    frames = [Frame(rng.uniform(0.1, 1, SIZE[::-1]).astype(np.float32), 3_000_000 * k) for k in range(12)]
    dvs = Dvs(spec, SIZE)
    sent = [events.select((events.x == PIXEL[0]) & (events.y == PIXEL[1])) for events in map(dvs.see, frames)]
    course = course_of(Dvs(spec, SIZE), frames, PIXEL).since(first)
    after = Events.concatenate(sent[first + 1 :])
    assert np.array_equal(course.events.t, after.t) and np.array_equal(course.events.p, after.p)
    assert course.t_ns.tolist() == [frame.t_ns for frame in frames[first:]]
    assert course.light.tolist() == [float(frame.light[PIXEL[1], PIXEL[0]]) for frame in frames[first:]]
    assert (
        sum(map(len, sent)) > 20
        and np.all(course.level_on > course.signal)
        and np.all(course.level_off < course.signal)
    )
