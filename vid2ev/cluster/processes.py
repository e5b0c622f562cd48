"""Processes of this machine that share tasks, without Dask."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from typing import Any

from vid2ev.cluster.deaf import born_deaf, hearing
from vid2ev.errors import DataError

Submit = Callable[..., "Future[Any]"]  # a function that can be imported, and what it takes


@contextmanager
def if_they_begin() -> Iterator[None]:
    """What keeps processes from beginning, as few files that may be open or no shared memory, becomes one sentence."""
    try:
        yield
    except (RuntimeError, OSError) as error:  # (Dask has an error of its own for what the system said before it)
        first: BaseException = error
        while before := first.__cause__ or first.__context__:
            first = before
        if not isinstance(first, OSError):
            raise
        raise DataError(
            f"no processes to share the work with can begin here ({first.strerror or first}); give them what they lack,"
            " or do without (--jobs 1, or --workers 0 of train)"
        ) from error


@contextmanager
def processes(count: int, begin: Callable[[], object] | None = None) -> Iterator[Submit]:
    """So many processes, each of which calls `begin` at first; what this yields gives them a task.

    Whatever goes wrong within ends it as soon as the tasks that are begun have ended, and Ctrl-C, which a terminal
    sends to all processes and these leave to this one, at once: the others are dropped.  They end where this one is
    killed.  Raises DataError where one of them is killed, or none can begin.
    """
    others = active_children()
    # (processes that are not forked: threads of torch and numba do not survive it)
    with if_they_begin():
        made = ProcessPoolExecutor(count, get_context("spawn"), _begun, (begin,))
    with made as pool:

        def submit(*task: Any) -> Future[Any]:
            with if_they_begin(), born_deaf():
                return pool.submit(*task)

        try:
            yield submit
        except BrokenProcessPool as error:
            raise DataError(
                "a process that did part of the work was ended, for want of memory as a rule; make room, and go on with"
                " --resume"
            ) from error
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            if not isinstance(error, Exception):
                for each in active_children():
                    if each not in others:
                        each.kill()
            raise


def _begun(begin: Callable[[], object] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    hearing()
    end_with_parent()
    if begin:
        begin()


def end_with_parent() -> None:
    """End at once when the program does that began this process, whatever ended it; what is half done is so as after a
    kill."""
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
