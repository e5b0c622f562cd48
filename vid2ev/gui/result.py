"""Below the pictures: a pixel over time, the plan, the world in three dimensions, cost, comparison, command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui

from vid2ev.gui.charts import cost_chart, course_chart, interval_chart, statistics_rows
from vid2ev.gui.jobs import Done, Job, Progress
from vid2ev.gui.preview import Answer
from vid2ev.gui.record import Record
from vid2ev.gui.session import Session
from vid2ev.gui.stage import Stage
from vid2ev.gui.tasks import costed, gathered, planned
from vid2ev.gui.theme import say
from vid2ev.plan.plan import Plan
from vid2ev.terminal import counted

NO_PIXEL = "Click a pixel of an event camera to follow it."
TABS = ("Pixel", "Plan", "World", "Cost", "Compare", "Record")


class Results:
    """The results of a session."""

    def __init__(self, session: Session, select: Callable[[str], None]):
        self._session, self._select = session, select
        self._stage: Stage | None = None
        self._real: Any = None
        with ui.tabs(on_change=lambda e: self._opened(e.value)).props("dense align=left no-caps") as self._tabs:
            for name in TABS:
                ui.tab(name)
        with ui.tab_panels(self._tabs, value="Pixel", animated=False).classes("w-full").props("keep-alive"):
            with ui.tab_panel("Pixel"):
                self._followed = ui.label(NO_PIXEL).classes("v-muted")
                self._course = ui.echart(course_chart(None)).classes("w-full").style("height: 330px")
                self._course.set_visibility(False)
            with ui.tab_panel("Plan"):
                ui.label(
                    "What the light shown here calls for: what leaving an effect out changes, and what it costs."
                ).classes("v-muted")
                self._plans = ui.element("div").classes("v-scroll mt-2")
                self._planner = Work(session, "Plan the whole clip", planned, self._planned)
            with ui.tab_panel("World"):
                ui.label("Click a thing for its controls; drag it to move it.").classes("v-muted")
                self._world = ui.element("div").classes("w-full mt-2")
            with ui.tab_panel("Cost"):
                ui.label(
                    "What accuracy costs in time, measured on a part of this source. It takes some minutes."
                ).classes("v-muted")
                self._cost = ui.echart(course_chart(None)).classes("w-full").style("height: 340px")
                self._cost.set_visibility(False)
                self._costs = ui.element("div").classes("v-scroll")
                self._coster = Work(session, "Measure", costed, self._costed)
            with ui.tab_panel("Compare"):
                self._draw_compare()
            with ui.tab_panel("Record"):
                self.record = Record(session, lambda: self._tabs.set_value("Record"))
        session.on("answer", self._answered)
        session.on("plans", lambda plans: self._show_plans(plans.plans))
        session.on("setup", self._set_up)

    def _set_up(self, _: Any) -> None:
        if self._stage is not None:
            self._stage.show()

    def _opened(self, name: str) -> None:
        if name == "World" and self._stage is None:
            with self._world:
                self._stage = Stage(self._session, self._select)

    def _answered(self, answer: Answer) -> None:
        if answer.pixel is None:
            self._followed.text = NO_PIXEL
            self._course.set_visibility(False)
        elif answer.course is not None:
            pixel = answer.pixel
            shown = answer.cameras[pixel[0]]
            events = counted(len(answer.course.events), "event")
            self._followed.text = f"{shown.name}, pixel {pixel[1]}, {pixel[2]}: {events}"
            self._course.options.clear()
            self._course.options.update(course_chart(answer.course))
            self._course.set_visibility(True)
            self._course.update()
        self._compared()
        if self._stage is not None:
            self._stage.follow()

    def _show_plans(self, plans: dict[str, Plan]) -> None:
        self._plans.clear()
        with self._plans:
            for name, plan in plans.items():
                table(
                    ["effect", "fate", "distance", "kind", "figure", "cost", "why"],
                    [_cells(row) for row in plan.describe()["rows"]],
                    name,
                )
                ui.label(plan.in_all()).classes("v-muted mb-3")

    def _planned(self, plans: dict[str, Plan]) -> None:
        self._show_plans(plans)

    def _costed(self, found: dict[str, Any]) -> None:
        self._cost.options.clear()
        self._cost.options.update(cost_chart(found))
        self._cost.set_visibility(True)
        self._cost.update()
        rows = [_cost_cells(row) for row in found["settings"] if row["front"]]
        self._costs.clear()
        with self._costs:
            table(["worth its time", "x length", "vR", "count", "timing", "convert ..."], rows)
            best = found["recommended"] or "none"
            ui.label(f"recommended within {found['budget']}: {best}").classes("v-muted")

    def _draw_compare(self) -> None:
        ui.label("Event rate and statistics of this preview beside those of a recording.").classes("v-muted")
        with ui.element("div").classes("v-line"):
            path = ui.input("Recording or event file").props('dense data-key="real"').classes("grow")
            self._reader = Work(
                self._session, "Open", gathered, self._gathered, lambda: {"path": path.value}, setup=False
            )
            path.on("keydown.enter", self._reader.begin)
        self._table = ui.element("div").classes("v-scroll mt-2")
        self._intervals = ui.echart(course_chart(None)).classes("w-full").style("height: 260px")
        self._intervals.set_visibility(False)

    def _gathered(self, found: Any) -> None:
        self._real = found
        self._compared()

    def _compared(self) -> None:
        answer = self._session.answer
        own = next((shown for shown in answer.cameras if shown.statistics), None) if answer else None
        if own is None or own.statistics is None:
            return
        named = {own.name: own.statistics} | ({"recording": self._real} if self._real else {})
        rows = statistics_rows(named)
        self._table.clear()
        with self._table:
            table(rows[0], rows[1:])
        self._intervals.options.clear()
        self._intervals.options.update(interval_chart(named))
        self._intervals.set_visibility(True)
        self._intervals.update()


class Work:
    """A button for long work: its progress, and its end by another click."""

    def __init__(
        self,
        session: Session,
        label: str,
        task: Callable[..., Any],
        take: Callable[[Any], None],
        arguments: Callable[[], dict[str, Any]] = dict,
        setup: bool = True,
    ):
        self._session, self._label, self._task, self._take = session, label, task, take
        self._arguments, self._setup = arguments, setup
        self._job: Job | None = None
        with ui.element("div").classes("v-line mt-2").style("width: auto"):
            self._button = ui.button(label, on_click=self._clicked).props("flat dense")
            self._said = ui.label().classes("v-muted")

    def _clicked(self) -> None:
        if self._job is not None:
            self._job.cancel()
        else:
            self.begin()

    def begin(self) -> None:
        """Begin the work, unless it is going on."""
        if self._job is not None:
            return
        asked = {"setup": self._session.setup} if self._setup else {}
        self._button.text = "Cancel"
        say(self._said, "beginning")
        self._job = self._session.start(self._task, self._heard, self._ended, **asked, **self._arguments())

    def _heard(self, said: Progress) -> None:
        share = f"{said.done:g} of {said.of:g}" if said.of else ""
        self._said.text = ", ".join(part for part in (share, said.text) if part)

    def _ended(self, done: Done) -> None:
        self._job, self._button.text = None, self._label
        say(self._said, done.why_not or "", bad=done.failed)
        if done.why_not is None:
            self._take(done.result)


def table(head: list[str], rows: list[list[str]], name: str = "") -> None:
    """A plain table."""
    if name:
        ui.label(name).classes("v-group")
    with ui.element("table").classes("v-table"):
        for kind, line in (("th", head), *(("td", row) for row in rows)):
            with ui.element("tr"):
                for cell in line:
                    with ui.element(kind):
                        ui.label(cell)


def _cells(row: dict[str, Any]) -> list[str]:
    costs = ((row.get("ns_per_pixel", 0), "ns/px"), (row.get("ns_per_event", 0), "ns/event"))
    cost = ", ".join(f"{ns:g} {unit}" for ns, unit in costs if ns > 0) or "0"
    distance = "–" if row["distance"] is None else f"{row['distance']:.2g}"
    return [row["effect"], row["fate"], distance, row["kind"], row["figure"], cost, row["why"]]


def _cost_cells(row: dict[str, Any]) -> list[str]:
    timing = row.get("timing_us")
    figures = [f"{row[key]:.2g}" if row.get(key) is not None else "–" for key in ("time", "distance", "count_error")]
    return [row["name"], *figures, f"{timing[0]} us" if timing else "–", row["arguments"]]
