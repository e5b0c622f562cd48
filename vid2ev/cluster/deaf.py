"""Processes of `--jobs` are deaf to what asks to end, which a terminal or a service sends to all of a group: it is the
business of the command, which then ends them.  Dask loads this into each."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

from vid2ev.interrupts import ENDING, deaf_once


def dask_setup(_: object) -> None:
    """Called by Dask when the process begins."""
    for each in ENDING:
        signal.signal(each, signal.SIG_IGN)
    deaf_once()
    hearing()


def hearing() -> None:
    """Said by a process that was born deaf, when it has said what it does of what it hears."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


@contextmanager
def born_deaf() -> Iterator[None]:
    """Processes that begin within, or by threads that do, hear nothing until they are `hearing`; here all is heard in
    the end."""
    if not hasattr(signal, "pthread_sigmask"):  # (not on Windows)
        yield
        return
    resource_tracker.ensure_running()  # (Python has the thread that begins it hear again)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
