"""The left side: what is converted, and every parameter of it."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from vid2ev.errors import UsageError
from vid2ev.gui.boards import CameraBoard, OptionBoard, SceneBoard, SensorBoard
from vid2ev.gui.panel import Panel
from vid2ev.gui.scene_edit import things_of
from vid2ev.gui.session import Session
from vid2ev.gui.setup import Setup, setup_of
from vid2ev.gui.stage import CAMERAS
from vid2ev.gui.theme import refuse
from vid2ev.rig.camera import Camera
from vid2ev.scenes.scene_file import scene_names
from vid2ev.sources import SCENE_PREFIX

VIDEO = "the video's"


class Settings:
    """The settings of a session; `select` shows those of a camera or of a part of the scene."""

    def __init__(self, session: Session):
        self._session = session
        self._panels: list[Panel] = []
        self._camera = self._place = 0
        self._part = "scene"
        self._drawn: Any = None
        with ui.tabs().props("dense align=left no-caps").classes("w-full") as self._tabs:
            for name in ("Source", "Sensor", "Camera", "Scene"):
                ui.tab(name)
        with ui.tab_panels(self._tabs, value="Sensor", animated=False).classes("w-full").props("keep-alive"):
            with _panel("Source"):
                self._draw_source()
            self._places = {name: _panel(name) for name in ("Sensor", "Camera", "Scene")}
        self.show()

    def show(self) -> None:
        """Show the setup: draw what is another, else the values in use."""
        setup = self._session.setup
        self._camera = min(self._camera, len(setup.rig.cameras) - 1)
        self._place = min(self._place, len(_places(setup)) - 1)
        shape = (
            setup.source,
            [(c.name, c.kind, c.sensor) for c in setup.rig.cameras],
            self._camera,
            self._place,
            self._part,
        )
        names = [thing.name for thing in things_of(setup.settled())] if setup.is_scene else []
        if (shape, names) != self._drawn:
            self._drawn = (shape, names)
            self._entered.value = setup.source
            self._draw()
        for panel in self._panels:
            panel.show()

    def select(self, name: str) -> None:
        """Show what is called so in the 3-D view."""
        if name.startswith(CAMERAS):
            self._place = [camera.name for camera in self._session.setup.rig.cameras].index(name.removeprefix(CAMERAS))
            self._tabs.value = "Camera"
        else:
            self._part, self._tabs.value = name, "Scene"
        self.show()

    def _draw_source(self) -> None:
        session = self._session
        ui.label("Scenes").classes("v-group")
        with ui.element("div").classes("v-chips"):
            for name in scene_names():
                ui.button(name, on_click=lambda name=name: self._open(f"{SCENE_PREFIX}{name}")).props(
                    f'flat dense no-caps align=left data-scene="{name}"'
                )
        ui.label("Video, folder of images, or a scene with its seed").classes("v-group")
        with ui.element("div").classes("v-line").style("flex-wrap: nowrap"):
            entered = self._entered = ui.input(value=session.setup.source, placeholder="clip.mp4, scene:room,seed=3")
            entered.classes("grow").props("dense")
            entered.props('data-key="source" aria-label="source"').on(
                "keydown.enter", lambda: self._open(entered.value)
            )
            ui.button("Open", on_click=lambda: self._open(entered.value)).props("flat dense")
        self._why = ui.label().classes("v-error")
        ui.label("Options").classes("v-group")
        options = OptionBoard(session)
        Panel("options", options.controls, options)

    def _open(self, source: str) -> None:
        before = self._session.setup

        def make() -> Setup:
            other = setup_of(source.strip())
            if not before.own_rig:
                return Setup(other.source, before.rig, own_rig=False, options=before.options)
            return _with_sensors_of(before, other)

        self._why.text = self._session.change(make) or ""
        if not self._why.text:
            self._session.look(start_s=0.0, pixel=None)
            self.show()  # (its files may say something else by now)

    def _draw(self) -> None:
        setup = self._session.setup
        self._panels = []
        for name, draw in (("Sensor", self._draw_sensor), ("Camera", self._draw_camera), ("Scene", self._draw_scene)):
            self._places[name].clear()
            with self._places[name]:
                draw(setup)

    def _draw_sensor(self, setup: Setup) -> None:
        names = [camera.name for camera in setup.rig.cameras]
        kind, number = setup.kind(self._camera), self._camera
        with ui.element("div").classes("v-line"):
            ui.toggle(names, value=names[number], on_change=lambda e: self._turn_to(camera=names.index(e.value))).props(
                "dense flat no-caps"
            )
            ui.space()
            presets = [*dict.fromkeys([*kind.names(), setup.preset(number)])]
            ui.select(
                presets, value=setup.preset(number), on_change=lambda e: self._take_preset(number, e.sender, e.value)
            ).props(f'dense options-dense title="preset" aria-label="preset" data-preset="{names[number]}"')
        ui.label(str(setup.sensor(number).about.get("title", ""))).classes("v-muted mt-1")
        board = SensorBoard(self._session, number)
        panel = Panel(names[number], board.controls, board, grouped=True)
        self._panels.append(panel)
        ui.button("Reset all", on_click=panel.reset).props("flat dense").classes("mt-2")

    def _draw_camera(self, setup: Setup) -> None:
        names, place = _places(setup), self._place
        with ui.element("div").classes("v-line"):
            ui.toggle(names, value=names[place], on_change=lambda e: self._turn_to(place=names.index(e.value))).props(
                "dense flat no-caps"
            )
            ui.space()
            if names[place] != VIDEO and len(setup.rig.cameras) > 1:
                ui.button("Remove", on_click=lambda: self._remove(place)).props("flat dense")
        board = CameraBoard(self._session, None if names[place] == VIDEO else place)
        panel = Panel(f"rig.{names[place]}", board.controls, board, grouped=True)
        self._panels.append(panel)
        with ui.element("div").classes("v-line mt-2"):
            ui.button("Reset all", on_click=panel.reset).props("flat dense")
            ui.space()
            ui.button("DVS", icon="add", on_click=lambda: self._add("dvs")).props("flat dense")
            ui.button("CIS", icon="add", on_click=lambda: self._add("cis")).props("flat dense")

    def _draw_scene(self, setup: Setup) -> None:
        if not setup.is_scene:
            ui.label("A video has no scene to change; choose one under Source.").classes("v-muted")
            return
        names = [thing.name for thing in things_of(setup.settled())]
        self._part = self._part if self._part in names else "scene"
        ui.select(names, value=self._part, on_change=lambda e: self._turn_to(part=e.value)).props(
            'dense options-dense data-key="part" aria-label="part of the scene"'
        ).classes("w-full")
        board = SceneBoard(self._session, self._part)
        panel = Panel(self._part, board.controls, board)
        self._panels.append(panel)
        with ui.element("div").classes("v-line mt-2"):
            ui.button("Reset all", on_click=panel.reset).props("flat dense")
            ui.button("Whole scene as it was", on_click=self._scene_back).props("flat dense")

    def _take_preset(self, number: int, select: ui.select, name: str) -> None:
        setup = self._session.setup
        if name == setup.preset(number):  # (brought back)
            return
        refuse(self._session.change(lambda: setup.with_preset(number, name)))
        select.value = self._session.setup.preset(number)

    def _scene_back(self) -> None:
        refuse(self._session.change(lambda: self._session.setup.with_scene(None)))
        self._drawn = None  # (nor is there anything left of what was refused)
        self.show()

    def _turn_to(self, camera: int | None = None, place: int | None = None, part: str | None = None) -> None:
        self._camera = self._camera if camera is None else camera
        self._place = self._place if place is None else place
        self._part = part or self._part
        self.show()

    def _add(self, kind: Any) -> None:
        cameras = self._session.setup.rig.cameras
        taken = {camera.name for camera in cameras}
        name = next(f"{kind}{k}" for k in range(2, 1000) if f"{kind}{k}" not in taken)
        refuse(self._session.change(lambda: self._session.setup.with_rig((*cameras, Camera(name=name, kind=kind)))))

    def _remove(self, number: int) -> None:
        cameras = self._session.setup.rig.cameras
        if len(cameras) < 2:
            raise UsageError("a rig has a camera at least")
        kept = tuple(camera for k, camera in enumerate(cameras) if k != number)
        self._place = max(number - 1, 0)
        self._camera -= self._camera > number
        refuse(self._session.change(lambda: self._session.setup.with_rig(kept)))


def _places(setup: Setup) -> list[str]:
    """The cameras of the rig, and that which took the video."""
    return [camera.name for camera in setup.rig.cameras] + ([] if setup.is_scene else [VIDEO])


def _with_sensors_of(before: Setup, other: Setup) -> Setup:
    """Another source, with the sensors and the seed that were chosen for the cameras of the same names."""
    sensors = {(camera.name, camera.kind): camera for camera in before.rig.cameras}
    cameras = tuple(
        camera.model_copy(update={"sensor": known.sensor, "set": known.set})
        if (known := sensors.get((camera.name, camera.kind)))
        else camera
        for camera in other.rig.cameras
    )
    kept = {name: value for name, value in before.options.items() if name in ("seed", "upsample")}
    return Setup(other.source, other.with_rig(cameras, own=True).rig, options=kept)


def _panel(name: str) -> Any:
    with ui.tab_panel(name):
        return ui.element("div").classes("w-full")
