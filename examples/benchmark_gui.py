#!/usr/bin/env python3
"""How long the page of `vid2ev gui` takes to show what was changed, in a real browser.

    python examples/benchmark_gui.py                       the eight scenes
    python examples/benchmark_gui.py clip.mp4 scene:room   these

Needs playwright and a Chromium.  The page is left alone until it has compiled what it shows; then a threshold, the
dead time, the kind of picture and the instant are changed, some times each, and after each change it is seen when the
picture of the event camera is another: the first one, which may be rough, and the last.  Medians, in seconds.  The
machine should have nothing else to do.
"""

from __future__ import annotations

import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

PROGRAM = "from vid2ev.commands.gui import gui; gui()"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATIENT_S = 120
SETTLED_S = 3  # without another picture
NO_CHANGE_S = 6  # (a change that changes no event)
WATCH = """() => {
  window.seen = []; let last = "";
  const look = () => {
    const image = document.querySelector("[data-camera] img, img[data-camera]");
    if (image && image.src !== last) { last = image.src; window.seen.push(performance.now()); }
    requestAnimationFrame(look);
  };
  look();
}"""


def serve(source: str, folder: Path) -> tuple[subprocess.Popen, str]:
    """A server of the page, and its address."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-c", PROGRAM, source, "--port", str(port), "--no-browser"]
    environment = os.environ | {"NICEGUI_STORAGE_PATH": str(folder)}
    served = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    end_s = time.monotonic() + PATIENT_S
    while time.monotonic() < end_s and served.poll() is None:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return served, f"http://127.0.0.1:{port}"
        time.sleep(0.1)
    raise SystemExit(f"no page for {source}")


def seen_after(page: Any, change: Callable[[], None]) -> list[float]:
    """How long after a change pictures were other ones [s]."""
    before = page.evaluate("window.seen.length")
    begin_ms = page.evaluate("performance.now()")
    change()
    shown: list[float] = []
    while True:
        now_ms = page.evaluate("performance.now()")
        shown = page.evaluate("window.seen")[before:]
        if now_ms > (shown[-1] + 1000 * SETTLED_S if shown else begin_ms + 1000 * NO_CHANGE_S):
            return [(each - begin_ms) / 1000 for each in shown]
        time.sleep(0.1)


def enter(page: Any, key: str, value: float) -> None:
    """Set a control as a person does."""
    field = page.locator(f'[data-key="dvs.{key}"] .v-value input').last
    field.fill(str(value))
    field.blur()


def measure(page: Any, settle_s: float) -> dict[str, list[list[float]]]:
    """What each kind of change took, each time."""
    page.wait_for_selector('[data-key="dvs.threshold_on"]')
    page.evaluate(WATCH)
    time.sleep(settle_s)
    line = page.locator('[data-key="time"]').bounding_box()

    def click_at(share: float) -> None:
        page.mouse.click(line["x"] + share * line["width"], line["y"] + line["height"] / 2)

    def look(view: str) -> None:
        page.locator(".q-btn-toggle button", has_text=view).first.click()

    changes: dict[str, tuple[Callable[[Any], None], list[Any]]] = {
        "threshold": (lambda value: enter(page, "threshold_on", value), [0.31, 0.21, 0.26]),
        "dead time": (lambda value: enter(page, "refractory_us", value), [700, 300, 1500]),
        "picture": (look, ["time surface", "event frame", "polarity"]),
        "instant": (click_at, [0.3, 0.8, 0.5]),
    }
    return {
        name: [seen_after(page, partial(change, value)) for value in values]
        for name, (change, values) in changes.items()
    }


def told(took: list[list[float]]) -> str:
    """First and last picture of each, medians; a dash where nothing that is shown changed."""
    known = [each for each in took if each]
    if not known:
        return "–"
    first, last = (statistics.median(each[place] for each in known) for place in (0, -1))
    return f"{first:.2f}" if last - first < 0.01 else f"{first:.2f}, {last:.2f}"


@click.command(help=__doc__, context_settings={"max_content_width": 120})
@click.argument("sources", nargs=-1)
@click.option("--settle", "settle_s", default=30.0, show_default=True, help="How long a page is left alone [s].")
def main(sources: tuple[str, ...], settle_s: float) -> None:
    from playwright.sync_api import sync_playwright

    from vid2ev.scenes.scene_file import scene_names

    names = ("threshold", "dead time", "picture", "instant")
    print(f"| source | {' | '.join(names)} |\n|---{'|--:' * len(names)}|")
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=next(filter(None, map(shutil.which, BROWSERS))), args=FLAGS)
        for source in sources or [f"scene:{name}" for name in scene_names()]:
            served, address = serve(source if ":" in source else str(Path(source).resolve()), Path(folder))
            page = browser.new_page(viewport={"width": 1360, "height": 900})
            page.set_default_timeout(1000 * PATIENT_S)
            page.goto(address)
            took = measure(page, settle_s)
            print(f"| {Path(source).name} | {' | '.join(told(took[name]) for name in names)} |", flush=True)
            page.close()
            served.terminate()
            served.wait()
        browser.close()


if __name__ == "__main__":
    main()
