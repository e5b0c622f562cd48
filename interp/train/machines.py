"""What training runs on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal, Self

from vid2ev.errors import UsageError


@dataclass(frozen=True, slots=True)
class Machines:
    """Devices of each machine ("auto": all GPUs, or one process), how many machines, and the kind of device."""

    devices: int | Literal["auto"] = "auto"
    nodes: int = 1
    accelerator: Literal["auto", "cpu"] = "auto"

    @classmethod
    def of(cls, devices: int | Literal["auto"], nodes: int, cpu: bool, processes: int) -> Self:
        """Machines as asked for; those without a GPU, or where it is not wanted, get so many processes by default.

        Two processes of one thread take 1.4 times as many samples a second as one of two threads.
        """
        import torch

        without = cpu or not torch.cuda.is_available()
        return cls(processes if without and devices == "auto" else devices, nodes, "cpu" if cpu else "auto")

    def check_batch(self, batch: int) -> None:
        """Raise UsageError where a batch cannot be shared out evenly, among devices that are known."""
        if self.devices != "auto":
            check_shares(batch, self.devices * self.nodes)

    @property
    def first(self) -> bool:
        """Whether this process leads: those that it starts, and those of other machines, have their ranks set."""
        ranks = ("LOCAL_RANK", "RANK", "NODE_RANK", "SLURM_PROCID", "GROUP_RANK")
        return all(os.environ.get(rank, "0") in ("", "0") for rank in ranks)


ALL = Machines()


def check_shares(batch: int, processes: int) -> None:
    """Raise UsageError where a batch cannot be shared out evenly."""
    if batch % processes:
        raise UsageError(
            f"batches of {batch} cannot be shared out evenly among {processes} processes;"
            " set batch to a multiple, or use fewer --devices"
        )


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_installed() -> None:
    """Raise UsageError without the extra that training needs."""
    missing = [name for name in ("lightning", "tensorboard") if find_spec(name) is None]
    if missing:
        raise UsageError(f"training needs {' and '.join(missing)}; install them with pip install 'vid2ev[train]'")
