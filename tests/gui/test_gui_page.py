"""The page in a real browser: what is entered there is what is previewed, saved and converted.

A browser, a server and pixels that are compiled for it take minutes: `python -m pytest tests/gui -m slow`.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from vid2ev.gui.controls import Control, controls_of
from vid2ev.rig.camera import Camera
from vid2ev.rig.rig_file import read_rig
from vid2ev.scenes.scene import Object
from vid2ev.scenes.scene_file import read_scene, scene_names
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.presets import CIS, DVS, load
from vid2ev.sensors.spec import DvsSpec

ROOT = Path(__file__).parents[2]
PROGRAM = "from vid2ev.commands.gui import gui; gui()"
SCENE = "scene:spinning-shapes,size=48x36,duration_s=0.2"
RIG = "".join(f'[[camera]]\nname = "{kind}"\nkind = "{kind}"\nsensor = "ideal"\n' for kind in ("dvs", "cis"))
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENT_MS = 120_000

pytest.importorskip("nicegui", reason="the extra gui is not installed")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path, subprocess.Popen]]:
    folder = tmp_path_factory.mktemp("served")
    (folder / "given.toml").write_text(RIG)
    with serving(folder) as found:
        yield found


@contextmanager
def serving(folder: Path, **more: str) -> Iterator[tuple[str, Path, subprocess.Popen]]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NICEGUI_STORAGE_PATH": str(folder / "storage"), **more}
    environment = {name: value for name, value in environment.items() if not name.startswith("PYTEST")}
    log = open(folder / "log", "w")  # noqa: SIM115
    program = [sys.executable, "-c", PROGRAM, SCENE, "--rig", "given.toml", "--port", str(port), "--no-browser"]
    served = subprocess.Popen(program, cwd=folder, env=environment, stdout=log, stderr=log)
    for _ in range(600):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        assert served.poll() is None, (folder / "log").read_text()
        time.sleep(0.1)
    yield f"http://127.0.0.1:{port}", folder, served
    served.terminate()
    served.wait()
    log.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(autouse=True)
def windows_close(browser: Any) -> Iterator[None]:
    """After a test that failed, too: work goes on while there are pages."""
    yield
    for context in browser.contexts:
        context.close()


def opened(browser: Any, address: tuple[str, Path, subprocess.Popen], **look: Any) -> tuple[Any, list[str]]:
    """A new window on the page, and what goes wrong in it."""
    page = browser.new_context(viewport={"width": 1360, "height": 900}, **look).new_page()
    page.set_default_timeout(PATIENT_MS)
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    page.goto(address[0])
    page.wait_for_selector('[data-key="dvs.threshold_on"]')
    return page, wrong


def enter(page: Any, name: str, control: Control, value: Any) -> None:
    """Set a control as a person does."""
    row = page.locator(f'[data-key="{name}.{control.key}"]')
    if control.kind == "switch":
        row.locator(".q-toggle").click()
        return
    if control.kind == "choice":
        choose(page, row.locator(".q-select"), value)
        return
    shown = control.shown(value)
    for field, part in zip(
        row.locator(".v-value input").all(), shown if isinstance(shown, list) else [shown], strict=True
    ):
        field.fill(str(part))
    row.locator(".v-value input").last.blur()


def choose(page: Any, opener: Any, name: str) -> None:
    """Open a menu and click an item; what else changes on the page may close it, then it is opened again."""
    item = page.locator(".q-menu .q-item:visible", has_text=re.compile(rf"^{name}$"))
    for _ in range(8):
        opener.click()
        try:
            item.first.click(timeout=5000)
            return
        except playwright.TimeoutError:
            page.keyboard.press("Escape")
    raise AssertionError(f"no menu with {name}")


def other(control: Control, value: Any, spec: Any) -> Any:
    """A value that is another, and can be."""
    if control.kind == "switch":
        return not value
    if control.kind == "choice":
        return next(choice for choice in control.choices if choice != value)
    if control.kind == "vector":
        return tuple(type(part)(part + 1) for part in value or (1.0,) * control.places)
    if control.kind == "toml":
        return {"gamma": 1.8, "shading": (0.1, -0.2)}[control.key]
    if control.kind == "whole":
        return value + 1 if control.high is None or value < control.high else value - 1
    tried = (float(f"{value * 1.25 + step:.6g}") for step in (0.0, 0.01, 1.0, -0.01))
    return next(one for one in tried if one != value and _can_be(spec, control.key, one))


def _can_be(spec: Any, key: str, value: Any) -> bool:
    try:
        type(spec)(**(spec.model_dump() | {key: value}))
    except ValueError:
        return False
    return True


def command(page: Any) -> str:
    page.locator(".v-right .q-tab", has_text="Record").click()
    return page.locator('[data-key="command"]').inner_text()


def wait_for(what: Any, seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end
        time.sleep(0.1)


def children(process: subprocess.Popen) -> list[str]:
    """The working processes of the page's program; those that only watch others are not among them."""
    listed = subprocess.run(["ps", "-o", "args=", "--ppid", str(process.pid)], capture_output=True, text=True).stdout
    return [line for line in listed.splitlines() if "spawn_main" in line]


