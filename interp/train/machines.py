"""What training runs on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal, Self

from vid2ev.cores import usable_cores
from vid2ev.errors import UsageError
from vid2ev.terminal import counted


@dataclass(frozen=True, slots=True)
class Machines:
    """How many processes train on each machine, how many machines, and on what."""

    devices: int = 1
    nodes: int = 1
    accelerator: Literal["cuda", "cpu"] = "cpu"

    @classmethod
    def of(cls, devices: int | Literal["auto"], nodes: int, cpu: bool, processes: int) -> Self:
        """Machines as asked for: all GPUs by default; without one, or where it is not wanted, so many processes.

        Two processes of one thread take 1.4 times as many samples a second as one of two threads.  Raises UsageError
        for more GPUs than there are.
        """
        import torch

        gpus = 0 if cpu else torch.cuda.device_count()
        if devices == "auto":
            devices = gpus or processes
        elif gpus and devices > gpus:
            raise UsageError(f"--devices {devices}: expected up to {gpus}, the GPUs of this machine; or give --cpu")
        return cls(devices, nodes, "cuda" if gpus else "cpu")

    def check_batch(self, batch: int) -> None:
        """Raise UsageError where a batch cannot be shared out evenly."""
        check_shares(batch, self.devices * self.nodes)

    def check_clips(self, count: int) -> None:
        """Raise UsageError where there are fewer clips to validate with than processes that do."""
        if count < self.devices * self.nodes:
            raise UsageError(
                f"{counted(count, 'clip')} to validate with among {self.devices * self.nodes} processes, expected one"
                " each at least; set more validation.clips, or use fewer --devices"
            )

    def spare(self, threads: int) -> int:
        """Cores for what makes samples, for each process that trains, which takes so many threads; at least 1."""
        return max(1, usable_cores() // self.devices - threads)

    @property
    def first(self) -> bool:
        """Whether this process leads: those that it starts, and those of other machines, have their ranks set."""
        ranks = ("LOCAL_RANK", "RANK", "NODE_RANK", "SLURM_PROCID", "GROUP_RANK")
        return all(os.environ.get(rank, "0") in ("", "0") for rank in ranks)


def check_shares(batch: int, processes: int) -> None:
    """Raise UsageError where a batch cannot be shared out evenly."""
    if batch % processes:
        raise UsageError(
            f"batches of {batch} cannot be shared out evenly among {processes} processes;"
            " set batch to a multiple, or use fewer --devices"
        )


def check_installed() -> None:
    """Raise UsageError without the extra that training needs."""
    missing = [name for name in ("lightning", "tensorboard") if find_spec(name) is None]
    if missing:
        raise UsageError(f"training needs {' and '.join(missing)}; install them with pip install 'vid2ev[train]'")
