"""Names of what is evaluated can be those of files, however long what was asked for is."""

from __future__ import annotations

from pathlib import Path

import pytest

from interp.evaluate.naming import LONGEST, plain
from interp.evaluate.run import evaluate


@pytest.mark.parametrize("letters", ["a", "b ", "山", "é"])
def test_long_names_are_cut_and_stay_apart(letters: str) -> None:
    names = [letters * 200 + end for end in ("1", "2")]
    made = [*map(plain, names)]
    assert len({*made}) == 2 and all(len(name.encode()) <= LONGEST for name in made)
    assert all(plain(name) == name for name in made)
    short = letters.strip() * 30
    assert plain(short) == short


def test_a_scene_with_more_settings_than_a_name_of_a_file_has_letters_is_scored(tmp_path: Path) -> None:
    scene = f"scene:room,size=32x24,scene.duration_s=0.05{'0' * 250}"
    assert len(scene) > 255
    rows = evaluate([scene], tmp_path / "report", baselines=["linear"], limit=1).rows
    assert len(rows) == 7 and (tmp_path / "report" / "report.html").exists()