def test_a_change_is_seen_a_bad_one_is_refused_and_two_tabs_do_not_mix(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    second, _ = opened(browser, address)
    picture = page.locator('[data-camera="dvs"] img')
    page.wait_for_selector('[data-camera="dvs"] img[src^=data]')
    before = picture.get_attribute("src")
    threshold = controls_of(DvsSpec)[[control.key for control in controls_of(DvsSpec)].index("threshold_on")]
    enter(page, "dvs", threshold, 0.6)
    wait_for(lambda: picture.get_attribute("src") != before)
    enter(page, "dvs", threshold, -1.0)
    refused = page.locator('[data-key="dvs.threshold_on"] .v-error')
    wait_for(
        lambda: "threshold_on = -1.0 in sensor ideal is impossible: it must be greater than 0" in refused.inner_text()
    )
    wait_for(lambda: "--set threshold_on=0.6" in command(page))
    page.locator('[data-key="dvs.threshold_on"] .v-reset').click()
    wait_for(lambda: not refused.is_visible())
    assert command(second) == f"vid2ev convert {SCENE} --sensor ideal --cis ideal"
    picture.click()
    page.locator(".v-right .q-tab", has_text="Pixel").click()
    page.wait_for_selector(".nicegui-echart canvas")
    assert wrong == []
    wait_for(lambda: len(children(address[2])) in (2, 3))  # (one for each page, and perhaps one that compiles)
    for each in (page, second):
        each.context.close()
    wait_for(lambda: not children(address[2]))


def test_the_page_is_served_to_this_machine_alone(address: Any) -> None:
    host, port = address[0].removeprefix("http://").split(":")
    here = f"127.0.0.1:{port}"
    for name, origin, status in (
        (here, "", b"200"), (here, f"http://{here}", b"200"), ("evil.example", "", b"403"),
        (here, "http://evil.example", b"403"), (here, "http://127.0.0.1:1", b"403"), (here, "null", b"403"),
        (here, "http:127.0.0.1", b"403"),
    ):  # fmt: skip
        with socket.create_connection((host, int(port))) as link:
            came = f"Origin: {origin}\r\n" * bool(origin)
            link.sendall(f"GET / HTTP/1.1\r\nHost: {name}\r\n{came}Connection: close\r\n\r\n".encode())
            assert link.recv(64).split()[1] == status, origin


def test_who_leaves_while_a_page_is_sent_leaves_no_traceback(address: Any) -> None:
    host, port = address[0].removeprefix("http://").split(":")
    for k in range(30):
        for path in ("/", "/_nicegui_ws/socket.io/?EIO=4&transport=polling"):
            with socket.create_connection((host, int(port))) as link:
                link.sendall(f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode())
                time.sleep(0.002 * (k % 3))
    time.sleep(1)
    assert "Traceback" not in (address[1] / "log").read_text()


def test_each_control_moves_a_value_that_reaches_files_and_the_manifest(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    expected = {}
    for name, kind, spec in (("dvs", DVS, DvsSpec), ("cis", CIS, CisSpec)):
        base = load(kind, "ideal")
        page.locator(".v-side .q-btn-group .q-btn", has_text=name).first.click()
        page.wait_for_selector(f'[data-key="{name}.shading"]')
        values = {}
        for control in controls_of(spec):
            values[control.key] = other(control, getattr(base, control.key), base.model_copy(update=values))
            enter(page, name, control, values[control.key])
        expected[name] = spec(**values)
    page.locator(".v-side .q-tab", has_text="Camera").click()
    page.wait_for_selector('[data-key="rig.dvs.translation_mm"]')
    rig = {"size": (40, 30), "fov_deg": 50.0, "distortion_model": "radtan", "distortion": (0.1, 0.0, 0.0, 0.0),
           "rotation_deg": (0.0, 1.0, 0.0), "translation_mm": (5.0, 0.0, 1.0), "clock_offset_us": 50,
           "seed": 3}  # fmt: skip
    for control in controls_of(Camera):
        if control.key in rig:
            enter(page, "rig.dvs", control, rig[control.key])
    page.locator(".v-side .q-tab", has_text="Scene").click()
    page.wait_for_selector('[data-key="scene.duration_s"]')
    from vid2ev.scenes.scene import Setting

    settled = read_scene("spinning-shapes", ["camera.size=[48, 36]", "duration_s=0.2"]).resolved(0)
    setting = {}
    for control in controls_of(Setting, without=("rig",)):
        value = getattr(settled.scene, control.key)
        given = {"environment": "hubble", "duration_s": 0.05}.get(control.key)
        setting[control.key] = given or other(control, value, settled.scene)
        enter(page, "scene", control, setting[control.key])
    thing = settled.objects[0].name
    choose(page, page.locator('.q-select:has([data-key="part"]), .q-select[data-key="part"]').first, f"objects.{thing}")
    page.wait_for_selector(f'[data-key="objects.{thing}.specular"]')
    for key, value in (("specular", 0.5), ("position_m", (0.1, 0.2, 1.5))):
        control = next(each for each in [*controls_of(Object), *_place()] if each.key == key)
        enter(page, f"objects.{thing}", control, value)
    wait_for(lambda: "scene.toml --rig rig.toml" in command(page))
    for item in ("rig", "scene"):
        choose(page, page.locator("[data-key=save]"), item)
        page.locator(".q-dialog button", has_text="Save").click()
        wait_for(lambda item=item: (address[1] / f"{item}.toml").exists())
    saved = read_rig(address[1] / "rig.toml")
    for camera, kind in zip(saved.cameras, (DVS, CIS), strict=True):
        changes = [f"{key}={json.dumps(value)}" for key, value in camera.set.items()]
        assert load(kind, camera.sensor, changes) == expected[camera.name]
    assert {key: getattr(saved.cameras[0], key) for key in rig} == rig
    scene = read_scene(address[1] / "scene.toml").resolved()
    assert scene.scene.model_dump(exclude={"rig"}) == {key: value for key, value in setting.items()}
    assert scene.objects[0].specular == 0.5 and scene.objects[0].trajectory[0].position_m == (0.1, 0.2, 1.5)
    page.locator("[data-key=convert]").click()
    said = page.locator('[data-key="said"]')
    wait_for(lambda: "events" in said.inner_text() and "_events:" in said.inner_text(), 280)
    manifest = json.loads((address[1] / "spinning-shapes_events" / "manifest.json").read_text())
    for name, spec in expected.items():
        assert manifest["cameras"][name]["parameters"] == spec.model_dump(mode="json")
    assert wrong == []


def place_of_things(page: Any) -> dict[str, Any]:
    """Where each named thing of the 3-D view is: on the screen [px], and in the view."""
    page.locator(".v-right .q-tab", has_text="World").click()
    page.locator(".v-right canvas").last.scroll_into_view_if_needed()
    page.wait_for_timeout(500)
    return page.evaluate(
        """() => {
            const view = [...document.querySelectorAll("[id^=c]")].map((e) => {
                try { return getElement(+e.id.slice(1)) } catch { return null }
            }).find((e) => e && e.scene && e.camera)
            const box = view.$el.querySelector("canvas").getBoundingClientRect(), places = {}
            view.scene.traverse((thing) => {
                if (!thing.name) return
                const there = thing.getWorldPosition(thing.position.clone()), own = there.toArray()
                there.project(view.camera)
                const at = [box.left + (there.x + 1) / 2 * box.width, box.top + (1 - there.y) / 2 * box.height]
                places[thing.name] = { at, own }
            })
            return places
        }"""
    )


def drag(page: Any, name: str, way_px: tuple[float, float]) -> None:
    """Drag a thing of the 3-D view as a person does."""
    wait_for(lambda: name in place_of_things(page))  # (when something changed they are drawn anew)
    x, y = place_of_things(page)[name]["at"]
    page.mouse.move(x, y)
    page.wait_for_timeout(200)
    page.mouse.down()
    for k in range(1, 9):
        page.mouse.move(x + way_px[0] * k / 8, y + way_px[1] * k / 8)
        page.wait_for_timeout(40)
    page.mouse.up()


def test_things_lamps_and_cameras_are_moved_in_the_3d_view(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    go_to(page, "scene:room,size=48x36,duration_s=0.1")
    scene = read_scene("room", ["camera.size=[48, 36]", "duration_s=0.1"]).resolved(0)
    lamp = next(f"lights.{each.name}" for each in scene.lights if each.kind == "point")
    wait_for(lambda: lamp in place_of_things(page))
    before = place_of_things(page)
    for name in (lamp, "cameras.dvs"):
        drag(page, name, (30.0, -20.0))
        wait_for(lambda name=name: place_of_things(page).get(name, before[name])["own"] != before[name]["own"])
        tab = "Camera" if name.startswith("cameras") else "Scene"
        page.wait_for_selector(f'.v-side .q-tab--active:has-text("{tab}")')
    assert command(page).startswith("vid2ev convert scene.toml --rig rig.toml")
    wait_for(lambda: place_of_things(page).keys() >= before.keys())
    after = place_of_things(page)
    changed = {name for name in before if before[name]["own"] != pytest.approx(after[name]["own"], abs=1e-6)}
    assert changed == {lamp, "cameras.dvs"}
    page.locator(".v-side .q-tab", has_text="Scene").click()
    page.locator("button", has_text="Whole scene as it was").click()
    there = pytest.approx(before[lamp]["own"], abs=1e-6)
    page.locator('[data-key="time"]').click()  # (in its middle)
    wait_for(
        lambda: place_of_things(page)["cameras.dvs"]["own"] != after["cameras.dvs"]["own"]
    )  # (it is carried about)
    wait_for(lambda: place_of_things(page).get(lamp, {"own": None})["own"] == there)
    assert page.locator(".v-status").inner_text().count("failed") == 0 and wrong == []


def test_files_are_loaded_and_the_command_is_copied(browser: Any, address: Any, tmp_path: Path) -> None:
    page, wrong = opened(browser, address)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    for name, text, said in (
        ("good.toml", "[dvs]\nthreshold_on = 0.33\n", "good.toml is loaded"),
        ("bad.toml", "[dvs]\nthreshold_on = -3\n", "threshold_on = -3 in sensor bad.toml is impossible"),
        ("torn.toml", "[dvs", "torn.toml is not valid TOML"),
    ):
        (tmp_path / name).write_text(text)
        page.locator("button", has_text="Load").click()
        page.locator(".q-uploader input[type=file]").set_input_files(tmp_path / name)
        page.wait_for_selector(f'.q-notification:has-text("{said}")')
        page.wait_for_selector(".q-uploader", state="detached")  # (while the menu closes it takes no other file)
    (tmp_path / "rig.toml").write_text(RIG.replace('"ideal"', '"own.toml"', 1))
    (tmp_path / "own.toml").write_text("[dvs]\nthreshold_on = 0.44\n")
    page.locator("button", has_text="Load").click()
    page.locator(".q-uploader input[type=file]").set_input_files(tmp_path / "rig.toml")
    page.wait_for_selector('.q-notification:has-text("give the path of rig.toml instead")')
    page.wait_for_selector(".q-uploader", state="detached")
    shown = page.locator('[data-key="dvs.threshold_on"] .v-value input')
    wait_for(lambda: shown.input_value() == "0.33")
    expected = command(page)
    page.locator("button", has_text="Copy").click()
    wait_for(lambda: page.evaluate("navigator.clipboard.readText()") == expected)
    assert "threshold_on=0.33" in expected
    page.locator("button", has_text="Load").click()
    path = page.locator('input[data-key="path"], [data-key="path"] input').first
    path.fill(str(tmp_path / "rig.toml"))
    path.press("Enter")
    wait_for(lambda: shown.input_value() == "0.44")
    assert wrong == []


def go_to(page: Any, source: str) -> None:
    """Open another source, as typed."""
    page.locator(".v-side .q-tab", has_text="Source").click()
    entry = page.locator('input[data-key="source"], [data-key="source"] input').first
    entry.fill(source)
    entry.press("Enter")
    wait_for(lambda: page.locator(".v-source").inner_text() == source)


def replace_what_is_there(page: Any) -> None:
    """What other tests have recorded may be replaced."""
    page.locator(".v-right .q-tab", has_text="Record").click()
    page.locator(".q-toggle", has_text="overwrite").click()


NAMELESS = re.compile(
    r"^\s*- ((?:button|slider|spinbutton|textbox|combobox|switch|tab)(?:: .*|:| \[.*|))$", re.MULTILINE
)


@pytest.mark.parametrize("width", [390, 800, 2560])
def test_each_control_has_a_name_and_a_visible_focus_in_windows_of_any_width(
    browser: Any, address: Any, width: int
) -> None:
    page, wrong = opened(browser, address, color_scheme="dark")
    page.set_viewport_size({"width": width, "height": 900})
    page.wait_for_selector('[data-camera="dvs"] img[src^=data]')
    assert page.evaluate("document.documentElement.lang") == "en-US"
    for side, tabs in ((".v-side", "Source Camera Scene Sensor"), (".v-right", "Plan World Cost Compare Record Pixel")):
        for tab in tabs.split():
            page.locator(f"{side} .q-tab", has_text=tab).click()
            page.wait_for_selector(f'{side} .q-tab--active:has-text("{tab}")')
            assert NAMELESS.findall(page.locator("body").aria_snapshot()) == []
            assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.locator('[data-key="dvs.threshold_on"] .v-value input').focus()
    page.keyboard.press("Shift+Tab")
    assert page.evaluate("document.activeElement.matches('.q-slider__track-container')")
    assert page.evaluate("getComputedStyle(document.activeElement).boxShadow") != "none" and wrong == []


def test_a_source_that_cannot_be_seen_fades_the_pictures_of_the_one_before(
    browser: Any, address: Any, tmp_path: Path
) -> None:
    page, wrong = opened(browser, address)
    page.wait_for_selector('[data-camera="dvs"] img[src^=data]')
    page.locator(".v-side .q-tab", has_text="Source").click()
    entry = page.locator('input[data-key="source"], [data-key="source"] input').first
    for name in ("nothing.mp4", ""):
        entry.fill(name)
        entry.press("Enter")
        page.wait_for_selector(f'.v-side .v-error:has-text("{name}: no such file" )' if name else
                               '.v-side .v-error:has-text("no source is named")')  # fmt: skip
        assert page.locator(".v-source").inner_text() == SCENE and page.locator(".v-stale").count() == 0
    go_to(page, str(tmp_path))  # (a folder without images)
    page.wait_for_selector('.v-stale [data-camera="dvs"]')
    assert "no images in this folder" in page.locator(".v-status.v-bad").inner_text()
    go_to(page, SCENE)
    page.wait_for_selector(".v-stale", state="detached")
    assert page.locator(".v-bad").count() == 0 and wrong == []


def test_the_camera_that_took_a_video_has_controls(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    go_to(page, str(ROOT / "examples" / "demo.mp4"))
    page.locator(".v-side .q-tab", has_text="Camera").click()
    page.locator(".v-side .q-btn", has_text="the video's").click()
    field = page.locator('[data-key="rig.the video\'s.fov_deg"] input')
    field.fill("50")
    field.blur()
    wait_for(lambda: "--rig rig.toml" in command(page))
    page.locator(".v-side .q-btn-group .q-btn:visible", has_text="cis").click()
    page.locator(".v-side .q-btn:visible", has_text="Remove").click()
    page.wait_for_selector('[data-key="rig.dvs.size"]')
    page.locator(".v-side .q-btn-group .q-btn:visible", has_text="the video's").click()
    go_to(page, SCENE)  # (which has none)
    page.locator(".v-side .q-tab", has_text="Scene").click()
    page.locator('[data-key="scene.duration_s"] input').fill("0.1")
    wait_for(lambda: "scene.toml" in command(page))
    assert wrong == [] and "deleted" not in (address[1] / "log").read_text()


def test_it_plays_while_a_slider_moves(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    page.wait_for_selector('[data-camera="dvs"] img[src^=data]')
    said = page.locator(".v-right .v-line .v-muted", has_text=re.compile(r"^\d\.\d+ of"))
    track = page.locator('[data-key="dvs.threshold_on"] .q-slider').bounding_box()
    page.locator('[aria-label="play"]').click()
    x, y = track["x"], track["y"] + track["height"] / 2
    page.mouse.move(x + 20, y)
    page.mouse.down()
    seen: set[str] = set()
    for k in range(2000):
        page.mouse.move(x + 20 + k % 40, y)
        page.wait_for_timeout(30)
        seen.add(said.inner_text())
        if len(seen) > 3:
            break
    page.mouse.up()
    page.locator('[aria-label="pause"]').click()
    assert len(seen) > 3 and wrong == []


def test_each_scene_becomes_a_recording_by_two_clicks(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    said = page.locator('[data-key="said"]')
    replace_what_is_there(page)
    for name in scene_names():
        page.locator(".v-side .q-tab", has_text="Source").click()
        page.locator(f'[data-scene="{name}"]').click()
        wait_for(lambda name=name: f"vid2ev convert scene:{name} --" in command(page))
        go_to(page, f"scene:{name},size=48x36,duration_s=0.02")
        page.locator("[data-key=convert]").click()
        wait_for(lambda name=name: f"{name}_events:" in said.inner_text() and "events," in said.inner_text(), 280)
        manifest = json.loads((address[1] / f"{name}_events" / "manifest.json").read_text())
        assert manifest["source"]["path"].startswith(f"scene:{name}") and {*manifest["cameras"]} == {"dvs", "cis"}
    assert wrong == []


def test_work_is_cancelled_and_ends_with_its_page(browser: Any, address: Any) -> None:
    page, _ = opened(browser, address)
    go_to(page, "scene:parallax,size=640x480")
    said = page.locator('[data-key="said"]')
    replace_what_is_there(page)
    page.locator("[data-key=convert]").click()
    wait_for(lambda: " frames" in said.inner_text(), 120)
    page.locator("button:visible", has_text="Cancel").click()
    wait_for(lambda: said.inner_text() == "cancelled", 30)
    page.locator("[data-key=convert]").click()
    wait_for(lambda: " frames" in said.inner_text(), 120)
    page.context.close()
    wait_for(lambda: not children(address[2]))


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_page_that_is_open_when_the_program_ends_leaves_nothing_behind(
    browser: Any, tmp_path: Path, how: signal.Signals
) -> None:
    (tmp_path / "given.toml").write_text(RIG)
    (tmp_path / "tmp").mkdir()
    with serving(tmp_path, TMPDIR=str(tmp_path / "tmp")) as served:
        page, _ = opened(browser, served)
        page.wait_for_selector("[data-camera] img")
        served[2].send_signal(how)
        served[2].wait(timeout=60)
    assert [*(tmp_path / "tmp").glob("vid2ev*")] == []


def test_statistics_stand_beside_those_of_a_recording(browser: Any, address: Any) -> None:
    page, wrong = opened(browser, address)
    text = "".join(f"{1000 * k} {k % 40} {k % 30} {k % 2}\n" for k in range(500))
    (address[1] / "real.txt").write_text("# width 40 height 30\n" + text)
    page.locator(".v-right .q-tab", has_text="Compare").click()
    entry = page.locator('input[data-key="real"], [data-key="real"] input').first
    entry.fill("nothing.txt")
    page.locator("button:visible", has_text="Open").last.click()
    page.wait_for_selector('.v-right .v-bad:has-text("nothing.txt")')
    entry.fill("real.txt")
    page.locator("button:visible", has_text="Open").last.click()
    page.wait_for_selector('.v-right th:has-text("recording")')
    assert "500" in page.locator(".v-right .v-table:visible").first.inner_text() and wrong == []


def _place() -> tuple[Control, ...]:
    from vid2ev.scenes.trajectory import Fixed

    return controls_of(Fixed)
