"""Processes of this machine that share tasks, without Dask."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from vid2ev.errors import DataError

Submit = Callable[..., "Future[Any]"]  # a function that can be imported, and what it takes


@contextmanager
def processes(count: int, begin: Callable[[], object] | None = None) -> Iterator[Submit]:
    """So many processes, each of which calls `begin` at first; what this yields gives them a task.

    Whatever goes wrong within, Ctrl-C included, ends it as soon as the tasks that are begun have ended: the others are
    dropped.  Raises DataError where one of the processes is killed.
    """
    # (processes that are not forked: threads of torch and numba do not survive it)
    with ProcessPoolExecutor(count, get_context("spawn"), begin) as pool:
        try:
            yield pool.submit
        except BrokenProcessPool as error:
            raise DataError(
                "a process that did part of the work was ended, for want of memory as a rule; make room, and go on with"
                " --resume"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
