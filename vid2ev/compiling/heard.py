"""Whoever waits while something is compiled is told so: it takes seconds to minutes, in which nothing else is seen."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from threading import Lock

from numba.core.event import Event, Listener, install_listener, trigger_event

COMPILE = "numba:compile"  # of what this process compiles, and of what it waits for (`waiting`); not of what is on disk


class _Ear(Listener):
    """Counts what is being compiled, as one thing calls for another, and threads for several."""

    def __init__(self, tell: Callable[[bool], object]):
        self._tell, self._under_way, self._lock = tell, 0, Lock()

    def on_start(self, event: Event) -> None:
        with self._lock:
            self._under_way += 1
            if self._under_way == 1:
                self._tell(True)

    def on_end(self, event: Event) -> None:
        with self._lock:
            self._under_way -= 1
            if self._under_way == 0:
                self._tell(False)


def telling_of(tell: Callable[[bool], object]) -> AbstractContextManager[None]:
    """`tell` is told within, by whatever thread compiles, when that begins (True) and ends (False)."""
    return install_listener(COMPILE, _Ear(tell))


def waiting() -> AbstractContextManager[None]:
    """What is compiled by another process, for which this one waits within."""
    return trigger_event(COMPILE)
