"""A process that makes previews for one page: it answers the newest request, and what was asked before is given up, but
for what is about to be seen: while a slider moves there would be nothing.

It ends with the page, or with the program: its pipe then closes.  What is compiled or rendered there never holds up the
page.
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from queue import Empty, Queue
from threading import Lock, Thread
from typing import Any, NamedTuple

from vid2ev.gui.light import Light
from vid2ev.gui.preview import Answer, Plans, Previewer, Request, plans_of
from vid2ev.gui.why import why_not

CALM_S = 0.3  # after a preview, before its plan
PATIENCE_S = 1.0  # that a preview has for its first picture when something newer is asked for


class Refused(NamedTuple):
    """Why there is no answer, in a sentence, or no plan of one that came (`answered`)."""

    number: int
    why: str
    answered: bool = False


Reply = Answer | Plans | Refused


class Superseded(Exception):
    """Something newer was asked for."""


class Worker:
    """A preview process; `ask` never waits, `replies` are those that are there."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._newest: Any = context.RawValue("q", 0)  # (without a lock, which a process that is killed would keep)
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._newest), daemon=True)
        self._process.start()
        theirs.close()
        self._waiting: Request | None = None
        self._asked = 0
        self._asked_s = 0.0
        self._answered = False
        self.busy = False

    def ask(self, request: Request) -> None:
        """Ask for a preview, in place of what was asked before."""
        self._waiting = request
        self._send()
        self._hurry()

    def replies(self) -> Iterator[Reply]:
        """What has come since the last call; Refused if the process has ended."""
        try:
            while self._pipe.poll():
                reply = self._pipe.recv()
                if reply is None:  # (done with a request, or given up)
                    self.busy = False
                    self._send()
                elif reply.number >= self._asked:
                    self._answered |= isinstance(reply, Answer)
                    yield reply
            self._hurry()
        except (EOFError, OSError):
            if self.busy:
                self.busy = False
                yield Refused(self._asked, "the preview's process has ended; reload the page to start another")

    def close(self) -> None:
        """End the process and whatever it does."""
        self._pipe.close()
        self._process.terminate()
        self._process.join(timeout=1)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    @property
    def alive(self) -> bool:
        """Whether the process is there."""
        return self._process.is_alive()

    def _send(self) -> None:
        if self._waiting is not None and not self.busy:
            request, self._waiting = self._waiting, None
            self._asked, self._asked_s, self._answered, self.busy = request.number, time.monotonic(), False, True
            self._newest.value = request.number
            try:
                self._pipe.send(request)
            except OSError:
                return

    def _hurry(self) -> None:
        """Have what is at work given up for what waits, once it was seen or has had its time."""
        if self._waiting is not None and (self._answered or time.monotonic() - self._asked_s > PATIENCE_S):
            self._newest.value = self._waiting.number


class Planner(Thread):
    """Makes the plans of the newest preview, beside the next previews: what plans measure with is compiled, too."""

    def __init__(self, send: Callable[[Any], None], newest: Callable[[], int]):
        super().__init__(daemon=True)
        self._send, self._newest = send, newest
        self._coming: Queue[tuple[Light, int]] = Queue(maxsize=1)

    def plan(self, light: Light, number: int) -> None:
        """Plan the cameras of this light, unless another preview is asked for, in place of what waits."""
        with suppress(Empty):  # (while time plays there is one after the other: each waiting its turn, and its light)
            self._coming.get_nowait()
        self._coming.put((light, number))

    def run(self) -> None:
        """Plan what comes."""
        while True:
            light, number = self._coming.get()
            time.sleep(CALM_S)

            def check(number: int = number) -> None:
                if self._newest() != number:
                    raise Superseded

            try:
                check()
                self._send(plans_of(light, number, check))
            except Superseded:
                pass
            except Exception as error:  # (the pictures are there, whatever happens to the plan)
                self._send(Refused(number, f"no plan: {why_not(error)}", answered=True))


def _serve(pipe: Connection, newest: Any) -> None:
    """Answer requests until the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    number, sending = 0, Lock()

    def check() -> None:
        if newest.value != number:
            raise Superseded

    def send(reply: Any) -> None:
        with sending, suppress(OSError):
            pipe.send(reply)
            return
        # (nobody listens any more: this thread ends, and with the main one the process.  An end that is raised while
        # the error is handled keeps what was to be sent, and Python 3.13.0 complains of that as it clears up)
        sys.exit()

    previewer, planner = Previewer(check), Planner(send, lambda: newest.value)
    planner.start()
    while True:
        try:
            request = pipe.recv()
        except (EOFError, OSError):
            return
        number = request.number
        try:
            check()
            for answer in previewer.answers(request):
                send(answer)
            planner.plan(previewer.light(request), number)
        except Superseded:
            pass
        except Exception as error:  # a page goes on, whatever happens in its preview
            send(Refused(number, why_not(error)))
        send(None)
