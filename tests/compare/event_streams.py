"""Streams of events to compare."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from vid2ev.stream.events import Events

SIZE = (3, 2)


def events_of(t: Any, x: Any = 0, y: Any = 0, p: Any = 1) -> Events:
    """Events in order of time; what is the same for all may be given once."""
    t = np.asarray(t, np.int64)
    columns = (np.broadcast_to(np.asarray(one, kind), t.shape) for one, kind in ((x, "u2"), (y, "u2"), (p, "u1")))
    return Events(t, *columns).select(np.argsort(t, kind="stable"))


def isolated(n: int, seed: int = 0, size: tuple[int, int] = SIZE) -> Events:
    """n events of both polarities so far apart that none knows of another."""
    random = np.random.default_rng(seed)
    t = 10**6 * np.arange(1, n + 1)
    return events_of(t, random.integers(0, size[0], n), random.integers(0, size[1], n), random.integers(0, 2, n))


def busy(n: int, size: tuple[int, int] = SIZE, duration_us: int = 200_000, seed: int = 0) -> Events:
    """n events anywhere."""
    random = np.random.default_rng(seed)
    return events_of(
        random.integers(0, duration_us, n),
        random.integers(0, size[0], n),
        random.integers(0, size[1], n),
        random.integers(0, 2, n),
    )


@st.composite
def streams(draw: st.DrawFn, most: int = 30) -> Events:
    """Few events of few pixels: many at the same microsecond, some far away, some before 0."""
    span = draw(st.sampled_from([3, 50, 2000, 30_000]))
    one = st.tuples(
        st.integers(-span // 3, span), st.integers(0, SIZE[0] - 1), st.integers(0, SIZE[1] - 1), st.integers(0, 1)
    )
    columns = np.array(draw(st.lists(one, max_size=most)), np.int64).reshape(-1, 4).T
    return events_of(*columns)
