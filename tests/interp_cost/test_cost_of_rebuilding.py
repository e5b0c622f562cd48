"""`vid2ev cost --rebuild`, and networks run with fewer bits or compiled."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from matplotlib.image import imread

from interp.cost import measure
from interp.cost.measure import Rebuilding, Row, Size, rebuilding
from interp.cost.shown import plot, table
from interp.cost.ways import Anew, Tiled, Way, ways
from interp.evaluate.run import evaluate
from interp.evaluate.simulated import Simulated
from interp.methods import METHODS, Gap, open_method
from interp.methods.gap import Together
from interp.methods.running import Running, compiles
from interp.pretrained import HERE
from interp.representation.event_counts import EventCounts
from vid2ev import convert
from vid2ev.commands import main
from vid2ev.errors import DataError, UsageError

SCENE = "scene:room,size=64x48,scene.duration_s=0.1"
WEIGHTS = HERE / "rrin_events_guided-tiny.safetensors"
QUICK = {*METHODS, "rrin_events_guided-tiny", "rrin_events_guided-tiny, bfloat16", "rrin_events_guided-tiny, tiles"}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without what takes long."""
    monkeypatch.setattr("interp.cost.ways.compiles", lambda device: False)
    monkeypatch.setattr(measure, "ways", lambda *asked: [way for way in ways(*asked) if way.name in QUICK])


def gap(width: int = 64, height: int = 48) -> Gap:
    draw = np.random.default_rng(5)
    frame_0, frame_1 = (torch.from_numpy(draw.random((3, height, width), np.float32)) for _ in range(2))
    off_on = torch.from_numpy(draw.poisson(0.1, (1, 2, 32, height, width)).astype(np.uint8))
    return Gap(frame_0, frame_1, EventCounts(off_on, torch.full((1, 2), 0.15)))


def test_the_scores_are_those_of_an_evaluation(quick: None, tmp_path: Path) -> None:
    found = rebuilding(SCENE, gaps=2, sizes=[], repeats=1)
    rows = evaluate([SCENE], tmp_path, baselines=["linear", "ramps"], networks=[WEIGHTS], limit=2).rows
    for name in ("linear", "ramps", "rrin_events_guided-tiny"):
        row = next(row for row in found.rows if row.way.name == name)
        mine = [each for each in rows if each.method == name]
        assert row.psnr == pytest.approx(np.mean([each.psnr for each in mine]), abs=1e-9)
        assert row.ssim == pytest.approx(np.mean([each.ssim for each in mine]), abs=1e-9)
    assert {row.way.name for row in found.rows} == QUICK and found.gaps == 2
    for many, said in ((1, r": 1 gap, .*, 1 thread\n"), (2, r": 2 gaps, .*, 2 threads\n")):
        assert re.search(said, table(replace(found, gaps=many, threads=many)))


def test_which_of_several_sequences_was_taken_is_said(quick: None, tmp_path: Path) -> None:
    for name in ("b", "a"):
        np.savez(tmp_path / f"{name}.npz", frames=np.random.default_rng(0).random((9, 24, 32, 3), np.float32), fps=240)
    found = rebuilding(str(tmp_path), gaps=1, sizes=[], repeats=1)
    assert (found.describe()["sequence"], found.describe()["first_of"]) == ("a", 2)
    assert f"{tmp_path}, a, the first of 2: 1 gap, " in table(found)
    found = rebuilding(str(tmp_path / "b.npz"), gaps=1, sizes=[], repeats=1)
    assert found.describe()["first_of"] == 1 and f"{tmp_path / 'b.npz'}: 1 gap, " in table(found)


def test_times_are_those_of_the_clock_per_frame(quick: None) -> None:
    ticks, asked = count(), list[tuple[int, int, str]]()
    found = rebuilding(
        SCENE, multiple=4, gaps=1, sizes=[(32, 24), (64, 48)], repeats=2, threads=1,
        clock=lambda: 0.6 * next(ticks), report=lambda *told: asked.append(told),
    )  # fmt: skip
    assert found.sizes == ((64, 48), (32, 24)) and found.threads == 1
    for row in found.rows:
        assert list(row.ms) == [(64, 48), (32, 24)]
        for times in row.ms.values():
            assert times == pytest.approx([200.0, 200.0])  # (three frames in 0.6 s)
    assert [done for done, _, _ in asked] == list(range(asked[0][1]))


