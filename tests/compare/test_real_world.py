"""The page on real recordings says what they are, and its light is what it says."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from vid2ev.compare.statistics import statistics_of
from vid2ev.stream.events import Events

ROOT = Path(__file__).parents[2]
DATA = ROOT / ".." / "shared" / "data"
PAGE = (ROOT / "docs" / "real_world.md").read_text(encoding="utf-8")
needs_data = pytest.mark.skipif(not (DATA / "hybrid").exists(), reason=f"needs {DATA / 'hybrid'}")


@pytest.fixture(scope="module")
def real_world() -> ModuleType:
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(ROOT / "examples")
        return importlib.import_module("real_world")


def column(title: str, name: str) -> dict[str, str]:
    """A column of a table of the page."""
    lines = PAGE[PAGE.index(f"\n| {title} |") + 1 :].split("\n\n")[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    at = cells[0].index(name)
    return {row[0]: row[at] for row in cells[2:]}


@needs_data
@pytest.mark.parametrize(("name", "title"), [("toy", "toy"), ("badminton", "wall"), ("keyboard", "keyboard")])
def test_the_page_says_what_the_recordings_are(real_world: ModuleType, name: str, title: str) -> None:
    scene = real_world.load_scene(DATA, name, wall_only=title == "wall")
    found = statistics_of([scene.events], real_world.load_scene(DATA, name).light.shape[::-1], (0, scene.span_us))
    assert column(title, "real") == real_world.numbers(found, scene.kept)


@needs_data
def test_the_page_says_what_the_wall_and_the_lamp_are(real_world: ModuleType) -> None:
    scene = real_world.load_scene(DATA, "badminton", wall_only=True)
    said = real_world.periods(DATA, scene)
    assert "= 0.93 +- 0.02" in said[0] and "0.93 +- 0.02" in PAGE
    strengths = {line.split(":")[0]: line for line in said[1:]}
    for part, strength in (("bright wall, OFF", "0.51 +- 0.06"), ("middle wall, OFF", "0.12 +- 0.04")):
        assert strength in strengths[part] and strength in PAGE


def test_light_moves_and_swings(real_world: ModuleType) -> None:
    frame = np.tile(np.linspace(0.2, 0.8, 61, dtype=np.float32), (5, 1))
    assert real_world.Drive().light(frame, 3000) is frame
    lamp = real_world.Drive(swing=0.3, trough_us=4000)
    levels = [float(np.log(lamp.light(frame, t_us) / frame).mean()) for t_us in (4000, 6500, 9000, 14000)]
    assert levels == pytest.approx([-0.15, 0.0, 0.15, -0.15], abs=1e-5)
    moved = real_world.Drive(velocity=(500.0, 0.0)).light(frame, 2000)  # one pixel to the right
    assert moved[:, 1:] == pytest.approx(frame[:, :-1], abs=1e-6)


def test_the_velocity_of_a_slope_is_found(real_world: ModuleType) -> None:
    """A pattern that moves to the right sends OFF where it rises, as many as the linear model says."""
    x = np.arange(60)
    light = np.tile((0.5 + 0.2 * np.sin(x / 5)).astype(np.float32), (40, 1))
    fall = 0.2 / 5 * np.cos(x / 5) / (0.52 + 0.2 * np.sin(x / 5)) * 3.0 / 0.01  # 3 px, thresholds of 0.01
    counts = np.round(np.abs(fall)).astype(int)
    columns = np.tile(np.repeat(x, counts), 40).astype(np.uint16)
    rows = np.repeat(np.arange(40), counts.sum()).astype(np.uint16)
    events = Events(np.zeros(len(columns), np.int64), columns, rows, (fall[columns] < 0).astype(np.uint8))
    scene = real_world.Scene(events, light, 6000, np.ones(light.shape, bool))
    right, down = real_world.velocity(scene, 0.01)
    assert right == pytest.approx(500.0, rel=0.05) and abs(down) < 5
