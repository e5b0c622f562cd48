"""Which samples a step takes: step n of batches of b takes samples n b ... n b + b - 1.

Samples are a function of their number, so the step is all there is to know of the position in the data: training goes
on where it was, with any number of processes and workers.  Of W processes, process r takes the r-th of W equal parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import Any

import torch
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Dataset, Sampler

from interp.data.ahead import Ahead
from interp.train.machines import check_shares
from vid2ev.interrupts import deaf_once

Batch = dict[str, torch.Tensor]  # as of `interp.data`, with a dimension more in front


class Steps(Sampler[list[int]]):
    """The numbers of the samples of each step from `first` on, without end; those of one process.

    `reached` is told the first of each.
    """

    def __init__(
        self, first: int, batch: int, rank: int = 0, processes: int = 1, reached: Callable[[int], None] | None = None
    ):
        self.first, self.batch, self.rank, self.processes = first, batch, rank, processes
        self._reached = reached

    def __iter__(self) -> Iterator[list[int]]:
        part = self.batch // self.processes
        for step in count(self.first):
            start = step * self.batch + self.rank * part
            if self._reached:
                self._reached(start)
            yield list(range(start, start + part))


class Feed(LightningDataModule):
    """Samples to train with and clips to validate with, for Lightning.

    training     sample i is a function of i; it is asked for i without end
    validation   batches of one clip each, and the group of clips that it belongs to
    batch        samples per step, of all processes together
    workers      processes that make samples, for each process that trains; 0 makes them in between steps
    ahead        who makes the clips of later, if that is not they
    Raises UsageError where a batch cannot be shared out evenly.
    """

    def __init__(
        self,
        training: Dataset[Any],
        validation: Sequence[tuple[str, Batch]],
        batch: int,
        workers: int,
        ahead: Ahead | None = None,
    ):
        super().__init__()
        self.training, self.validation = training, validation
        self.batch, self.workers, self._ahead = batch, workers, ahead

    def train_dataloader(self) -> DataLoader[Any]:
        """From the trainer's step on."""
        trainer = self.trainer
        assert trainer is not None
        check_shares(self.batch, trainer.world_size)
        reached = self._ahead.reached if self._ahead else None
        steps = Steps(trainer.global_step, self.batch, trainer.global_rank, trainer.world_size, reached)
        return DataLoader(
            self.training,
            batch_sampler=steps,
            num_workers=self.workers,
            persistent_workers=self.workers > 0,
            worker_init_fn=deaf_once,  # (where all processes are asked to end, a step is still to be made)
            pin_memory=trainer.strategy.root_device.type == "cuda",
        )

    def close(self) -> None:
        """End whoever makes clips."""
        if self._ahead:
            self._ahead.close()

    def val_dataloader(self) -> DataLoader[Any]:
        """Every process's share of the clips: each W-th."""
        trainer = self.trainer
        assert trainer is not None
        mine = self.validation[trainer.global_rank :: trainer.world_size]
        return DataLoader(mine, batch_size=None)  # type: ignore[arg-type]

    def is_first_of_group(self, number: int) -> bool:
        """Whether the clip of this number among a process's own is the first of its group among all."""
        assert self.trainer is not None
        place = self.trainer.global_rank + number * self.trainer.world_size
        groups = [group for group, _ in self.validation]
        return groups.index(groups[place]) == place
