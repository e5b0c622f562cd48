"""The page: sources and controls on the left, what the cameras send on the right, and below it what that means."""

from __future__ import annotations

import logging
import socket
from threading import Thread
from typing import Any

from nicegui import ui

from vid2ev.errors import UsageError, Vid2evError
from vid2ev.gui.pictures import Pictures
from vid2ev.gui.result import Results
from vid2ev.gui.session import Session
from vid2ev.gui.settings import Settings
from vid2ev.gui.setup import Setup
from vid2ev.gui.theme import ACCENT, BAD, CSS
from vid2ev.gui.warming import Warming

TICK_S = 0.05
GONE_S = 10  # without its page, after which a session is ended


def draw(setup: Setup, warming: Warming) -> Session:
    """Draw the page of a new session, whose work ends when the page is closed."""
    session = Session(setup, warming)
    ui.add_css(CSS)
    ui.colors(primary=ACCENT, info=ACCENT, negative=BAD)
    dark = ui.dark_mode(value=None)

    async def turn_over() -> None:
        dark.value = not await ui.run_javascript("Quasar.Dark.isActive", timeout=5)

    with ui.element("div").classes("v-top"):
        ui.label("vid2ev").classes("v-brand")
        source = ui.label(setup.source).classes("v-source")
        files = ui.row().classes("gap-2")
        turn = ui.button(icon="contrast", on_click=turn_over)
        turn.props('flat dense round title="light or dark" aria-label="light or dark"')
    with ui.element("div").classes("v-main"):
        with ui.element("div").classes("v-card v-side"):
            settings = Settings(session)
        with ui.element("div").classes("v-right"):
            with ui.element("div").classes("v-card"):
                Pictures(session)
            with ui.element("div").classes("v-card"):
                results = Results(session, settings.select)
    with files:
        results.record.buttons()

    def show(changed: Setup) -> None:
        source.text = changed.source + (", changed" if changed.scene is not None else "")
        settings.show()

    session.on("setup", show)
    ui.timer(TICK_S, session.tick)
    ui.context.client.on_delete(lambda: Thread(target=session.close).start())  # (other pages do not wait for it)
    return session


def serve(setup: Setup, host: str, port: int, show: bool) -> None:
    """Serve the page until the program is interrupted; each page that is opened begins with this setup."""
    from nicegui import app

    from vid2ev.gui.guard import Guard
    from vid2ev.gui.unanswered import Unanswered

    warming = Warming()

    @ui.page("/", title="vid2ev")
    async def page() -> None:
        await ui.context.client.connected()
        if not ui.context.client.has_socket_connection:
            return
        kept = app.storage.tab  # (of one tab of the browser: what was set up there is there again after a reload)
        begun = kept.get("setup", setup)
        try:
            begun.check()
        except Vid2evError as error:
            ui.label(f"{error}; put that right and reload the page")
            return
        session = draw(begun, warming)
        session.on("setup", lambda changed: kept.update(setup=changed))

    app.add_middleware(Guard, host=host)
    logging.getLogger("uvicorn.error").addFilter(Unanswered())
    where: dict[str, Any] = {"host": host, "port": port, "show": show, "language": "en-US"}
    ui.run(title="vid2ev", reload=False, show_welcome_message=False, reconnect_timeout=GONE_S, **where)


def free_port(host: str, port: int) -> int:
    """The port, or for 0 one that is free.  Raises UsageError for one that is taken, and for a host that is not."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.create_server((host, port), family=family) as taken:
            return taken.getsockname()[1]
    except UnicodeError as error:
        raise UsageError(f"host '{host}' is no name that a machine can have; give another --host") from error
    except OSError as error:
        raise UsageError(
            f"{address(host, port)} cannot be served ({error.strerror}); give another --port, or 0"
        ) from error


def address(host: str, port: int) -> str:
    """Where it is served, as a browser wants it: addresses of version 6 in brackets."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
