"""What asks a program to end; and Ctrl-C while compiled code runs, or is made.

Python hears signals between its own instructions.  The first ones after compiled code are those of a function by which
Numba (0.68) makes arrays of what that code returns, and Numba does not look whether it raised: a KeyboardInterrupt
there comes out as a SystemError, which nobody takes for Ctrl-C.  While it compiles, LLVM calls it back, and what is
raised there nobody gets: Numba goes on without what it was called for, and complains of that.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
RETURNING = "_numba_unpickle"


def deaf_once(_: object = None) -> None:
    """Let SIGTERM end this process the second time only: then it is from who began it, and not for all of a group."""

    def end_next_time(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    signal.signal(signal.SIGTERM, end_next_time)


def is_lost(at: FrameType | None) -> bool:
    """Whether an exception that a signal raises there is lost."""
    return at is not None and at.f_code.co_name == RETURNING


@contextmanager
def found_again() -> Iterator[None]:
    """Within it, a KeyboardInterrupt that compiled code has made a SystemError of is one again."""
    try:
        yield
    except SystemError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        raise KeyboardInterrupt from error


@contextmanager
def never_lost() -> Iterator[None]:
    """The same, and what goes wrong after a KeyboardInterrupt that nobody got is one, too; for the main thread."""
    lost = False

    def note(told: Any) -> None:
        nonlocal lost
        if told.exc_type is KeyboardInterrupt:
            lost = True
        else:
            before(told)

    before, sys.unraisablehook = sys.unraisablehook, note
    try:
        with found_again():
            yield
    except Exception as error:
        if not lost:
            raise
        raise KeyboardInterrupt from error
    finally:
        sys.unraisablehook = before
