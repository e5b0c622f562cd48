"""Long work of a page, each in a process of its own, with progress; it can be cancelled, and ends with the page.

A task is a function of `tell` and its arguments.  It calls `tell(done, of, text)` now and then, which raises
`Cancelled` when nobody wants the work any more; what it returns is the result.
"""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from vid2ev.gui.why import why_not

CANCELLED = "cancelled"
GRACE_S = 3.0  # until work that does not hear is ended


class Cancelled(Exception):
    """Nobody wants the work any more."""


class Progress(NamedTuple):
    """How far: `done` of `of` (None if there is no telling), and a few words."""

    done: float
    of: float | None
    text: str = ""


class Done(NamedTuple):
    """The end: what came out, or why not, in a sentence."""

    result: Any = None
    why_not: str | None = None

    @property
    def failed(self) -> bool:
        """Whether it did not work; what nobody wanted any more did not fail."""
        return self.why_not not in (None, CANCELLED)


Tell = Callable[[float, float | None, str], None]


class Job:
    """A task at work."""

    def __init__(self, task: Callable[..., Any], **arguments: Any):
        context = multiprocessing.get_context("spawn")
        # (without a lock, which a process that is killed would keep, or asked to end while it has it would wait for)
        self._cancelled: Any = context.RawValue("b", False)
        self._pipe, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_work, args=(task, theirs, self._cancelled, arguments), daemon=True)
        self._process.start()
        theirs.close()
        self.ended = False
        self._cancelled_s: float | None = None

    def news(self) -> Iterator[Progress | Done]:
        """What has come since the last call; the last of all is Done."""
        if self._cancelled_s is not None and time.monotonic() - self._cancelled_s > GRACE_S:
            self._process.kill()  # (it compiles, or opens a source, and cannot hear)
        try:
            while not self.ended and self._pipe.poll():
                said = self._pipe.recv()
                self.ended = isinstance(said, Done)
                yield said
        except (EOFError, OSError):
            self.ended = True
            yield Done(why_not=CANCELLED if self._cancelled.value else "the work's process has ended")

    def cancel(self) -> None:
        """Ask the task to end; `news` says when it has, and ends it if it does not hear."""
        self._cancelled.value = True
        self._cancelled_s = self._cancelled_s or time.monotonic()

    def close(self) -> None:
        """End the task, now if it does not hear."""
        self.cancel()
        self._process.join(timeout=GRACE_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self.ended = True
        self._pipe.close()

    @property
    def alive(self) -> bool:
        """Whether the process is there."""
        return self._process.is_alive()


def _work(task: Callable[..., Any], pipe: Connection, cancelled: Any, arguments: dict[str, Any]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end(*_: object) -> None:  # (the end of the program: leave nothing half done)
        cancelled.value = True

    signal.signal(signal.SIGTERM, end)

    def tell(done: float, of: float | None, text: str = "") -> None:
        if cancelled.value or not multiprocessing.parent_process().is_alive():  # type: ignore[union-attr]
            raise Cancelled
        pipe.send(Progress(done, of, text))

    try:
        outcome = Done(task(tell, **arguments))
    except Cancelled:
        outcome = Done(why_not=CANCELLED)
    except Exception as error:
        outcome = Done(why_not=why_not(error))
    try:
        pipe.send(outcome)
    except OSError:
        return
