"""Many recordings and videos interpolated: found, in turn or shared out, to the same bytes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from small_takes import images, moving, recording

from interp.commands.interpolate import interpolate
from interp.commands.many import places, sources_in
from vid2ev.errors import UsageError


@pytest.fixture(autouse=True)
def takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """recordings/: two of them, and one that is damaged; films/: two folders of images; list.txt names all."""
    monkeypatch.chdir(tmp_path)
    for k in range(2):
        recording(Path(f"recordings/r{k}"), moving(3, seed=k))
        images(Path(f"films/f{k}"), moving(3, seed=k))
    Path("recordings/r2/images_corrected").mkdir(parents=True)
    Path("recordings/r2/events_aligned").mkdir()
    Path("list.txt").write_text("# all\nrecordings\nfilms\n")


def run(*arguments: str) -> Result:
    return CliRunner().invoke(interpolate, [*arguments, "-x", "2", "--method", "linear", "--format", "png"])


def test_folders_and_lists_stand_for_what_is_in_them() -> None:
    recordings, films = [f"recordings/r{k}" for k in range(3)], [f"films/f{k}" for k in range(2)]
    for argument, found in (
        ("recordings", recordings), ("films", films), ("list.txt", recordings + films),
        ("recordings/r0", ["recordings/r0"]), ("films/f1", ["films/f1"]),
    ):  # fmt: skip
        assert sources_in(argument, Path()) == found
    Path("ring").symlink_to("ring")  # (into which nothing can be put, which is told when it is tried)
    assert sources_in("films", Path("ring")) == films


@pytest.mark.parametrize("kind", ["png", "mp4"])
def test_what_was_made_into_the_folder_of_the_films_is_none_of_them(kind: str) -> None:
    here = ["-x", "2", "--method", "linear", "--format", kind, "-o", "films"]
    for options in ((), ("--resume",), ("--overwrite",)):
        assert CliRunner().invoke(interpolate, ["films", *here, "-q", *options]).exit_code == 0
    suffix = ".mp4" if kind == "mp4" else ""
    made = [f"films/f{k}_x2{suffix}" for k in range(2)]
    held = {str(path) for path in Path("films").iterdir() if path.suffix != ".json"}
    assert held == {*made, "films/f0", "films/f1"}
    assert sorted(sources_in("films", Path("other"))) == sorted(held)
    assert sources_in(made[0], Path("films")) == [made[0]]


def test_many_are_made_in_turn_or_shared_out_to_the_same_bytes() -> None:
    result = run("list.txt", "-o", "one", "-q")
    assert result.exit_code == 1 and "recordings/r2" in result.output
    names = [f"{name}_x2" for name in ("r0", "r1", "f0", "f1")]
    assert sorted(path.name for path in Path("one").iterdir()) == sorted(names)
    result = run("list.txt", "-o", "two", "--jobs", "2", "--retries", "0", "--json")
    found = json.loads(result.stdout)
    assert result.exit_code == 1 and [each["state"] for each in found].count("done") == 4
    assert {each["frames"] for each in found if each["state"] == "done"} == {5}
    for path in Path("one").rglob("*.png"):
        assert path.read_bytes() == (Path("two") / path.relative_to("one")).read_bytes(), path
    assert run("films", "-o", "two").exit_code == 2
    result = run("films", "-o", "two", "--resume")
    assert result.exit_code == 0 and "2 of 2 done" in result.output and "5 frames" in result.output


@pytest.mark.parametrize("name", ["v1.2_x8", "clip_x2.5", "clip_x2"])
def test_of_sources_of_one_name_the_second_has_a_number_behind_it(name: str) -> None:
    for suffix in ("", ".mp4"):
        found = places(["a", "b", "a", "c"], Path("out"), lambda _, made=f"{name}{suffix}": Path(made))  # type: ignore[misc]
        assert found == {
            source: Path("out") / f"{name}{number}{suffix}" for source, number in (("a", ""), ("b", "_2"), ("c", "_3"))
        }


def test_where_none_can_be_made_nothing_appears() -> None:
    for workers in ((), ("--jobs", "2", "--retries", "0")):
        result = run("recordings/r0", "recordings/r1", "--crop", "8x8", "-o", "out/deep", "-q", *workers)
        assert result.exit_code == 2 and "leave --crop out" in result.output
        assert not Path("out").exists()


def test_a_film_is_of_one_source() -> None:
    for sources in (["films"], ["films/f0", "films/f1"]):
        for name in ("film.mp4", "FILM.MP4"):
            result = run(*sources, "-o", name)
            assert isinstance(result.exception, UsageError) and "expected the name of a folder" in str(result.exception)
            assert not Path(name).exists()


def test_a_file_of_events_is_of_one_source() -> None:
    Path("events.csv").write_text("t,x,y,p\n1000,3,5,1\n")
    for sources in (["films"], ["films/f0", "films/f1"], ["films/f0", "films/f1", "--jobs", "2"]):
        result = run(*sources, "--events", "events.csv", "-o", "made")
        assert isinstance(result.exception, UsageError)
        assert "--events events.csv: of one source, and here are 2" in str(result.exception)
        assert not Path("made").exists()


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_one_frame_is_not_frames(jobs: str) -> None:
    images(Path("films/one"), moving(1))
    result = run("films/f0", "films/one", "-o", "made", "--jobs", jobs)
    assert result.exit_code == 0 and "films/one  1 frame\n" in result.output
    assert not re.search(r"\b1 frames\b(?!/s)", result.output)
