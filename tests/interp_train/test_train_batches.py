"""Which samples a step takes: the step alone decides, whoever takes them."""

from __future__ import annotations

from itertools import chain, islice

import pytest

from interp.train.batches import Steps


@pytest.mark.parametrize("processes", [1, 2, 4])
def test_processes_share_what_one_would_take(processes: int) -> None:
    one = list(islice(Steps(0, 8), 5))
    shared = [list(islice(Steps(0, 8, rank, processes), 5)) for rank in range(processes)]
    assert one == [list(chain(*(parts[step] for parts in shared))) for step in range(5)]
    assert list(chain(*one)) == list(range(40))  # each sample once, in order


def test_steps_go_on_where_they_were() -> None:
    assert list(islice(Steps(3, 4), 2)) == list(islice(Steps(0, 4), 5))[3:]
