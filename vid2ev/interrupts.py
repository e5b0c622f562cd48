"""What asks a program to end; and Ctrl-C while compiled code runs, or is made.

Python hears signals between its own instructions.  The first ones after compiled code are those of a function by which
Numba (0.68) makes arrays of what that code returns, and Numba does not look whether it raised: a KeyboardInterrupt
there comes out as a SystemError, which nobody takes for Ctrl-C.  While it compiles or loads what it has compiled, LLVM
calls it back, and what is raised there nobody gets: Numba goes on, or complains that it was not served.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from traceback import clear_frames
from types import FrameType
from typing import Any

ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
RETURNING = "_numba_unpickle"


def deaf_once(_: object = None) -> None:
    """Let SIGTERM end this process the second time only: then it is from who began it, and not for all of a group."""

    def end_next_time(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    signal.signal(signal.SIGTERM, end_next_time)


@contextmanager
def found_again() -> Iterator[None]:
    """Within it, a KeyboardInterrupt that compiled code has made a SystemError of is one again."""
    try:
        yield
    except SystemError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        raise KeyboardInterrupt from error


class Asked:
    """What is known of a program's being asked to end, by a KeyboardInterrupt that somebody has to get."""

    def __init__(self) -> None:
        self.to_end = self._waiting = False

    def again_soon(self) -> None:
        """It was lost: it is raised again in a second, wherever the main thread is by then, unless that is `over`."""
        self.to_end = self._waiting = True
        _thread.start_new_thread(self._again, ())  # (one of `threading` takes a lock, which may be taken where this is)

    def _again(self) -> None:
        time.sleep(1)
        if self._waiting:
            self._waiting = False
            _thread.interrupt_main()

    def over(self) -> None:
        """Somebody has got it, or nobody is left to."""
        self._waiting = False


@contextmanager
def never_lost() -> Iterator[Asked]:
    """Within it, a KeyboardInterrupt that nobody gets is raised again, and what goes wrong after it is one, too; for
    the main thread.  What it leaves half made goes before this ends, and complains to nobody."""
    asked = Asked()

    def note(told: Any) -> None:
        if told.exc_type is KeyboardInterrupt:
            asked.again_soon()
        elif not asked.to_end:
            before(told)

    before, sys.unraisablehook = sys.unraisablehook, note
    try:
        with found_again():
            yield asked
    except KeyboardInterrupt as error:
        asked.to_end = True
        clear_frames(error.__traceback__)
        raise
    except Exception as error:
        if not asked.to_end:
            raise
        clear_frames(error.__traceback__)
        raise KeyboardInterrupt from error
    finally:
        asked.over()
        sys.unraisablehook = before


@contextmanager
def heard(gently: bool = False) -> Iterator[Callable[[], bool]]:
    """Within it, what asks a program to end does so as Ctrl-C does, even where Python loses that, as in a callback of
    compiled code: what is half made is removed, or said to be kept.  What this yields raises it at once.

    `gently` lets it return True the first time instead: a camera has no other end.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    times = 0
    with never_lost() as asked:

        def note(_number: int, at: FrameType | None) -> None:
            nonlocal times
            times += 1
            if times <= gently:
                return
            first, asked.to_end = not asked.to_end, True
            if first and at is not None and at.f_code.co_name == RETURNING:
                asked.again_soon()  # (who checks is told before)
            else:
                raise KeyboardInterrupt

        def check() -> bool:
            if asked.to_end:
                asked.over()
                raise KeyboardInterrupt
            return times > 0

        before = {each: signal.signal(each, note) for each in _untaken()}
        try:
            yield check
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)


def _untaken() -> list[signal.Signals]:
    """Ctrl-C's, and the other signals that ask to end and that nobody else has taken: SIGTERM, SIGHUP."""
    return [each for each in ENDING if each == signal.SIGINT or signal.getsignal(each) is signal.SIG_DFL]
