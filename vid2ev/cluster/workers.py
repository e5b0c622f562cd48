"""Who does the tasks: processes of this machine, or the workers of a Dask scheduler, which may be anywhere."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from vid2ev.cluster import deaf
from vid2ev.cluster.processes import if_they_begin
from vid2ev.cores import usable_cores
from vid2ev.errors import DataError, UsageError

if TYPE_CHECKING:
    from distributed import Client

LEAST_BYTES = 128 << 20  # a process that does nothing yet takes half of it, and would be ended again and again
FILES, FILES_EACH = 16, 8  # that are open here at least, and for each process beside
REACHED_S = 20  # within which a scheduler has to answer
ONE_THREAD_EACH = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
HERE = {  # of Dask's configuration: a process ends at its limit of memory, and is not paused or spilled to disk before
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
}


@dataclass(frozen=True)
class Workers:
    """Who does tasks, and how often a task is tried.

    jobs       processes of this machine
    scheduler  address of a Dask scheduler, such as tcp://10.0.0.1:8786; None for processes of this machine
    retries    how often a task is tried again after an error or the death of its worker
    memory     of each process here, such as "4 GiB"; by default its share of the machine's
    Raises UsageError for a memory in which no process can begin.
    """

    jobs: int = 1
    scheduler: str | None = None
    retries: int = 2
    memory: str | None = None

    def __post_init__(self) -> None:
        if self.memory is not None and has_dask():
            _bytes_of(self.memory)  # (raises UsageError)

    @property
    def alone(self) -> bool:
        """Whether there is nothing to share out: one process, this one."""
        return self.jobs == 1 and self.scheduler is None

    @property
    def threads(self) -> int:
        """Threads of each task: its share of the cores here; one on a cluster, whose workers are given cores."""
        return 1 if self.scheduler else max(1, usable_cores() // self.jobs)

    @contextmanager
    def client(self) -> Iterator[Client]:
        """A client of the scheduler, or of one that is started here with its processes and ends with them.

        Raises UsageError where Dask is not installed or what is asked cannot be meant, DataError where none answers.
        """
        if not has_dask():
            raise UsageError(
                "--jobs and --scheduler share work out by Dask, which is not installed; pip install 'vid2ev[cluster]'"
            )
        if self.scheduler is None:
            with self._here() as client:
                yield client
            return
        from distributed import Client

        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # (what matters of it is said in a sentence)
        try:
            client = Client(self.scheduler, timeout=REACHED_S)
        except ValueError as error:
            raise UsageError(f"--scheduler {self.scheduler}: expected an address such as tcp://host:8786") from error
        except OSError as error:
            raise DataError(
                f"no Dask scheduler answers at {self.scheduler}; start one with `dask scheduler`, and take the address"
                " that it prints"
            ) from error
        with client:
            yield client

    @contextmanager
    def _here(self) -> Iterator[Client]:
        import dask
        from distributed import Client, LocalCluster

        _check_files(self.jobs)
        threads = dict.fromkeys(ONE_THREAD_EACH, str(self.threads))
        memory: Any = 1 / self.jobs if self.memory is None else _bytes_of(self.memory)
        begun = dask.config.set(HERE | {"distributed.scheduler.allowed-failures": self.retries})
        with ExitStack() as ends:
            with if_they_begin(), begun, deaf.born_deaf():
                cluster = ends.enter_context(LocalCluster(
                    n_workers=self.jobs, threads_per_worker=1, memory_limit=memory, host="127.0.0.1",
                    dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False},  # (or else one fixed port)
                    silence_logs=logging.CRITICAL, env=threads, preload=deaf.__name__,
                ))  # fmt: skip
                client = ends.enter_context(Client(cluster))
            yield client


def has_dask() -> bool:
    """Whether the extra `cluster` is installed."""
    return find_spec("distributed") is not None


def _check_files(jobs: int) -> None:
    """Raise DataError where so few files may be open that Dask could not begin: it would try again and again."""
    if find_spec("resource") is None:  # (on Windows)
        return
    import resource

    most, least = resource.getrlimit(resource.RLIMIT_NOFILE)[0], FILES + FILES_EACH * jobs
    if 0 <= most < least:
        raise DataError(
            f"{jobs} processes to share the work with need {least} open files or more, and {most} may be; raise that"
            " (ulimit -n), or do without (--jobs 1)"
        )


def _bytes_of(memory: str) -> int:
    from dask.utils import parse_bytes

    try:
        found = parse_bytes(memory)
    except (ValueError, OverflowError):
        found = 0
    if found < LEAST_BYTES:
        raise UsageError(f"--memory {memory}: expected a size such as 4GiB, at least {LEAST_BYTES >> 20}MiB")
    return found
