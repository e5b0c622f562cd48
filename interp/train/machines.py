"""What training runs on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal

from vid2ev.errors import UsageError


@dataclass(frozen=True, slots=True)
class Machines:
    """Devices of each machine ("auto": all GPUs, or one process without), how many machines, and the kind of device."""

    devices: int | Literal["auto"] = "auto"
    nodes: int = 1
    accelerator: Literal["auto", "cpu"] = "auto"

    @property
    def first(self) -> bool:
        """Whether this process leads: those that it starts, and those of other machines, have their ranks set."""
        ranks = ("LOCAL_RANK", "RANK", "NODE_RANK", "SLURM_PROCID", "GROUP_RANK")
        return all(os.environ.get(rank, "0") in ("", "0") for rank in ranks)


ALL = Machines()


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_installed() -> None:
    """Raise UsageError without the extra that training needs."""
    missing = [name for name in ("lightning", "tensorboard") if find_spec(name) is None]
    if missing:
        raise UsageError(f"training needs {' and '.join(missing)}; install them with pip install 'vid2ev[train]'")
