"""Putting events in order: whatever the parts are, the answer is that of a plain stable sort."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.kernels.order import order_keys, unpack
from vid2ev.sensors.tiles import balanced

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
        order_keys(part, last_us, keys[ends[k] : ends[k + 1]])
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


@given(
    sizes=st.lists(st.integers(1, 1000), min_size=1, max_size=9),
    seconds=st.lists(st.floats(0, 1e3), min_size=9, max_size=9),
)
def test_cuts_keep_every_block_in_one_tile(sizes, seconds):
    cuts = [int(cut) for cut in np.cumsum([0, *sizes])]
    fresh = balanced(cuts, seconds[: len(sizes)])
    assert len(fresh) == len(cuts) and fresh[0] == 0 and fresh[-1] == cuts[-1]
    assert all(first < last for first, last in pairwise(fresh))


def test_cuts_settle_where_tiles_take_as_long():
    cost = np.linspace(1, 7, 1000)  # of a block
    cuts = [0, 250, 500, 750, 1000]
    for _ in range(12):
        cuts = balanced(cuts, [float(cost[first:last].sum()) for first, last in pairwise(cuts)])
    seconds = [cost[first:last].sum() for first, last in pairwise(cuts)]
    assert max(seconds) < 1.05 * min(seconds)
