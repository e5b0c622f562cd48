"""The page about scenes is whole and true."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from vid2ev.scenes.complaints import all_keys
from vid2ev.scenes.ranges import KINDS
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.scene_file import read_scene
from vid2ev.scenes.textures import PHOTOGRAPHS
from vid2ev.sources import open_source

PAGE = Path(__file__).parents[2] / "docs/scenes.md"


def test_the_page_names_every_key_range_and_photograph() -> None:
    words = set(re.findall(r"[\w-]+", PAGE.read_text(encoding="utf-8")))
    assert not {*all_keys(Scene), *KINDS, *PHOTOGRAPHS} - words


def test_its_example_is_a_scene(tmp_path: Path) -> None:
    example = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    (tmp_path / "globe.toml").write_text(example)
    assert [thing.name for thing in read_scene(tmp_path / "globe.toml").resolved(0).objects] == ["globe"]


def test_its_python_runs() -> None:
    names: dict[str, object] = {}
    exec(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0], names)
    shift = names["shift"]
    assert isinstance(shift, np.ndarray) and shift.shape == (120, 160, 2) and 0.01 < np.nanmax(np.abs(shift)) < 30


def test_its_links_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE.read_text(encoding="utf-8")):
        assert (PAGE.parent / target).exists(), target


@pytest.mark.long
def test_its_frames_are_as_many_as_a_scene_has() -> None:
    rows = re.findall(r"^\| (`[\w-]+`|) *\| +([\d.]+) \| +(\d+) \| +-", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    scene, settings = "", "seed=1,size=120x90,duration_s=0.1"
    for name, shift, frames in rows:
        scene = name.strip("`") or scene
        source = open_source(f"scene:{scene},{settings},max_shift_px={shift}")
        assert source.frames_expected == int(frames), (scene, shift)
    assert len(rows) == 6
