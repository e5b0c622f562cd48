"""Plans made while a recording is: those of a look at the whole clip where it is short, sound and repeatable anyway."""

from __future__ import annotations

import io
import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from against.clips import clean

from vid2ev import convert, read_events
from vid2ev.plan import planner as planning
from vid2ev.plan.planner import Planner
from vid2ev.plan.recordings import plans_of
from vid2ev.seen.instants import instants
from vid2ev.seen.recipe import Recipe
from vid2ev.sources.arrays import ArrayStack
from vid2ev.stream import Events

from .clips import distance

pytestmark = pytest.mark.long

SIZE = (40, 30)
SPEC = clean(photoreceptor_tau_us=300, follower_tau_us=100, random_phase=True)
QUIET: dict[str, Any] = {"upsample": "none", "preview": False, "fps": 200, "cuts": "keep"}
SOME = 10 * SIZE[0] * SIZE[1] * 4  # bytes of ten frames


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Has so many bytes of light held."""

    def hold(count: int) -> None:
        monkeypatch.setattr(planning, "HELD", count)

    return hold


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """Light that rises without a bend for a while, and then trembles."""
    draws = np.random.default_rng(3)
    ramp = 0.2 + 0.01 * np.arange(30)[:, None, None] * np.ones((1, *SIZE[::-1]))
    wild = ramp[-1] * np.exp(draws.normal(0, 0.3, (70, *SIZE[::-1])))
    path = tmp_path / "clip.npy"
    np.save(path, np.concatenate([ramp, wild]).astype(np.float32))
    return path


def made(clip: Path, folder: Path, **options: Any) -> dict[str, Any]:
    return convert(clip, folder, **{"sensor": SPEC, "effects": "auto", **QUIET, **options})


def gone(manifest: dict[str, Any]) -> list[str]:
    return [row["effect"] for row in manifest["plan"][""]["rows"] if row["fate"] != "kept"]


def recipe(clip: Path) -> Recipe:
    return Recipe.of(clip, SPEC, fps=200, upsample="none", cuts="keep")


def events_of(folder: Path) -> Events:
    return Events.concatenate(list(read_events(folder)))


def same_events(one: Path, other: Path) -> bool:
    return (one / "events.h5").read_bytes() == (other / "events.h5").read_bytes()


def test_a_clip_that_is_held_is_planned_as_a_whole(clip: Path, tmp_path: Path) -> None:
    for tolerance in (0.001, 0.02, 0.3):
        manifest = made(clip, tmp_path / f"{tolerance}", tolerance=tolerance)
        plan = plans_of(recipe(clip), "auto", tolerance)[""]
        assert manifest["plan"][""] == json.loads(json.dumps(plan.describe()))
        assert manifest["sensor"]["parameters"] == plan.spec.model_dump(mode="json")
        assert manifest["asked"]["sensor"]["parameters"] == SPEC.model_dump(mode="json")


def test_what_turns_out_to_matter_comes_back_from_the_beginning(
    clip: Path, tmp_path: Path, held: Callable[[int], None]
) -> None:
    """The second pole is left out for the ramp; the recording of all of it has it from its first event on."""
    held(SOME)
    first = Planner(recipe(clip), 0.01)
    first.begin()
    assert first.plans[""].gone == ("follower",)
    reports: list[int] = []
    manifest = made(clip, tmp_path / "auto", tolerance=0.01, report=lambda _, done: reports.append(done.frames))
    made(clip, tmp_path / "all", effects="all")
    assert gone(manifest) == [] and reports.count(10) == 2 and reports[-1] == 100
    assert same_events(tmp_path / "auto", tmp_path / "all")


@pytest.mark.parametrize("tolerance", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("count", [1, SOME, 7 * SOME])
def test_bounds_hold_for_the_whole_clip_however_much_is_held(
    clip: Path, tmp_path: Path, tolerance: float, count: int, held: Callable[[int], None]
) -> None:
    held(count)
    manifest = made(clip, tmp_path / "auto", tolerance=tolerance)
    made(clip, tmp_path / "all", effects="all")
    plan = manifest["plan"][""]
    whole = {row.effect: row.omission.distance for row in plans_of(recipe(clip))[""].rows}
    assert plan["distance"] <= tolerance
    for row in plan["rows"]:
        assert row["fate"] == "kept" or row["distance"] == whole[row["effect"]]
    sides = [events_of(tmp_path / name) for name in ("auto", "all")]
    assert distance(*sides, SIZE) <= plan["distance"]


def test_light_is_made_once_where_the_first_plans_hold(
    clip: Path, tmp_path: Path, held: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    held(SOME)
    times = []

    def counted(*arguments: Any, **rest: Any) -> Any:
        times.append(arguments)
        return instants(*arguments, **rest)

    monkeypatch.setattr(planning, "instants", counted)
    assert gone(made(clip, tmp_path / "wide", tolerance=1.0)) == ["photoreceptor", "follower"] and len(times) == 1
    assert gone(made(clip, tmp_path / "none", tolerance=0.0)) == [] and len(times) == 2


def test_of_a_camera_of_which_all_is_kept_no_more_is_measured(clip: Path, held: Callable[[int], None]) -> None:
    held(SOME)
    planner = Planner(recipe(clip), 0.0)
    planner.begin()
    seen = [planner.see(instant, index) for index, instant in enumerate(planner.instants())]
    assert len(seen) == 100 and not any(seen) and not planner.finish() and planner.looked == 10


def test_what_is_kept_for_what_is_to_come_says_so(clip: Path, tmp_path: Path, held: Callable[[int], None]) -> None:
    """Of the ramp both poles are within the tolerance, and one of them within the half that is not spared."""
    np.save(clip, np.load(clip)[:25])
    held(SOME)
    manifest = made(clip, tmp_path / "auto", tolerance=0.012)
    whys = {row["effect"]: row["why"] for row in manifest["plan"][""]["rows"]}
    assert gone(manifest) == ["follower"] and plans_of(recipe(clip), "auto", 0.012)[""].gone == (
        "photoreceptor",
        "follower",
    )
    assert planning.SPARED in whys["photoreceptor"] and planning.SPARED not in whys["follower"]


def test_the_time_it_took_is_that_of_all_plans(
    clip: Path, tmp_path: Path, held: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock that goes on a second whenever it is asked."""
    held(SOME)
    clock = itertools.count()
    monkeypatch.setattr("vid2ev.making.conversion.time", SimpleNamespace(monotonic=lambda: float(next(clock))))
    manifest = made(clip, tmp_path / "auto", tolerance=0.01)
    assert gone(manifest) == [] and manifest["run"]["seconds"] > 100 + 10


