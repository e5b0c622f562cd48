"""Processes of this machine that share tasks, without Dask."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

Submit = Callable[..., "Future[Any]"]  # a function that can be imported, and what it takes


@contextmanager
def processes(count: int, begin: Callable[[], object] | None = None) -> Iterator[Submit]:
    """So many processes, each of which calls `begin` at first; what this yields gives them a task.

    Whatever goes wrong within, Ctrl-C included, ends it as soon as the tasks that are begun have ended: the others are
    dropped.
    """
    # (processes that are not forked: threads of torch and numba do not survive it)
    with ProcessPoolExecutor(count, get_context("spawn"), begin) as pool:
        try:
            yield pool.submit
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
