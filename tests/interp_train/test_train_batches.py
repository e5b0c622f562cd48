"""Which samples a step takes: the step alone decides, whoever takes them."""

from __future__ import annotations

from itertools import chain, islice

import pytest
from torch.utils.data import DataLoader, Dataset

from interp.train.batches import Steps
from interp.train.fit import made_by_workers, unmentioned
from vid2ev.errors import DataError, DiskError, UsageError


@pytest.mark.parametrize("processes", [1, 2, 4])
def test_processes_share_what_one_would_take(processes: int) -> None:
    one = list(islice(Steps(0, 8), 5))
    shared = [list(islice(Steps(0, 8, rank, processes), 5)) for rank in range(processes)]
    assert one == [list(chain(*(parts[step] for parts in shared))) for step in range(5)]
    assert list(chain(*one)) == list(range(40))  # each sample once, in order


def test_steps_go_on_where_they_were() -> None:
    assert list(islice(Steps(3, 4), 2)) == list(islice(Steps(0, 4), 5))[3:]


class Unmade(Dataset[int]):
    """A sample that cannot be made."""

    def __init__(self, error: Exception):
        self.error = error

    def __len__(self) -> int:
        return 1

    def __getitem__(self, _: int) -> int:
        raise self.error


@pytest.mark.parametrize("workers", [0, 1])
@pytest.mark.parametrize("kind", [UsageError, DataError, DiskError])
def test_what_makes_samples_says_one_sentence_whichever_process_it_is(kind: type[Exception], workers: int) -> None:
    said = "clips cannot be written: No space left on device; make room"
    with pytest.raises(kind) as error, made_by_workers():
        list(DataLoader(Unmade(kind(said)), num_workers=workers))
    assert type(error.value) is kind and str(error.value) == said


@pytest.mark.parametrize("workers", [1, 2, 1000])
def test_more_workers_than_cores_are_nothing_that_torch_warns_of(workers: int) -> None:
    """Who asks for them has said so, and `--quiet` means errors only.  (A warning fails a test.)"""
    with unmentioned():
        DataLoader(Unmade(UsageError("never asked for")), num_workers=workers)
