"""The options of a source, from the command line and from Python, as far as the manifest."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from vid2ev.commands import main
from vid2ev.errors import UsageError
from vid2ev.seen.instants import events_of
from vid2ev.seen.recipe import Recipe
from vid2ev.sources import open_source

CLIP = "synthetic:moving-edge,size=40x30,duration_s=0.2,fps=100"


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments, prog_name="vid2ev")


def converted(folder: Path, *arguments: str) -> dict:
    done = run("convert", *arguments, "-o", str(folder / "out"), "--sensor", "ideal", "--no-preview", "--threads", "1")
    assert done.exit_code == 0, done.output
    return json.loads((folder / "out" / "manifest.json").read_text())


@pytest.mark.parametrize("source", [CLIP, "scene:room,size=8x6"])
@pytest.mark.parametrize("option", ["fps", "slowdown", "start", "stop"])
@pytest.mark.parametrize("value", ["25", "30000/1001", True, [1], b"1"])
def test_what_is_no_number_is_refused_from_python(source: str, option: str, value: object) -> None:
    """A text, too: whether it is one of a command line, and in what notation, nobody says."""
    with pytest.raises(UsageError, match=rf"^{option} .*: expected a number"):
        open_source(source, **{option: value})


def test_edits_reach_the_recording_and_its_manifest(tmp_path: Path) -> None:
    manifest = converted(
        tmp_path, CLIP, "--start", "0.05", "--stop", "0.15", "--slowdown", "2", "--crop", "20x20", "--size", "10"
    )
    assert manifest["source"]["edits"] == {
        "start_s": 0.05, "stop_s": 0.15, "slowdown": "2", "part": [10, 5, 20, 20], "resized": True,
    }  # fmt: skip
    assert manifest["source"]["size"] == [10, 10] == manifest["sensor"]["size"]
    assert manifest["counts"]["frames"] == 11 and manifest["start_us"] == 25_000
    assert manifest["duration_us"] == 50_000


def test_a_photograph_in_motion_becomes_a_recording(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (60, 80)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), picture)
    manifest = converted(
        tmp_path, str(tmp_path / "photo.png"), "--motion", "pan:speed=50,duration_s=0.1", "--size", "40x30"
    )
    assert manifest["source"]["motion"] == "pan" and manifest["counts"]["events"] > 1000
    described = run("info", str(tmp_path / "photo.png"), "--motion", "saccade", "--json")
    assert described.exit_code == 0 and json.loads(described.output)["kind"] == "photograph"


def test_a_source_is_described_as_it_would_be_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((4, 6, 8), np.uint8))
    assert run("info", str(tmp_path / "a.npy")).exit_code == 2
    done = run("info", str(tmp_path / "a.npy"), "--fps", "10", "--transfer", "pq", "--crop", "4x4", "--json")
    about = json.loads(done.output)
    assert about["transfer"] == "pq" and about["size"] == [4, 4]


@pytest.mark.parametrize("arguments", [
    ("--start", "7"), ("--crop", "99x99"), ("--size", "x"), ("--motion", "pan"), ("--slowdown", "1e9"),
    ("--transfer", "hdr"),
])  # fmt: skip
def test_what_cannot_be_is_refused_before_converting(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    for extra in ((), ("--dry-run",)):
        done = run("convert", CLIP, *arguments, *extra, "-o", str(tmp_path / "out"))
        assert done.exit_code == 2 and done.output.startswith("error: ") and done.output.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_same_options_in_python() -> None:
    recipe = Recipe.of(CLIP, "ideal", start=0.1, slowdown=4, size="20", seed=3)
    assert recipe.source.size == (20, 15) and recipe.seed == 3
    assert recipe.describe()["source"]["edits"]["slowdown"] == "4"
    events = [e for e in events_of(CLIP, "ideal", upsample="none", start=0.1) if len(e)]
    assert events and events[0].t[0] > 100_000