def test_light_that_trembles_more_and_more_makes_it_begin_again_once(
    clip: Path, tmp_path: Path, held: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is left out at first is within half of the tolerance, and the second time within a quarter."""
    draws, growing = np.random.default_rng(5), np.maximum(0, np.linspace(-0.01, 0.1, 160))[:, None, None]
    ramp = 0.2 + 0.01 * np.arange(160)[:, None, None]
    np.save(clip, (ramp * np.exp(draws.normal(0, 1, (160, *SIZE[::-1])) * growing)).astype(np.float32))
    held(SOME)
    reports: list[int] = []
    asked, plans = list[float](), planning.Look.plans

    def noted(look: Any, effects: str, tolerance: float, among: Any = None) -> Any:
        asked.append(tolerance)
        return plans(look, effects, tolerance, among)

    monkeypatch.setattr(planning.Look, "plans", noted)
    manifest = made(clip, tmp_path / "auto", tolerance=0.02, report=lambda _, done: reports.append(done.frames))
    assert reports.count(10) == 2 and manifest["plan"][""]["distance"] <= 0.02
    assert sorted({*asked}) == [0.005, 0.01, 0.02] and asked.index(0.01) < asked.index(0.005)
    assert manifest["plan"][""]["tolerance"] == 0.02  # (what was asked for, whatever was spared)


def test_a_recording_ended_by_hand_ends_there_by_other_plans_too(
    clip: Path, tmp_path: Path, held: Callable[[int], None]
) -> None:
    held(SOME)
    asked = iter([False] * 37 + [True] + [False] * 500)
    manifest = made(clip, tmp_path / "auto", tolerance=0.01, report=lambda *_: next(asked))
    assert manifest["counts"]["frames"] == 39 and gone(manifest) == []


def test_a_rig_is_planned_camera_by_camera(clip: Path, tmp_path: Path, held: Callable[[int], None]) -> None:
    held(SOME)
    rig = tmp_path / "rig.toml"
    rig.write_text('[[camera]]\nname = "one"\nkind = "dvs"\n[[camera]]\nname = "two"\nkind = "cis"\n')
    manifest = made(clip, tmp_path / "auto", rig=rig, cis="phone", sensor="paper", tolerance=0.02)
    alone = made(clip, tmp_path / "all", rig=rig, cis="phone", sensor="paper", effects="all")
    assert set(manifest["plan"]) == {"one", "two"}
    assert manifest["asked"]["cameras"].keys() == manifest["cameras"].keys() == alone["cameras"].keys()
    again = made(clip, tmp_path / "auto", rig=rig, cis="phone", sensor="paper", tolerance=0.02, resume=True)
    assert again == manifest


def test_a_finished_recording_is_known_again(clip: Path, tmp_path: Path) -> None:
    manifest = made(clip, tmp_path / "auto", tolerance=0.3)
    assert gone(manifest) and made(clip, tmp_path / "auto", tolerance=0.3, resume=True) == manifest
    with pytest.raises(Exception, match=r"asked.tolerance"):
        made(clip, tmp_path / "auto", tolerance=0.2, resume=True)


class Pipe(io.RawIOBase):
    """A pipe whose reads come in pieces of some size."""

    def __init__(self, data: bytes, piece: int):
        self.buffer, self._data, self._piece = self, io.BytesIO(data), piece

    def isatty(self) -> bool:
        return False

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        return self._data.read(self._piece if size < 0 else min(size, self._piece))


@pytest.fixture
def film(clip: Path, tmp_path: Path) -> Path:
    """The clip as Y4M."""
    pictures = (np.minimum(np.load(clip), 1.0) * 255).astype(np.uint8)
    head = f"YUV4MPEG2 W{SIZE[0]} H{SIZE[1]} F200:1 Ip A1:1 Cmono\n".encode()
    path = tmp_path / "clip.y4m"
    path.write_bytes(head + b"".join(b"FRAME\n" + picture.tobytes() for picture in pictures))
    return path


FILM: dict[str, Any] = {"fps": None, "transfer": "linear"}


@pytest.mark.parametrize("count", [1, SOME, planning.HELD])
@pytest.mark.parametrize("tolerance", [0.02, 0.1, 0.5])
def test_a_pipe_is_planned_as_a_file_is(
    film: Path, tmp_path: Path, held: Callable[[int], None], count: int, tolerance: float, monkeypatch: Any
) -> None:
    """Whatever the pieces that it comes in, and where it begins again, too."""
    held(count)
    of_file = made(film, tmp_path / "file", tolerance=tolerance, **FILM)
    for piece in (1 << 20, 997):
        monkeypatch.setattr(sys, "stdin", Pipe(film.read_bytes(), piece))
        of_pipe = made(Path("-"), tmp_path / f"{piece}", tolerance=tolerance, **FILM)
        assert of_pipe["plan"] == of_file["plan"] and same_events(tmp_path / "file", tmp_path / f"{piece}")


@pytest.mark.parametrize("kept", [0, 50 * (SIZE[0] * SIZE[1] + 6), 1 << 32])
def test_of_a_pipe_longer_than_what_is_kept_all_effects_are(
    film: Path, tmp_path: Path, held: Callable[[int], None], kept: int, monkeypatch: Any
) -> None:
    """The light is so that the plan would never change."""
    held(SOME)
    monkeypatch.setattr(planning, "KEPT", kept)
    monkeypatch.setattr(sys, "stdin", Pipe(film.read_bytes(), 997))
    manifest = made(Path("-"), tmp_path / "pipe", tolerance=1.0, **FILM)
    made(film, tmp_path / "all", effects="all", **FILM)
    assert same_events(tmp_path / "pipe", tmp_path / "all") == (kept < 1 << 32) == (gone(manifest) == [])
    assert (planning.LONG in manifest["plan"][""]["rows"][0]["why"]) == (kept < 1 << 32)


@pytest.mark.parametrize(
    ("count", "tolerance", "wanted"), [(SOME, 1.0, True), (SOME, 0.0, False), (1 << 26, 0.5, False)]
)
def test_a_pipe_is_kept_while_the_recording_may_begin_again(
    film: Path, held: Callable[[int], None], count: int, tolerance: float, wanted: bool, monkeypatch: Any
) -> None:
    held(count)
    monkeypatch.setattr(sys, "stdin", Pipe(film.read_bytes(), 997))
    planner = Planner(Recipe.of("-", SPEC, upsample="none", cuts="keep", transfer="linear"), tolerance)
    planner.begin()
    coming = planner.instants()
    next(coming)
    kept = planner.recipe.source.kept
    assert kept and kept.wanted == wanted
    coming.close()


def test_an_array_that_passes_once_is_read_once(
    clip: Path, tmp_path: Path, held: Callable[[int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = []

    class Once(ArrayStack):
        rewindable = False

        def frames(self, start: int = 0) -> Any:
            assert not opened, "read again"
            opened.append(start)
            return super().frames(start)

    made(clip, tmp_path / "all", effects="all")
    monkeypatch.setattr("vid2ev.sources.arrays.ArrayStack", Once)
    for count in (planning.HELD, SOME):
        held(count)
        opened.clear()
        manifest = made(clip, tmp_path / f"{count}", tolerance=0.3)
        sides = [events_of(tmp_path / name) for name in (f"{count}", "all")]
        assert distance(*sides, SIZE) <= manifest["plan"][""]["distance"] <= 0.3
        assert bool(gone(manifest)) == (count != SOME)
