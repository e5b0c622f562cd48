"""Putting events in order: whatever the parts are, the answer is that of a plain stable sort."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.kernels.order import order_keys, unpack

WIDTH = 53


@given(
    sizes=st.lists(st.integers(0, 400), min_size=1, max_size=5),
    last_us=st.sampled_from([0, 1, 40, 65_535, 65_536, 3_000_000, (1 << 44) // 1000]),
    crowded=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=200, deadline=None)
def test_ordered_by_time_row_column(sizes, last_us, crowded, seed):
    rng = np.random.default_rng(seed)
    parts = []
    for k, size in enumerate(sizes):
        # Parts hold ascending pixels; a pixel's own events come in order of time, also at the same microsecond.
        pixel = 200 * k + np.sort(rng.integers(0, 200, size))
        time = rng.integers(0, min(last_us, 3) + 1 if crowded else last_us + 1, size)
        time = time[np.lexsort((time, pixel))]
        parts.append((time << 28 | pixel << 3 | rng.integers(0, 8, size)).astype(np.uint64))
    ends = np.cumsum([0, *sizes])
    n, keys = ends[-1], np.empty(ends[-1], np.uint64)
    for k, part in enumerate(parts):
        order_keys(*among_others(part, rng), last_us, keys[ends[k] : ends[k + 1]])
    t, x, y, p, label = (np.full(n, 77, dtype) for dtype in (np.int64, np.uint16, np.uint16, np.uint8, np.uint8))
    for share in range(len(parts)):
        unpack(keys, ends, share, len(parts), WIDTH, 1000, t, x, y, p, label)
    want = np.concatenate(parts)
    want = want[np.argsort(want >> np.uint64(3), kind="stable")].astype(np.int64)
    pixel = want >> 3 & 0x1FFFFFF
    assert np.array_equal(t, 1000 + (want >> 28))
    assert np.array_equal(y * np.int64(WIDTH) + x, pixel)
    assert np.array_equal(p, want >> 2 & 1)
    assert np.array_equal(label, want & 3)


def among_others(keys, rng):
    """The keys in runs, some of them empty, between others that are not meant: (all, where runs begin, and end)."""
    cuts = np.sort(rng.integers(0, len(keys) + 1, rng.integers(0, 4)))
    runs, begins, ends, count = [], [], [], 0
    for run in np.split(keys, cuts):
        others = rng.integers(0, 1 << 63, rng.integers(0, 3), np.uint64)
        begins.append(count + len(others))
        count = begins[-1] + len(run)
        ends.append(count)
        runs += [others, run]
    return np.concatenate(runs), np.array(begins), np.array(ends)
