"""The clip that is shipped is the one its script makes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev.sources import open_source

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_the_clip_is_small_and_readable() -> None:
    clip = EXAMPLES / "demo.mp4"
    assert clip.stat().st_size < 2_000_000
    source = open_source(clip)
    times = [frame.t_ns for frame in source.frames()]
    assert source.size == (640, 480) and len(times) == source.frames_expected == 90
    assert times[-1] == 2_966_666_667 and source.warnings == []
    assert source.describe()["transfer"] == "bt709" and source.describe()["range"] == "limited"


@pytest.fixture
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_demo_clip", EXAMPLES / "make_demo_clip.py")
    assert spec and spec.loader
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.mark.parametrize("index", [0, 45, 89])
def test_the_clip_shows_what_the_script_draws(index: int, script: ModuleType) -> None:
    drawn = script.picture(script.scene(), index) @ np.array([0.0722, 0.7152, 0.2126], np.float32)
    shown = next(open_source(EXAMPLES / "demo.mp4").frames(index)).light
    errors = np.clip(drawn, 0, 1) ** (1 / 2.2) - shown ** (1 / 2.2)
    assert -10 * np.log10(np.mean(np.square(errors))) > 33


def test_a_colon_in_a_name_names_no_protocol(
    script: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(script, "FPS", 1)
    monkeypatch.setattr(script, "SECONDS", 1)
    result = CliRunner().invoke(script.main, ["a:b.mp4"])
    assert result.exit_code == 0 and [path.name for path in tmp_path.iterdir()] == ["a:b.mp4"]
