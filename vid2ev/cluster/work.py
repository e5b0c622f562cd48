"""Many tasks, shared out: results as they come, errors as sentences, whatever happens to workers."""

from __future__ import annotations

import os
import uuid
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from vid2ev.cluster.task import GoOn, Refused, Task, done_on_worker
from vid2ev.cluster.workers import Workers
from vid2ev.errors import DataError

if TYPE_CHECKING:
    from distributed import Client, Future

OUT_OF_MEMORY = "worker-restart-memory"  # under which Dask's nannies say whom they ended
REMEDY = "give each worker more (--memory here), or run fewer at a time (--jobs)"

Watch = Callable[[str, Mapping[str, Any]], object]  # a task's name, and what it tells, such as {"begun": True} at first


class WorkerLost(DataError):
    """A task was not done for want of memory, or because its workers died; another machine may well do it."""


class Outcome(NamedTuple):
    """What a task gave, or the error that it ended with at last."""

    name: str
    value: Any = None
    error: Exception | None = None


Share = Callable[[Sequence[Task], Workers], Iterator[Outcome]]  # `outcomes`, or the same with something to see


@dataclass
class _Lives:
    """The processes that each task was begun in."""

    pids: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))

    def note(self, facts: Mapping[str, Any]) -> None:
        if facts.get("begun"):
            self.pids[facts["task"]].append(facts["pid"])


def outcomes(tasks: Sequence[Task], workers: Workers, watch: Watch | None = None) -> Iterator[Outcome]:
    """The outcome of each task, in whatever order they come.

    A task that gives `GoOn` is gone on with.  A task that fails is tried again `workers.retries` times, unless it is a
    request that cannot be meant; so is one whose worker dies, as of memory.  Tasks are to be such that they go on where
    another was, or begin anew, to the same result.  `watch` is told in a thread of its own what tasks tell.

    Raises DataError where the scheduler is gone, and what `Workers.client` does.
    """
    if not tasks:
        return
    topic, lives, names = f"vid2ev-{uuid.uuid4().hex}", _Lives(), dict[str, str]()
    with workers.client() as client:

        def heard(event: tuple[float, dict[str, Any]]) -> None:
            lives.note(event[1])
            if watch:
                watch(event[1]["task"], event[1])

        def submitted(task: Task) -> Future:
            key = f"{topic}-{uuid.uuid4().hex}"
            names[key] = task.name
            return client.submit(done_on_worker, task, os.getcwd(), topic, key=key, retries=workers.retries, pure=False)

        client.subscribe_topic(topic, heard)
        yield from _as_they_come({task.name: task for task in tasks}, workers, client, submitted, names, lives)


def _as_they_come(
    tasks: dict[str, Task],
    workers: Workers,
    client: Client,
    submitted: Callable[[Task], Future],
    names: dict[str, str],
    lives: _Lives,
) -> Iterator[Outcome]:
    from distributed import KilledWorker, as_completed

    blamed: dict[str, int] = defaultdict(int)
    coming = as_completed([submitted(task) for task in tasks.values()])
    for future in coming:
        name = names[future.key]
        if future.status == "finished":
            value = future.result()
            if isinstance(value, GoOn):
                tasks[name] = replace(tasks[name], call=value.call)
                lives.pids[name].clear()
                blamed[name] = 0
                coming.add(submitted(tasks[name]))
                continue
            yield Outcome(name, error=value.error) if isinstance(value, Refused) else Outcome(name, value)
        elif future.status == "error":
            error = future.exception()
            if isinstance(error, KilledWorker):
                # Dask blames all tasks that a worker had, also those that waited there: these are not to suffer.
                blamed[name] += 1
                if max(blamed[name], len(lives.pids[name])) <= workers.retries:
                    coming.add(submitted(tasks[name]))
                    continue
                error = _of_deaths(name, client, lives.pids[name])
            yield Outcome(name, error=_said(name, error))
        elif future.status in ("lost", "pending"):  # (its worker died with the result, and Dask has it made again)
            coming.add(future)
        else:
            raise DataError(
                f"the scheduler{f' at {workers.scheduler}' if workers.scheduler else ''} is gone; what is done is kept,"
                " the same command with --resume goes on"
            )


def _of_deaths(name: str, client: Client, pids: Sequence[int]) -> WorkerLost:
    """Why the workers of a task died."""
    events = client.get_events(OUT_OF_MEMORY)
    taken = {event["pid"]: event["rss"] for _, event in events if event["pid"] in pids}
    times = f"{len(pids)} time{'s' * (len(pids) != 1)}"
    if taken:
        size = f"{max(taken.values()) / 2**30:.2g} GiB"
        return WorkerLost(f"{name} ran out of memory: its worker was ended {times}, at {size}; {REMEDY}")
    return WorkerLost(f"{name}: its worker died {times}, as it does when the machine's memory runs out; {REMEDY}")


def _said(name: str, error: BaseException) -> Exception:
    """The error as people read it."""
    if isinstance(error, MemoryError):
        return WorkerLost(f"{name} ran out of memory ({error}); {REMEDY}")
    return error if isinstance(error, Exception) else DataError(f"{type(error).__name__}: {error}")
