"""`vid2ev gui`: a page in the browser that shows what every parameter does."""

from __future__ import annotations

import os

import click

SCENE = "scene:spinning-shapes"


@click.command(short_help="Show what every parameter does, in the browser.")
@click.argument("source", default=SCENE)
@click.option("--rig", metavar="FILE", type=click.Path(dir_okay=False), help="Cameras around the source's.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Who may open it: 0.0.0.0 for the whole network.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="0 takes one that is free."
)
@click.option("--browser/--no-browser", default=True, help="Open the page.  [default: yes]")
def gui(source: str, rig: str | None, host: str, port: int, browser: bool) -> None:
    """Open a page in the browser on which every parameter of sensors, rig and scene is a control, and what the cameras
    send is seen at once.

    SOURCE is a video, a folder of images or a scene (scene:NAME), as for `vid2ev convert`; another can be opened on the
    page.  Needs the extra: pip install 'vid2ev[gui]'.
    """
    from contextlib import nullcontext, suppress
    from importlib.util import find_spec

    from vid2ev.errors import UsageError

    if find_spec("nicegui") is None:
        raise UsageError("the page needs nicegui, which is not installed: pip install 'vid2ev[gui]'")
    from vid2ev.gui.light import duration_s
    from vid2ev.gui.page import address, free_port, serve
    from vid2ev.gui.setup import setup_of

    setup = setup_of(source, rig)
    # (options that are entered on the page may put a file or a folder right, such as by times of images)
    with suppress(UsageError) if os.path.exists(setup.source) else nullcontext():
        duration_s(setup)  # (what cannot be read is refused at once)
    port = free_port(host, port)
    shown = "localhost" if host in ("127.0.0.1", "0.0.0.0", "::") else host
    click.echo(f"http://{address(shown, port)}  (Ctrl-C ends it)")
    serve(setup, host, port, browser)
