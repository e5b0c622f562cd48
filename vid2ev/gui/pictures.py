"""What the cameras send at the instant that is looked at: pictures, the line of time, the pixel that is followed."""

from __future__ import annotations

import base64
from functools import partial
from typing import Any

from nicegui import ui

from vid2ev.gui.preview import VIEWS, Answer
from vid2ev.gui.session import Session
from vid2ev.gui.theme import say

WINDOWS_S = {"5 ms": 0.005, "10 ms": 0.01, "30 ms": 0.03, "100 ms": 0.1}
STEP_S = 0.001  # of the line of time
WIDEST_PX = 720  # is a picture on the page


class Pictures:
    """The pictures of a session."""

    def __init__(self, session: Session):
        self._session = session
        self._cards: list[tuple[Any, Any]] = []
        self._showing = self._playing = False
        with ui.element("div").classes("v-line"):
            ui.toggle([*VIEWS], value="polarity", on_change=lambda e: session.look(view=e.value)).props(
                "dense flat no-caps"
            ).mark("view")
            ui.space()
            ui.toggle([*WINDOWS_S], value="30 ms", on_change=lambda e: session.look(length_s=WINDOWS_S[e.value])).props(
                'dense flat no-caps title="how long events are gathered; longer where an exposure takes longer"'
            )
        self._grid = ui.element("div").classes("v-pictures mt-3")
        with ui.element("div").classes("v-line mt-2").style("flex-wrap: nowrap"):
            self._play = ui.button(on_click=self._played).props("flat round dense").mark("play")
            self._time = ui.slider(min=0, max=1, step=STEP_S, value=0, on_change=self._scrubbed).props(
                'data-key="time" aria-label="time [s]"'
            )
            self._said = ui.label("0.000 s").classes("v-muted").style("min-width: 130px; text-align: right")
        self._status = ui.label().classes("v-muted v-status").props("role=status")
        session.on("answer", self.show)
        session.on("status", self._told)
        self._stop()

    def show(self, answer: Answer) -> None:
        """Show a preview, and while it plays ask for the next."""
        if [card[0].props["data-camera"] for card in self._cards] != [shown.name for shown in answer.cameras]:
            self._make(answer)
        for (image, caption), shown in zip(self._cards, answer.cameras, strict=True):
            image.set_source(f"data:image/png;base64,{base64.b64encode(shown.picture).decode()}")
            caption.text = shown.caption
        self._marked()
        self._showing = True
        lasting_s = answer.duration_s or answer.span_s[1]
        self._time.props["max"] = max(lasting_s, STEP_S)
        self._time.value = self._session.request.start_s
        self._said.text = f"{self._session.request.start_s:.3f} of {_lasting(lasting_s)} s"
        self._showing = False
        if self._playing and answer.start_s == self._session.request.start_s:
            later_s = self._session.request.start_s + self._session.request.length_s
            self._session.look(start_s=0.0 if later_s >= lasting_s else round(later_s, 3))

    def _make(self, answer: Answer) -> None:
        self._grid.clear()
        self._grid.style(f"max-width: {len(answer.cameras) * WIDEST_PX}px")
        self._cards = []
        with self._grid:
            for shown in answer.cameras:
                with ui.element("div").classes("v-camera"):
                    with ui.element("div").classes("v-line"):
                        ui.label(shown.name).classes("text-sm font-medium")
                        caption = ui.label().classes("v-muted")
                    image = ui.interactive_image(on_mouse=partial(self._clicked, shown.name, shown.kind), cross=False)
                    image.props(f'data-camera="{shown.name}" role=img aria-label="{shown.name}"').classes("mt-1")
                    self._cards.append((image, caption))

    def _clicked(self, name: str, kind: str, event: Any) -> None:
        names = [camera.name for camera in self._session.setup.rig.cameras]
        if kind == "dvs" and name in names:  # (pictures are there until those of other cameras come)
            self._session.look(pixel=(names.index(name), int(event.image_x), int(event.image_y)))
            self._marked()

    def _marked(self) -> None:
        pixel, cameras = self._session.request.pixel, self._session.setup.rig.cameras
        for image, _ in self._cards:
            here = pixel is not None and cameras[pixel[0]].name == image.props["data-camera"]
            image.content = _cross(pixel[1], pixel[2]) if here and pixel else ""

    def _scrubbed(self, event: Any) -> None:
        if not self._showing:
            self._session.look(start_s=round(float(event.value), 3))
            self._said.text = f"{event.value:.3f} s"

    def _played(self) -> None:
        if self._playing:
            self._stop()
            return
        self._playing = True
        self._play.props('icon=pause aria-label="pause"')
        self._session.look()

    def _stop(self) -> None:
        self._playing = False
        self._play.props('icon=play_arrow aria-label="play"')

    def _told(self, status: str) -> None:
        say(self._status, status, bad=self._session.refused)
        if self._session.refused:  # (pictures that are there are those of something else)
            self._grid.classes("v-stale")
            self._stop()
        else:
            self._grid.classes(remove="v-stale")


def _lasting(seconds: float) -> str:
    return f"{seconds:,.0f}" if seconds >= 100 else f"{seconds:.3g}"


def _cross(x: int, y: int) -> str:
    """A mark around a pixel, in the picture's own coordinates."""
    return (
        f'<circle cx="{x + 0.5}" cy="{y + 0.5}" r="5" fill="none" stroke="white" stroke-width="1.4"/>'
        f'<circle cx="{x + 0.5}" cy="{y + 0.5}" r="5" fill="none" stroke="black" stroke-width="0.5"/>'
    )
