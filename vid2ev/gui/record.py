"""The command of a setup, its files, and its conversion."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from vid2ev.errors import Vid2evError
from vid2ev.gui.command import RIG, SCENE, command_of, sensor_text, write_scene
from vid2ev.gui.jobs import Done, Job, Progress
from vid2ev.gui.loading import WANTED, loaded, loaded_from
from vid2ev.gui.session import Session
from vid2ev.gui.setup import Setup
from vid2ev.gui.tasks import converted
from vid2ev.gui.theme import refuse, say
from vid2ev.making.conversion import default_directory
from vid2ev.rig.rig_file import rig_text, write_text
from vid2ev.terminal import counted


class Record:
    """Where a setup becomes a recording; `open_tab` brings it to the front."""

    def __init__(self, session: Session, open_tab: Any):
        self._session, self._open_tab = session, open_tab
        self._job: Job | None = None
        with ui.element("div").classes("v-line"):
            ui.label("The command that does the same").classes("v-muted")
            ui.space()
            ui.button("Copy", icon="content_copy", on_click=self._copied).props("flat dense size=sm")
        self._command = ui.label().classes("v-command").props('data-key="command"')
        self._needs = ui.label().classes("v-muted")
        with ui.element("div").classes("v-line mt-3"):
            self._where = (
                ui.input("Folder", on_change=lambda _: self.show()).props('dense data-key="output"').classes("grow")
            )
            self._over = ui.switch("overwrite").props('dense title="replace a recording that is there"')
            self._go = ui.button("Convert", on_click=self.convert).props("unelevated dense")
            self._stop = ui.button("Cancel", on_click=self._cancelled).props("flat dense")
        self._bar = ui.linear_progress(value=0, show_value=False).props("rounded size=6px").classes("mt-3")
        self._said = ui.label().classes("v-muted").props('data-key="said"')
        self._busy(False)
        self._source, self._offered = "", list[str]()
        session.on("setup", lambda _: self.show())
        self.show()

    def buttons(self) -> None:
        """What stands at the top of the page: open and save files, convert."""
        session = self._session
        with ui.button("Load").props('flat dense title="a sensor, rig or scene file"'), ui.menu() as self._menu:
            self._upload = ui.upload(
                on_upload=self._uploaded, auto_upload=True, label="a sensor, rig or scene file"
            ).props('accept=".toml" flat data-key="load"')
            self._path = ui.input("or its path, with the files beside it").classes("w-full px-3 pb-2")
            self._path.props('dense data-key="path"').on("keydown.enter", self._named)
        with ui.button("Save").props("flat dense data-key=save"), ui.menu() as self._saves:
            self._offer()
        session.on("setup", lambda _: self._offer())
        ui.button("Convert", on_click=self.convert).props('unelevated dense data-key="convert"')

    def _offer(self) -> None:
        """What can be saved: a file for each camera's sensor, and those of the rig and the scene."""
        setup = self._session.setup
        names = [*(f"sensor of {camera.name}" for camera in setup.rig.cameras), "rig", *["scene"] * setup.is_scene]
        if names == self._offered:
            return
        self._offered = names
        self._saves.clear()
        with self._saves:
            for number, camera in enumerate(setup.rig.cameras):
                ui.menu_item(f"sensor of {camera.name}", partial(self._save_sensor, number))
            ui.menu_item("rig", lambda: self._save(RIG, _write_rig))
            if setup.is_scene:
                ui.menu_item("scene", lambda: self._save(SCENE, write_scene))

    def _save_sensor(self, number: int) -> None:
        self._save(f"{self._name(number)}.toml", partial(_write_sensor, number))

    def show(self) -> None:
        """Show the command."""
        setup = self._session.setup
        if setup.source != self._source:
            self._source = setup.source
            self._where.value = str(default_directory(setup.source))
        command = command_of(setup, self._directory)
        self._command.text = str(command)
        names = " and ".join(command.files)
        self._needs.set_visibility(bool(names))
        self._needs.text = (
            f"with {names} beside it: Save writes {'them' if len(command.files) > 1 else 'it'}" if names else ""
        )

    @property
    def _directory(self) -> str:
        """Where the recording goes."""
        return self._where.value.strip() or str(default_directory(self._session.setup.source))

    def convert(self) -> None:
        """Begin the conversion."""
        if self._job is not None:
            return
        self._open_tab()
        say(self._said, "beginning")
        directory = self._directory
        self._bar.value = 0
        self._busy(True)
        self._job = self._session.start(
            converted, self._heard, partial(self._ended, Path(directory).absolute()),
            setup=self._session.setup, directory=directory, overwrite=self._over.value,
        )  # fmt: skip

    def _heard(self, said: Progress) -> None:
        self._bar.value = round(said.done / said.of, 3) if said.of else 0
        self._bar.props(remove="indeterminate") if said.of else self._bar.props("indeterminate")
        self._said.text = said.text

    def _ended(self, directory: Path, done: Done) -> None:
        self._job = None
        self._busy(False)
        if done.why_not is not None:
            say(self._said, done.why_not, bad=done.failed)
            return
        results = done.result.get("results", {"": done.result})
        parts = [f"{name} {_count(result)}".strip() for name, result in results.items()]
        self._said.text = f"{directory}: {', '.join(parts)}"
        self._bar.value = 1

    def _busy(self, busy: bool) -> None:
        self._go.set_enabled(not busy)
        self._stop.set_visibility(busy)
        self._bar.set_visibility(busy)
        # (the browser asks before it leaves a page whose work would end)
        ui.run_javascript(f"window.onbeforeunload = {'e => e.preventDefault()' if busy else 'null'}")

    def _cancelled(self) -> None:
        if self._job is not None:
            self._job.cancel()
            self._said.text = "cancelling"

    def _copied(self) -> None:
        ui.clipboard.write(self._command.text)
        ui.notify("copied", type="info", position="bottom-right")

    async def _uploaded(self, event: Any) -> None:
        name = event.file.name
        self._upload.reset()
        try:
            text = (await event.file.read()).decode("utf-8-sig")
        except UnicodeDecodeError:
            self._loaded(name, f"{name} is not a text; give {WANTED}")
        else:
            session = self._session
            self._loaded(name, session.change(lambda: loaded(session.setup, text, name)))

    def _named(self) -> None:
        path = Path(self._path.value.strip())
        self._loaded(str(path), self._session.change(lambda: loaded_from(self._session.setup, path)))

    def _loaded(self, name: str, why_not: str | None) -> None:
        """Say that a file is loaded, or why not."""
        self._menu.close()
        if why_not:
            refuse(why_not)
        else:
            self._session.look()  # (the files that it names may be others by now)
            ui.notify(f"{name} is loaded", position="bottom-right")

    def _name(self, camera: int) -> str:
        return f"{self._session.setup.rig.cameras[camera].name}_sensor"

    def _save(self, name: str, write: Callable[[Setup, Path, bool], None]) -> None:
        """Ask for the place, where a file may be replaced or not, and have `write` save some of the setup there."""
        setup = self._session.setup

        def save() -> None:
            try:
                write(setup, Path(where.value), over.value)
            except Vid2evError as error:
                why.text = str(error)
                return
            dialog.close()
            ui.notify(f"{where.value} is written", position="bottom-right")

        with ui.dialog(value=True) as dialog, ui.card().classes("v-card"):
            where = ui.input("File", value=name).classes("w-80").on("keydown.enter", save)
            over = ui.switch("overwrite").props("dense")
            why = ui.label().classes("v-error")
            with ui.row():
                ui.button("Save", on_click=save).props("unelevated dense")
                ui.button("Cancel", on_click=dialog.close).props("flat dense")


def _write_sensor(camera: int, setup: Setup, path: Path, overwrite: bool) -> None:
    write_text(path, sensor_text(setup, camera), overwrite)


def _write_rig(setup: Setup, path: Path, overwrite: bool) -> None:
    write_text(path, rig_text(setup.rig, path.parent), overwrite)


def _count(result: dict[str, Any]) -> str:
    counts = result["counts"]
    return counted(counts["events"], "event") if "events" in counts else counted(counts.get("exposures", 0), "frame")
