"""A session: one page's setup, what it looks at, and the work that goes on for it.  Nothing is shared between pages."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from vid2ev.errors import Vid2evError
from vid2ev.gui.jobs import Done, Job, Progress
from vid2ev.gui.preview import Answer, Plans, Request
from vid2ev.gui.setup import Setup
from vid2ev.gui.warming import Warming
from vid2ev.gui.why import why_not
from vid2ev.gui.worker import Refused, Worker

GATHER_S = 0.06  # changes, before a preview is asked for
SLOW_S = 1.5  # after which a page says that it waits

Hear = Callable[[Any], None]


class Session:
    """What belongs to one page; only what is compiled for it (`warming`) serves others, too.

    `change` and `look` say what a person does, `tick` is called often and says what came.

    The last setup that could be meant is kept: a change that is refused changes nothing.
    """

    def __init__(self, setup: Setup, warming: Warming | None = None):
        self._warming = warming or Warming()
        self.request = Request(setup)
        self.answer: Answer | None = None
        self.plans: Plans | None = None
        self.status = ""
        self.refused = False  # what was asked for last, for the reason that the status gives
        self._told = ("", False)
        self._worker: Worker | None = None
        self._heard: dict[str, list[Hear]] = {"setup": [], "answer": [], "plans": [], "status": []}
        self._changed_s: float | None = time.monotonic()
        self._asked_s = 0.0
        self._jobs: dict[Job, tuple[Hear, Hear]] = {}
        self._warming.enter()

    @property
    def setup(self) -> Setup:
        """The last good setup."""
        return self.request.setup

    def on(self, what: str, hear: Hear) -> None:
        """Call `hear` with each new setup, answer, plans or status."""
        self._heard[what].append(hear)

    def change(self, make: Callable[[], Setup]) -> str | None:
        """Take up the setup that `make` makes; if that is refused, why."""
        try:
            setup = make()
            setup.check()
        except (Vid2evError, ValueError) as error:
            return str(error)
        except OSError as error:
            return why_not(error)
        if setup != self.setup:
            self.look(setup=setup, pixel=self._followed(setup))
            self._say("setup", setup)
        return None

    def _followed(self, setup: Setup) -> tuple[int, int, int] | None:
        """The pixel that is followed, in a setup: of the camera of its name; None where that is gone."""
        if self.request.pixel is None:
            return None
        number, x, y = self.request.pixel
        before, names = self.setup.rig.cameras[number], [(each.name, each.kind) for each in setup.rig.cameras]
        return (names.index((before.name, before.kind)), x, y) if (before.name, before.kind) in names else None

    def look(self, **what: Any) -> None:
        """Ask for another preview: other fields of the request."""
        self.request = replace(self.request, number=self.request.number + 1, **what)
        self._changed_s = self._changed_s or time.monotonic()

    @property
    def waiting(self) -> bool:
        """Whether a preview is on its way."""
        return self._changed_s is not None or (self._worker is not None and self._worker.busy)

    def tick(self) -> None:
        """Send what was asked for, hand on what came."""
        now_s = time.monotonic()
        if self._changed_s is not None and now_s - self._changed_s >= GATHER_S:
            self._changed_s, self._asked_s = None, now_s
            if self._worker is None or not self._worker.alive:
                self._worker = Worker()
            self._worker.ask(replace(self.request, ready=self._warming.ready))
        for reply in self._worker.replies() if self._worker else ():
            self._take(reply)
        if self._worker and self._worker.busy and self._asked_s and now_s - self._asked_s > SLOW_S:
            self._tell("working")
        for job, (hear, end) in [*self._jobs.items()]:
            for said in job.news():
                (end if isinstance(said, Done) else hear)(said)
                if isinstance(said, Done):
                    del self._jobs[job]
                    job.close()

    def start(
        self, task: Callable[..., Any], hear: Callable[[Progress], None], end: Callable[[Done], None], **arguments: Any
    ) -> Job:
        """Begin long work; `hear` is told of its progress, `end` of its end."""
        job = Job(task, **arguments)
        self._jobs[job] = (hear, end)
        return job

    def close(self) -> None:
        """End all work."""
        for job in self._jobs:
            job.close()
        self._jobs.clear()
        if self._worker:
            self._worker.close()
            self._worker = None
        self._warming.leave()

    def _take(self, reply: Answer | Plans | Refused) -> None:
        if isinstance(reply, Answer):
            self.answer, self._asked_s, self.refused = reply, 0.0, False
            self._say("answer", reply)
            self._tell("; ".join(reply.notes))
            if reply.whole:
                self._warming.begin()
        elif isinstance(reply, Plans):
            self.plans = reply
            self._say("plans", reply)
        else:
            self._asked_s, self.refused = 0.0, not reply.answered
            self._tell(reply.why)

    def _tell(self, status: str) -> None:
        if (status, self.refused) != self._told:
            self.status, self._told = status, (status, self.refused)
            self._say("status", status)

    def _say(self, what: str, value: Any) -> None:
        for hear in self._heard[what]:
            hear(value)
