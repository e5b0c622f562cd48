"""The script that makes the table and the picture of the README, and what the README shows."""

from __future__ import annotations

import contextlib
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner
from matplotlib.image import imread
from moving_texture import texture

from vid2ev.commands.cost import cost

ROOT = Path(__file__).parents[2]
PAGE = """# A page

| another | table |
|---|---|

## What accuracy costs

As it was:

| setting |
|:--|
| old |

Measured: long
ago.

## Limits

| a table | that stays |
"""


@pytest.fixture(scope="module")
def example() -> ModuleType:
    path = ROOT / "examples" / "cost_of_accuracy.py"
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification and specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_table_goes_into_its_section(example: ModuleType, tmp_path: Path) -> None:
    clip = texture(tmp_path, frames=5)
    (tmp_path / "page.md").write_text(PAGE)
    asked = [clip, "--sensor", "ideal", "--repeats", "1", "--threads", "1", "--into", "page.md", "-o", "cost.png"]
    with contextlib.chdir(tmp_path):
        done = CliRunner().invoke(example.main, [*asked, "--fps", "50"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    page = (tmp_path / "page.md").read_text()
    assert "| another | table |" in page and "| a table | that stays |" in page and "| old |" not in page
    assert "long\nago" not in page and page.count("\nMeasured: `texture.npy`, 96x64") == 1
    rows = re.findall(r"^\| (.*) \|$", page.partition("As it was:")[2].partition("## Limits")[0], re.MULTILINE)
    assert len({row.count(" | ") for row in rows}) == 1
    assert sum("→" in row for row in rows) == 1 and any(row.startswith("**") for row in rows)
    assert imread(tmp_path / "cost.png").shape[:2] == (600, 950)


def test_a_size_that_is_given_stays_as_by_the_command(example: ModuleType, tmp_path: Path) -> None:
    common = [texture(tmp_path, frames=5), "--sensor", "ideal", "--repeats", "1", "--threads", "1", "--fps", "50"]
    with contextlib.chdir(tmp_path):
        for size in ([], ["--size", "48x32"]):
            shown = CliRunner().invoke(example.main, [*common, *size], catch_exceptions=False).output
            told = CliRunner().invoke(cost, [*common, *size, "--overwrite"], catch_exceptions=False).output
            assert ("half the size" in shown) == ("half the size" in told) == (not size)


def test_a_page_without_such_a_section_is_refused(example: ModuleType) -> None:
    import click

    with pytest.raises(click.ClickException, match="no section"):
        example.put("# A page\n", None)


def test_the_readme_shows_what_the_script_makes(example: ModuleType) -> None:
    section = (ROOT / "README.md").read_text(encoding="utf-8").partition(example.HEADING)[2].partition("\n## ")[0]
    assert example.TABLE.search(section) and example.MEASURED.search(section)
    assert "examples/cost_of_accuracy.py" in section and "docs/cost.png" in section
    assert section.count("→") == 1
    assert (ROOT / "docs" / "cost.png").stat().st_size < 150_000
