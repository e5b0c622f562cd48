"""`vid2ev plan`, and `convert --effects`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from PIL import Image

from vid2ev import convert
from vid2ev.commands.plan import plan
from vid2ev.errors import UsageError
from vid2ev.plan.recordings import planned, plans_of
from vid2ev.recording.manifest import read_manifest
from vid2ev.seen.recipe import Recipe

CLIP = "synthetic:moving-edge,size=48x32,duration_s=0.2"


def test_the_table_and_the_json_say_the_same() -> None:
    table = CliRunner().invoke(plan, [CLIP, "--tolerance", "0.05"])
    found = CliRunner().invoke(plan, [CLIP, "--tolerance", "0.05", "--json"])
    assert table.exit_code == found.exit_code == 0, table.output + found.output
    rows = json.loads(found.output)[""]["rows"]
    lines = table.output.splitlines()
    assert [line.split()[:2] for line in lines[1 : len(rows) + 1]] == [[row["effect"], row["fate"]] for row in rows]
    assert lines[0].split() == ["effect", "fate", "distance", "kind", "figure", "cost", "why"]


def test_what_the_source_warns_of_is_said_beside_the_plan(tmp_path: Path) -> None:
    for number in (1, 2, 4):
        Image.new("L", (16, 12), 60 * number).save(tmp_path / f"{number:03}.png")
    found = CliRunner().invoke(plan, [str(tmp_path), "--fps", "100", "--json"])
    assert found.exit_code == 0 and json.loads(found.stdout)[""]["rows"]
    assert found.stderr.startswith("warning: ") and len(found.stderr.splitlines()) == 1, found.stderr


def test_a_recording_is_planned_and_says_so(tmp_path: Path) -> None:
    manifest = convert(CLIP, tmp_path / "a", effects="auto", tolerance=0.05, preview=False)
    said = plans_of(Recipe.of(CLIP), "auto", 0.05)[""]
    assert manifest["plan"][""] == json.loads(json.dumps(said.describe()))
    assert manifest["sensor"]["parameters"] == said.spec.model_dump(mode="json")
    assert read_manifest(tmp_path / "a")["plan"] == manifest["plan"]


def test_effects_that_are_named_need_no_look_at_the_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vid2ev.plan.recordings.instants", lambda recipe: pytest.fail("measured"))
    recipe = Recipe.of(CLIP, cis="phone")
    left, plans = planned(recipe, "refractory,read_noise")
    assert [mount.sensor.spec.effects() for mount in left.mounts] == [["refractory"], ["read_noise"]]
    assert all("was not measured" in str(plan) and plan.distance is None for plan in plans.values())


def test_all_effects_leave_no_trace(tmp_path: Path) -> None:
    assert "plan" not in convert(CLIP, tmp_path / "a", sensor="ideal", preview=False)


def test_of_what_passes_once_all_is_kept_unless_it_is_named() -> None:
    class Once:
        def __getattr__(self, name: str) -> object:
            return {"rewindable": False}.get(name)

    from dataclasses import replace

    once = replace(Recipe.of(CLIP), source=Once())  # type: ignore[arg-type]
    plan = plans_of(once)[""]
    assert {row.fate for row in plan.rows} == {"kept"} and plan.spec == once.mounts[0].sensor.spec
    assert "passes once" in str(plan) and plan.distance == 0.0
    named = plans_of(once, "mismatch")[""]
    assert named.spec.effects() == ["mismatch"] and named.distance is None
    with pytest.raises(UsageError, match="expected auto"):
        plans_of(once, "mismach")
