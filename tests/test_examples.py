"""The examples run and find what they say; the pages in docs/ name options, keys and files that are there."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import click
import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev import DvsSpec, load_sensor
from vid2ev.__main__ import main

ROOT = Path(__file__).parents[1]
FROM_V2E = ROOT / "docs" / "from_v2e.md"


@pytest.fixture(scope="module")
def against_v2e() -> ModuleType:
    path = ROOT / "examples" / "against_v2e.py"
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification and specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def measured(against_v2e: ModuleType) -> list[dict]:
    done = CliRunner().invoke(against_v2e.main, ["--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.output)


def test_the_presets_obey_the_laws(measured: list[dict]) -> None:
    """Each measurement is within five standard errors of v2e's law, or of ours where that is said to be another."""
    assert len(measured) == 27
    for row in measured:
        law = row["expected"] if row["ours"] is None else row["ours"]
        assert row["error"] > 0 and row["v2e"] is None
        assert abs(row["value"] - law) <= 5 * row["error"], row


def test_the_laws_that_differ_from_v2es_are_leak_and_shot_noise(measured: list[dict]) -> None:
    others = {row["law"].split(":")[0] for row in measured if row["ours"] is not None}
    assert others == {"leak", "shot noise"}


def test_the_page_shows_what_is_measured(measured: list[dict]) -> None:
    """Laws and values in the table of the page are those of the example."""
    lines = FROM_V2E.read_text(encoding="utf-8").splitlines()
    for row in measured:
        line = next(line for line in lines if f"| {row['case']} | {row['expected']:.4g} {row['unit']}".rstrip() in line)
        shown, error = re.findall(r"([-\d.]+) ± ([\d.]+)", line)[0]
        assert abs(float(shown) - row["value"]) <= 2 * float(error), line


FAKE = """
import numpy as np
class EventEmulator:
    def __init__(self, seed, device): self.sigma_thres = 1.0
    def set_dvs_params(self, preset): assert preset == "clean"
    def generate_events(self, frame, t):
        print("chatter")
        if t == 0: return None
        y, x = np.nonzero(frame > 100 * self.sigma_thres)
        return np.stack([np.full(len(x), t), x, y, np.where(x % 2, 1, -1)], 1).astype(np.float32)
"""


def test_what_another_simulator_sends_arrives(against_v2e: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "v2ecore").mkdir()
    (tmp_path / "v2ecore" / "emulator.py").write_text(FAKE)
    scene = against_v2e.Scene(np.array([0, 1500, 3000]), np.array([[0, 0, 0], [0, 201, 202], [255, 0, 0.0]]), 2)
    with against_v2e.v2e_side(tmp_path, sys.executable) as run:
        for _ in range(2):
            sent = run("clean", {"sigma_thres": 2.0}, scene)
            assert sent.t.tolist() == [1500] * 4 + [3000] * 2
            assert sent.x.tolist() == [1, 2, 1, 2, 0, 0] and sent.y.tolist() == [0, 0, 1, 1, 0, 1]
            assert sent.p.tolist() == [1, 0, 1, 0, 0, 0]


def test_a_checkout_that_is_none_is_one_sentence(against_v2e: ModuleType, tmp_path: Path) -> None:
    scene = against_v2e.Scene(np.array([0]), np.zeros((1, 1)))
    with (
        against_v2e.v2e_side(tmp_path, sys.executable) as run,
        pytest.raises(click.ClickException, match="cannot run v2e"),
    ):
        run("clean", {}, scene)


def our_options() -> set[str]:
    commands = [main.get_command(click.Context(main), name) for name in ("convert", "render", "reformat")]
    options = [option for command in commands if command for option in command.params]
    return {name for option in options for name in (*option.opts, *option.secondary_opts)}


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda page: page.name)
def test_links_of_the_pages_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert target.startswith("http") or (page.parent / target).exists(), target


def test_the_page_names_options_keys_and_files_that_are_there() -> None:
    page = FROM_V2E.read_text(encoding="utf-8")
    rows = page.partition("## Options")[2].partition("\n\nIn v2e")[0]
    ours = " ".join(line.split(" | ")[1] for line in rows.splitlines() if line.count(" | ") >= 2)
    ours += " ".join(re.findall(r"^(?:vid2ev|  --).*$", page, re.MULTILINE))
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", ours))
    assert len(named) > 20
    assert named <= our_options(), named - our_options()
    settings = re.findall(r"--set (\w+=[\w.]+)", page)
    assert len(settings) > 10
    load_sensor("v2e-noisy", settings)
    equations = page.partition("## The model, equation by equation")[2].partition("## Options")[0]
    keys = {key for line in equations.splitlines() for key in re.findall(r"`([a-z_0-9]+)`", line.split(" | ")[-1])}
    assert len(keys) > 10
    assert keys <= set(DvsSpec.model_fields), keys - set(DvsSpec.model_fields)
    assert all((ROOT / name).exists() for name in re.findall(r"examples/[\w.]+", page))


def test_the_python_of_the_page_runs() -> None:
    blocks = re.findall(r"```python\n(.*?)```", FROM_V2E.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    for code in blocks:
        namespace: dict[str, object] = {}
        with contextlib.redirect_stdout(None):
            exec(compile(code, FROM_V2E.name, "exec"), namespace)
        assert len(namespace["events"])  # type: ignore[arg-type]
