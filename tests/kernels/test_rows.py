"""Numbers of sensors and of intervals are the same when they come out of the rows of tables."""

from __future__ import annotations

from itertools import count
from typing import Any, get_type_hints

import numpy as np

from vid2ev.kernels.layout import Interval, Numbers
from vid2ev.kernels.rows import RISEN, interval_of_row, interval_row, sensor_of, sensor_row
from vid2ev.physics.log_curve import Curve


def numbered(kind: Any, start: int, **known: Any) -> Any:
    """A record in which no two entries are alike but those that are true or false."""
    hints, numbers = get_type_hints(kind), count(start)
    return kind(**{name: known.get(name, hints[name] is bool or next(numbers)) for name in kind._fields})


def test_a_sensor_comes_out_of_its_row() -> None:
    num = numbered(Numbers, 20, curve=numbered(Curve, 1), seed=np.uint64((1 << 64) - 5))
    assert sensor_of.py_func(*sensor_row(num)) == num


def test_an_interval_comes_out_of_its_row_and_what_the_leak_has_risen_is_last() -> None:
    interval = numbered(Interval, 1)
    floats, ints = interval_row(interval, 0.25)
    assert interval_of_row.py_func(floats, ints) == interval
    assert floats[RISEN] == floats[-1] == 0.25
