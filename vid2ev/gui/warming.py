"""Compiles what stands in for the usual sensors (`gui.stand_in`) while a page is open, at the lowest priority where a
process can lower its own.

What is compiled stays on disk: after the first time, this takes seconds.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from multiprocessing.connection import Connection
from typing import Any

from vid2ev.cluster.processes import end_with_parent
from vid2ev.gui.stand_in import see_something, usual
from vid2ev.kernels.layout import Flags
from vid2ev.sensors.compiled import flags_of


class Warming:
    """The work for all pages of a program: it goes on while there are any.  `ready` is what is done."""

    def __init__(self) -> None:
        self._pages = 0
        self._process: Any = None
        self._pipe: Connection | None = None
        self._ready: frozenset[Flags] = frozenset()

    def enter(self) -> None:
        """There is another page."""
        self._pages += 1

    def leave(self) -> None:
        """A page is gone."""
        self._pages -= 1
        if self._pages == 0:
            self._end()

    def begin(self) -> None:
        """Begin, if it has not begun."""
        if self._process is None and self._pages > 0:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe(duplex=False)
            self._process = context.Process(target=_warm, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()

    @property
    def ready(self) -> frozenset[Flags]:
        """The kernels that are on disk."""
        try:
            while self._pipe is not None and self._pipe.poll():
                self._ready |= {self._pipe.recv()}
        except (EOFError, OSError):  # (all is done; the process is kept, so that it does not begin again)
            self._pipe = None
        return self._ready

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = self._pipe = None


def _warm(pipe: Connection) -> None:
    """Compile the usual sensors."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()  # (what is compiled half is compiled another time)
    if hasattr(os, "nice"):  # (Windows has none)
        os.nice(19)
    for spec in usual():
        see_something(spec)
        try:
            pipe.send(flags_of(spec, False))
        except OSError:
            return
