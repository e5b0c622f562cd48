"""A task, as its worker does it: in the folder that it was asked for in, telling how far it is."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vid2ev.errors import DataError, UsageError

TOLD_EVERY_S = 0.5

Tell = Callable[[Mapping[str, Any]], None]  # takes how far a task is, ready for JSON; raises Dropped


class Dropped(BaseException):
    """Nobody waits for the task any more."""


@dataclass(frozen=True)
class Task:
    """Something to do, under a name that no other task has; `call`, with what it is bound to, travels by pickle."""

    name: str
    call: Callable[[Tell], Any]


@dataclass(frozen=True)
class Refused:
    """A request that cannot be meant, which trying again does not mend."""

    error: UsageError


@dataclass(frozen=True)
class GoOn:
    """What a task gives that is not done, and that another worker may go on with: the call that does so."""

    call: Callable[[Tell], Any]


def share_of(done: float, total: float | None) -> dict[str, float]:
    """How much of a task is done, as `Tell` takes it; nothing where nobody knows of how much, or it is of nothing."""
    return {"share": min(done / total, 1.0)} if total else {}


def done_on_worker(task: Task, folder: str, topic: str) -> Any:
    """What the task gives, perhaps `GoOn`, or `Refused`; its errors go to Dask, which tries again."""
    from distributed import get_worker

    from vid2ev.compiling.heard import telling_of

    worker = get_worker()
    key = worker.get_current_task()
    told_s = 0.0

    def log(facts: Mapping[str, Any]) -> None:
        worker.log_event(topic, {"task": task.name, "pid": os.getpid(), **facts})

    def tell(facts: Mapping[str, Any]) -> None:
        nonlocal told_s
        if time.monotonic() < told_s + TOLD_EVERY_S:
            return
        told_s = time.monotonic()
        state = worker.state.tasks.get(key)
        if state is None or state.state == "cancelled":
            raise Dropped
        log(facts)

    log({"begun": True})
    if not Path(folder).is_dir():
        raise DataError(
            f"{socket.gethostname()} has no folder {folder}: expected the same folders on all machines, of a shared"
            " file system"
        )
    os.chdir(folder)
    try:
        with telling_of(lambda begins: log({"compiling": begins})):
            return task.call(tell)
    except UsageError as error:
        return Refused(error)
