"""A process that makes previews for one page: it answers the newest request, and what was asked before is given up.

It ends with the page, or with the program: its pipe then closes.  What is compiled or rendered there never holds up the
page.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from vid2ev.errors import Vid2evError
from vid2ev.gui.preview import Answer, Plans, Previewer, Request


class Refused(NamedTuple):
    """Why there is no answer, in a sentence."""

    number: int
    why: str


Reply = Answer | Plans | Refused


class Superseded(Exception):
    """Something newer was asked for."""


class Worker:
    """A preview process; `ask` never waits, `replies` are those that are there."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._newest: Any = context.Value("q", 0)
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, self._newest), daemon=True)
        self._process.start()
        theirs.close()
        self._waiting: Request | None = None
        self._asked = 0
        self.busy = False

    def ask(self, request: Request) -> None:
        """Ask for a preview, in place of what was asked before."""
        self._waiting = request
        self._newest.value = request.number
        self._send()

    def replies(self) -> Iterator[Reply]:
        """What has come since the last call; Refused if the process has ended."""
        try:
            while self._pipe.poll():
                reply = self._pipe.recv()
                if reply is None:  # (done with a request, or given up)
                    self.busy = False
                    self._send()
                elif reply.number >= self._asked:
                    yield reply
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
            self._asked, self.busy = request.number, True
            try:
                self._pipe.send(request)
            except OSError:
                return


def _serve(pipe: Connection, newest: Any) -> None:
    """Answer requests until the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    number = 0

    def check() -> None:
        if newest.value != number:
            raise Superseded

    previewer = Previewer(check)
    while True:
        try:
            request = pipe.recv()
        except (EOFError, OSError):
            return
        number = request.number
        try:
            check()
            pipe.send(previewer.answer(request))
            pipe.send(previewer.plans(request))
        except Superseded:
            pass
        except Vid2evError as error:
            pipe.send(Refused(number, str(error)))
        except Exception as error:  # a page goes on, whatever happens in its preview
            pipe.send(Refused(number, f"the preview failed ({type(error).__name__}: {error})"))
        pipe.send(None)