@pytest.mark.filterwarnings("error")
def test_names_of_sources_and_networks_are_drawn_as_they_are(tmp_path: Path) -> None:
    name = "$\\frac$ and $x^2$ 街"
    rows = [Row(Way(name, "networks", METHODS["linear"], f"--network {k}"), 30.0, 0.9, {(64, 48): [9.0]}) for k in "ab"]
    plot(Rebuilding(name, name, 1, 1, 8, ((64, 48),), "cpu", 1, tuple(rows)), tmp_path / "cost.png")
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")


class Watched(Together):
    """Gives the first frame, and notes what it is given: sizes of frames and events, and the footprint of these."""

    name, needs_events, sequential = "watched", True, False

    def __init__(self) -> None:
        self.seen = dict[Size, set[tuple[Size, int]]]()

    def begin(self) -> Watched:
        return self

    def images(self, gap: Gap, times: torch.Tensor, tiling: object = None) -> Iterator[torch.Tensor]:
        frames, events = (tuple(each.shape[:-3:-1]) for each in (gap.frame_0, gap.events.off_on))
        self.seen.setdefault(frames, set()).add((events, gap.events.footprint))
        yield gap.frame_0.expand(len(times), -1, -1, -1)


@pytest.mark.parametrize(
    ("place", "events", "finer", "footprints"),
    [("", (16, 12), (32, 24), (1, 1)), ("rotation_deg = [0, 0, 1]", (64, 48), (128, 96), (4, 8))],
)
def test_what_is_timed_is_what_is_scored_also_of_a_coarse_event_camera(
    place: str, events: Size, finer: Size, footprints: Size, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And at another size the event camera is as coarse as it was, beside the frames, or laid over them."""
    (tmp_path / "rig.toml").write_text(
        f'[[camera]]\nname = "dvs"\nkind = "dvs"\nsensor = "ideal"\nsize = [16, 12]\n{place}\n'
        '[[camera]]\nname = "cis"\nkind = "cis"\nsensor = "ideal"\nset = { frame_rate_hz = 240 }\n'
    )
    convert(SCENE, tmp_path / "made", rig=tmp_path / "rig.toml", fps=240, pictures="png", preview=False, threads=1)
    method = Watched()
    monkeypatch.setattr(
        measure, "ways", lambda *_: [Way("watched", "closed forms", lambda: method, "--method watched")]
    )
    rebuilding(str(tmp_path / "made"), gaps=1, sizes=[(128, 96)], repeats=1)
    own, doubled = footprints
    assert method.seen == {(64, 48): {(events, own)}, (128, 96): {(finer, doubled)}}


def test_what_takes_long_is_timed_once(quick: None) -> None:
    ticks = count()
    found = rebuilding(SCENE, gaps=1, sizes=[], repeats=3, clock=lambda: 11.0 * next(ticks))
    assert all(len(times) == 1 for row in found.rows for times in row.ms.values())


def test_the_front_and_what_is_recommended(quick: None) -> None:
    found = rebuilding(SCENE, gaps=1, sizes=[], repeats=1)
    front, own = found.front, found.sizes[0]
    for row in found.rows:
        assert row.psnr is not None
        ahead = [other for other in front if other.time(own) <= row.time(own) and (other.psnr or 0) >= row.psnr]
        assert ahead, row.way.name
    best = max(row.psnr or 0 for row in found.rows if row.way.asked)
    assert (found.recommended.psnr or 0) >= best - measure.AS_GOOD_DB


def test_the_command_makes_table_file_and_picture(quick: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(rebuilding.__kwdefaults__, "sizes", [(96, 64)])
    done = CliRunner().invoke(main, ["cost", SCENE, "--rebuild", "8", "--gaps", "1", "--repeats", "1"])
    assert done.exit_code == 0, done.output
    told = json.loads(Path("room_rebuild_cost.json").read_text())
    assert {way["name"] for way in told["ways"]} == QUICK and told["multiple"] == 8
    assert set(told["ways"][0]["ms_per_frame"]) == {"64x48", "96x64"}
    assert all(name in done.output for name in QUICK) and told["recommended"] in done.output.splitlines()[-3]
    assert imread("room_rebuild_cost.png").shape[:2] == (600, 950)


def film(path: Path, pictures: np.ndarray) -> str:
    np.save(path, pictures)
    return str(path)


def test_a_film_in_which_nothing_is_seen_is_refused(tmp_path: Path) -> None:
    grey = film(tmp_path / "grey.npy", np.full((9, 32, 32), 99, np.uint8))
    with pytest.raises(DataError, match="of one value all over"):
        rebuilding(grey, simulated=Simulated.of("clean", fps=240, transfer="srgb"))


def test_frames_smaller_than_the_window_of_ssim_have_none(quick: None, tmp_path: Path) -> None:
    ramp = np.arange(9 * 8 * 8, dtype=np.uint8).reshape(9, 8, 8)
    small = film(tmp_path / "small.npy", ramp)
    found = rebuilding(small, simulated=Simulated.of("clean", fps=240, transfer="srgb"), sizes=[], repeats=1)
    assert {row.ssim for row in found.rows} == {None} and "-" in table(found)
    json.dumps(found.describe(), allow_nan=False)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--network", "x"], "--network is for --rebuild"),
        (["--gaps", "2"], "--gaps is for --rebuild"),
        (["--rebuild", "8", "--upsample", "none"], "--upsample is of conversions"),
        (["--rebuild", "8", "--budget", "vR=1"], "--budget is of conversions"),
        (["--rebuild", "8", "--duration", "0.1"], "error: --duration is of conversions"),
        (["--rebuild", "8", "--network", "nobody"], "no such file"),
        (["--rebuild", "1000"], "no two key frames 1,000 frames apart"),
    ],
)
def test_what_cannot_be_meant_is_one_sentence(options: list[str], said: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["cost", SCENE, "-o", str(tmp_path / "made"), *options])
    assert done.exit_code == 2 and said in done.output and "Traceback" not in done.output
    assert not list(tmp_path.iterdir())


def test_every_way_is_there_and_says_how_to_ask_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("interp.cost.ways.compiles", lambda device: True)
    names = {way.name: way for way in ways([], "cpu")}
    assert {*METHODS} <= {*names} and {*names} >= QUICK
    assert names["rrin_events_guided-tiny, compiled"].asked == "--network rrin_events_guided-tiny --compile"
    larger = [way for way in names.values() if way.group == "larger"]
    assert [way.scored for way in larger] == [False, False]
    sizes = [sum(map(torch.Tensor.numel, way.open().network.parameters())) for way in larger]  # type: ignore[attr-defined]
    plain = sum(map(torch.Tensor.numel, names["rrin_events_guided-tiny"].open().network.parameters()))  # type: ignore[attr-defined]
    assert 3.5 * plain < sizes[0] < 4.5 * plain and 3.5 * sizes[0] < sizes[1] < 4.5 * sizes[0]


def test_networks_of_runs_are_called_like_these(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("interp.cost.ways.compiles", lambda device: True)
    runs = [tmp_path / folder for folder in ("first", "second", "other/second", "linear")]
    for run in runs:
        run.mkdir(parents=True)
        (run / "weights.safetensors").symlink_to(WEIGHTS)
    found = ways(runs, "cpu")
    assert [way.name for way in found if way.group == "networks"] == ["first", "second", "second_2", "linear_2"]
    assert {"first, compiled", "first, tiles"} < {way.name for way in found}
    assert len({way.name for way in found}) == len(found)
    assert open_method(str(runs[0] / "weights.safetensors")).name == "first"


def test_what_is_done_once_per_gap_may_be_done_for_each_frame() -> None:
    method, times = open_method(str(WEIGHTS)), torch.tensor([0.25, 0.5, 0.75])
    torch.testing.assert_close(Anew(method).between(gap(), times), method.between(gap(), times), atol=1e-5, rtol=0)


def test_tiles_are_those_that_interpolation_makes() -> None:
    method, times, wide = open_method("linear"), torch.tensor([0.3]), gap(200, 150)
    made = Tiled(method, "64x64").between(wide, times)
    torch.testing.assert_close(made, method.between(wide, times), atol=1e-6, rtol=0)


def test_fewer_bits_are_off_by_little_and_not_by_nothing() -> None:
    times = torch.tensor([0.2, 0.7])
    exact = open_method(str(WEIGHTS)).between(gap(), times)
    coarse = open_method(str(WEIGHTS), running=Running("bfloat16")).between(gap(), times)
    assert coarse.dtype == torch.float32
    assert 0 < float((coarse - exact).abs().mean()) < 1 / 255


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning:torch")  # (of its own parts, as its compiler is imported)
def test_compiled_it_makes_the_same() -> None:
    from torch._dynamo.utils import counters

    counters.clear()
    times = torch.tensor([0.2, 0.7])
    exact = open_method(str(WEIGHTS)).between(gap(), times)
    made = open_method(str(WEIGHTS), running=Running(compiled=True)).between(gap(), times)
    assert counters["stats"]["unique_graphs"] > 0 and compiles("cpu")
    torch.testing.assert_close(made, exact, atol=1e-4, rtol=0)


def test_only_networks_are_run_otherwise() -> None:
    with pytest.raises(UsageError, match="'flow' is no network"):
        open_method("flow", running=Running("bfloat16"))
    with pytest.raises(UsageError, match="precision 'half'"):
        Running("half")
