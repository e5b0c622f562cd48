"""Cutting blocks into tiles: nothing is lost, and all tiles come to take as long."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev import Dvs, load_sensor
from vid2ev.errors import UsageError
from vid2ev.sensors.tiles import Part, balanced


@given(
    sizes=st.lists(st.integers(1, 1000), min_size=1, max_size=9),
    seconds=st.lists(st.floats(0, 1e3), min_size=9, max_size=9),
)
def test_cuts_keep_every_block_in_one_tile(sizes, seconds):
    cuts = [int(cut) for cut in np.cumsum([0, *sizes])]
    fresh = balanced(cuts, seconds[: len(sizes)])
    assert len(fresh) == len(cuts) and fresh[0] == 0 and fresh[-1] == cuts[-1]
    assert all(first < last for first, last in pairwise(fresh))


@given(st.integers(2, 9), st.integers(0, 3), st.integers(0, 8), st.floats(1, 1e6))
def test_no_tile_is_empty_where_there_is_hardly_a_block_for_each(count, more, slow, times):
    cuts = [*range(count), count + more]
    for _ in range(5):
        cuts = balanced(cuts, [times if k == slow % count else 1.0 for k in range(count)])
        assert cuts[0] == 0 and cuts[-1] == count + more and all(a < b for a, b in pairwise(cuts))


def test_cuts_go_half_way_at_a_time():
    """To where both tiles would take as long it is 50 / 3 blocks."""
    assert balanced([0, 50, 100], [3.0, 1.0]) == [0, round(50 - 50 / 6), 100]


def test_cuts_settle_where_tiles_take_as_long():
    cost = np.linspace(1, 7, 1000)  # of a block
    cuts = [0, 250, 500, 750, 1000]
    for _ in range(12):
        cuts = balanced(cuts, [float(cost[first:last].sum()) for first, last in pairwise(cuts)])
    seconds = [cost[first:last].sum() for first, last in pairwise(cuts)]
    assert max(seconds) < 1.05 * min(seconds)


@pytest.mark.parametrize(
    "part", [Part(0, 5), Part(4, 5), Part(2, 2), Part(-1, 2), Part(0, 0), Part(0.5, 1), 3, (0,), (0, 1), "ab"]
)
def test_a_part_of_no_pixels_is_refused(part):
    with pytest.raises(UsageError, match=r"^part .*: expected Part"):
        Dvs(load_sensor("ideal"), (64, 64), part=part)  # (two blocks)
