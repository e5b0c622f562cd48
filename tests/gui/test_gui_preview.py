"""Previews are what a conversion makes of the same light; long work ends when it is told to."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from queue import SimpleQueue
from types import SimpleNamespace
from typing import Any
from weakref import ref

import cv2
import numpy as np
import pytest

from vid2ev.compare.statistics import statistics_of
from vid2ev.errors import UsageError
from vid2ev.gui.charts import cost_chart, course_chart, interval_chart, statistics_rows
from vid2ev.gui.jobs import Done, Job, Progress, Tell
from vid2ev.gui.light import Light, LightTable, _part_of_video, duration_s, smaller
from vid2ev.gui.preview import VIEWS, Answer, Previewer, Request, plans_of
from vid2ev.gui.scene_edit import moved
from vid2ev.gui.scene_light import coarse_first, grid_hz, ticks_of
from vid2ev.gui.session import Session
from vid2ev.gui.setup import Setup, setup_of
from vid2ev.gui.stand_in import LEAK, SLIGHT, Kernels, stand_ins, usual
from vid2ev.gui.warming import _warm
from vid2ev.gui.worker import Planner, Refused, Worker, _serve
from vid2ev.rig.camera import default_rig
from vid2ev.seen.instants import Instant, events_of
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.compiled import flags_of
from vid2ev.sensors.course import Course
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.presets import DVS, load
from vid2ev.stream.events import Events

SMALL = "scene:spinning-shapes,size=64x48"


@pytest.mark.parametrize("side", [64, 32])
@pytest.mark.parametrize("size", [(64, 48), (128, 96)])
def test_a_part_of_a_video_is_previewed_through_its_own_lens(size: tuple[int, int], side: int) -> None:
    clip, edits = "synthetic:moving-edge,size=64x48,fps=100,duration_s=0.1", {"crop": "32x24+10+8", "size": size}
    setup = Setup(clip, default_rig(), options=edits | {"size": f"{size[0]}x{size[1]}"})
    lens = Recipe.of(clip, **edits).rig.source.scaled_to(smaller(size, side))
    recipe, _, _ = _part_of_video(setup, 0.0, 0.02, side)
    assert recipe.rig.source.focal_px == pytest.approx(lens.focal_px)
    assert recipe.rig.source.centre_px == pytest.approx(lens.centre_px)


@pytest.fixture(scope="module")
def previewer() -> Previewer:
    return Previewer()


@pytest.fixture
def setup() -> Setup:
    return setup_of(SMALL).with_preset(0, "ideal")


@pytest.mark.parametrize("source", [SMALL, "missing.mp4"])
def test_a_preview_that_nobody_waits_for_ends_without_a_word(source: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when a page is closed while its picture is made."""
    monkeypatch.setattr("signal.signal", lambda *_: None)
    ours, theirs = Pipe()
    ours.send(Request(replace(setup_of(SMALL).with_preset(0, "ideal"), source=source), number=1))
    ours.close()
    with pytest.raises(SystemExit) as ended:
        _serve(theirs, SimpleNamespace(value=1))
    assert ended.value.code is None
    assert not isinstance(ended.value.__context__, OSError)  # (which would keep what was to be sent)


PARENT = """
import sys, time
from vid2ev.gui.warming import Warming
if __name__ == "__main__":
    warming = Warming()
    warming.enter()
    warming.begin()
    print(warming._process.pid, flush=True)
    time.sleep(600)
"""


def test_what_compiles_for_later_ends_with_the_program_even_if_that_is_killed(tmp_path: Path) -> None:
    """It holds the program's output: whoever reads that waits for it."""
    (tmp_path / "parent.py").write_text(PARENT)
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen([sys.executable, tmp_path / "parent.py"], stdout=subprocess.PIPE, env=environment) as parent:
        assert parent.stdout is not None
        warming = int(parent.stdout.readline())
        parent.kill()
        assert parent.stdout.read() == b""
    for _ in range(600):
        if not Path(f"/proc/{warming}").exists():
            return
        time.sleep(0.1)
    raise AssertionError("it is there after a minute")


def test_what_compiles_for_later_does_so_where_no_process_can_be_nice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("os.nice")
    monkeypatch.setattr("signal.signal", lambda *_: None)
    for name, instead in (("end_with_parent", lambda: None), ("usual", lambda: ["a spec"]), ("see_something", id)):
        monkeypatch.setattr(f"vid2ev.gui.warming.{name}", instead)
    monkeypatch.setattr("vid2ev.gui.warming.flags_of", lambda spec, _: spec)
    ours, theirs = multiprocessing.Pipe()
    _warm(theirs)
    assert ours.recv() == "a spec"


def test_light_is_made_again_only_where_something_changed_that_decides_it(setup: Setup) -> None:
    table = LightTable()
    light = table.light(setup, 0.5, 0.01)
    other = table.light(setup.with_sensor_values(0, {"threshold_on": 0.4}), 0.5, 0.01)
    assert other.instants is light.instants and other.recipe.mounts[0].sensor.spec.threshold_on == 0.4
    later = table.light(setup, 0.504, 0.01)
    assert later.instants is not light.instants
    assert later.instants[later.lead].frames[1].light is at(light, later.instants[later.lead].t_ns).frames[1].light
    turned = table.light(setup.with_camera_values(0, {"rotation_deg": (0.0, 5.0, 0.0)}), 0.504, 0.01).instants[0]
    assert not np.array_equal(turned.frames[0].light, later.instants[0].frames[0].light)
    assert turned.frames[1].light is later.instants[0].frames[1].light


def test_a_file_that_is_written_again_is_another_light(tmp_path: Path) -> None:
    film, table = tmp_path / "film.npz", LightTable()
    np.savez(film, frames=np.full((9, 20, 30), 0.2, np.float32), fps=30)
    setup = setup_of(str(film))
    first = table.light(setup, 0.0, 0.02)
    np.savez(film, frames=np.full((30, 20, 30), 0.7, np.float32), fps=30)
    again = table.light(setup, 0.0, 0.02)
    levels = [float(light.instants[0].frames[0].light.mean()) for light in (first, again)]
    assert levels == pytest.approx([0.2, 0.7]) and duration_s(setup) == pytest.approx(1.0, rel=0.05)


def grey(path: Path, code: int) -> None:
    assert cv2.imwrite(str(path), np.full((20, 30, 3), code, np.uint8))


def levels_of(setup: Setup, again: Callable[[], Any]) -> tuple[float, float]:
    """The mean light of a preview, before and after a change on disk."""
    table = LightTable()
    first = table.light(setup, 0.0, 0.02).instants[0].frames[0].light.mean()
    again()
    return float(first), float(table.light(setup, 0.0, 0.02).instants[0].frames[0].light.mean())


def test_a_folder_whose_images_are_written_again_is_another_light(tmp_path: Path) -> None:
    for k in range(3):
        grey(tmp_path / f"{k}.png", 60)
    setup = setup_of(str(tmp_path)).with_option("fps", 30.0)
    first, then = levels_of(setup, lambda: [grey(tmp_path / f"{k}.png", 200) for k in range(3)])
    assert then > 5 * first


def test_maps_of_depth_that_are_written_again_are_another_light(tmp_path: Path) -> None:
    clip, depth = "synthetic:moving-edge,size=64x48,fps=100,duration_s=0.1", tmp_path / "depth"
    depth.mkdir()
    np.save(depth / "0.npy", np.full((48, 64), 2.0, np.float32))
    setup = Setup(clip, default_rig(), options={"depth": f"{depth},scale=1"})
    setup = setup.with_camera_values(0, {"translation_mm": (30.0, 0.0, 0.0)})
    first, then = levels_of(setup, lambda: np.save(depth / "0.npy", np.full((48, 64), 0.1, np.float32)))
    assert first != then


def test_a_path_over_a_photograph_that_is_written_again_is_another_light(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "photo.png"), np.tile(np.uint8([30] * 300 + [220] * 300), (200, 1)))
    path = tmp_path / "path.csv"
    path.write_text("0,-150,0\n1,-149,0\n")
    setup = setup_of(str(tmp_path / "photo.png")).with_option("motion", str(path)).with_option("size", "64x48")
    first, then = levels_of(setup, lambda: path.write_text("0,150,0\n1.5,149,0\n"))
    assert then > 5 * first and duration_s(setup) == pytest.approx(1.5)


MESH = "mtllib m.mtl\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n"
MESH = f"{MESH}f 1/1 3/3 2/2\nf 1/1 4/4 3/3\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"


@pytest.mark.parametrize(("what", "written"), [("plane", "a.png"), ("mesh", "b.png"), ("mesh", "m.mtl")])
def test_what_a_scene_names_is_read_again_when_it_is_written_again(what: str, written: str, tmp_path: Path) -> None:
    for name in "abc":
        grey(tmp_path / f"{name}.png", 200 if name == "c" else 60)
    (tmp_path / "m.obj").write_text(MESH)
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd b.png\n")
    look = {"plane": 'texture = "a.png"\nsize_m = 18.0', "mesh": 'file = "m.obj"'}[what]
    text = f'[scene]\nduration_s = 0.1\nambient = 1.0\n[camera]\nsize = [16, 12]\n[[objects]]\nname = "it"\n{look}\n'
    place = '[[objects.trajectory]]\nkind = "fixed"\nposition_m = [0, 0, 3]\n'
    (tmp_path / "own.toml").write_text(f'{text}kind = "{what}"\n{place}')
    setup = setup_of(f"scene:{tmp_path / 'own.toml'}")

    def again() -> None:
        if written == "m.mtl":
            (tmp_path / written).write_text("newmtl m\nmap_Kd c.png\n#\n")
        else:
            grey(tmp_path / written, 200)

    first, then = levels_of(setup, again)
    assert then > 5 * first > 0


def at(light: Light, t_ns: int) -> Instant:
    return next(instant for instant in light.instants if instant.t_ns == t_ns)


def test_a_scene_in_which_a_thing_was_moved_is_another_light(setup: Setup) -> None:
    table = LightTable()
    for k in range(3):
        other = setup.with_scene(moved(setup.settled(), "objects.box-1", np.array([0.1 * k, 0.0, 0.0])))
        light = table.light(pickle.loads(pickle.dumps(other)), 0.5, 0.005)
        assert pickle.loads(pickle.dumps(other)) == other != setup
        assert table.light(pickle.loads(pickle.dumps(other)), 0.5, 0.005).instants is light.instants


def test_what_takes_long_is_rough_first_and_then_all_of_it(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vid2ev.gui.scene_light.ROUGH_S", 0.0)
    rough, fine = Previewer().answers(Request(setup, 0.5, 0.01))
    assert (rough.whole, fine.whole) == (False, True) and rough.span_s == fine.span_s
    assert [*Previewer().answers(Request(setup, 0.5, 0.01))][-1].cameras[0].picture == fine.cameras[0].picture
    assert ticks_of(0.5, 0.53, 100)[:4] == [50, 53, 52, 51] and ticks_of(0.5, 0.53, 100)[4:] == [48]
    assert [grid_hz(asked, 0.03) for asked in (1.0, 250.0, 1e5)] == [64, 256, 2048]
    for count in (1, 2, 3, 17):
        assert sorted(coarse_first(count)) == [*range(count)] and set(coarse_first(count)[:2]) == {0, count - 1}


def test_what_stands_in_needs_no_kernel_of_its_own() -> None:
    ready = frozenset(flags_of(spec, False) for spec in usual())
    for name in DVS.names():
        spec: Any = load(DVS, name)
        for changes in ({}, {"leak_rate_hz": 2.0}, {"hot_probability": 0.1, "hot_rate_hz": 9.0}, {"mismatch": 0.0},
                        {"shading": (0.1,), "refractory_us": 50.0}, {"threshold_on": 0.7}):  # fmt: skip
            other = spec.model_copy(update=changes)
            chosen = Kernels().choose(other, ready)
            assert flags_of(chosen, False) in ready
            assert {key for key, value in other if getattr(chosen, key) != value} <= {*SLIGHT, *LEAK}
            assert Kernels().choose(other, frozenset()) == other
            assert chosen.refractory_ns() == other.refractory_ns()  # (for many events come in one nanosecond)


@pytest.mark.slow
@pytest.mark.parametrize("changed", [(), ("timing=frame",)])
@pytest.mark.parametrize("name", ["ideal", "paper", "davis346"])
def test_a_sensor_that_stands_in_for_another_sends_what_that_sends(name: str, changed: tuple[str, ...]) -> None:
    steps = np.random.default_rng(0).normal(size=(12, 48, 64)).cumsum(axis=0)
    spec: Any = load(DVS, name, changed)
    counts = [
        len(Events.concatenate([dvs.step(np.exp(0.2 * step).astype(np.float32), k * 10**7) for k, step in
                                enumerate(steps)]))
        for dvs in (Dvs(one, (64, 48)) for one in (spec, *stand_ins(spec)))
    ]  # fmt: skip
    assert min(counts) > 1000 and max(counts) - min(counts) <= 2


def test_a_preview_shows_the_events_that_the_sensor_sends(previewer: Previewer, setup: Setup) -> None:
    answer = previewer.answer(Request(setup, 0.5, 0.01, pixel=(0, 30, 20)))
    light = previewer.light(Request(setup, 0.5, 0.01))
    mount = light.recipe.mounts[0]
    sent = [*mount.dvs().run(instant.frames[0] for instant in light.instants)]
    events = Events.concatenate(sent[light.lead + 1 :])
    assert light.instants[light.lead].t_ns <= 5e8 < light.instants[light.lead + 1].t_ns
    assert light.instants[0].t_ns < 4.9e8
    shown = answer.cameras[0]
    assert shown.statistics is not None and shown.statistics.events == len(events) > 100
    assert shown.size == (64, 48) and answer.duration_s == 2.0 and answer.notes == ()
    assert answer.course is not None
    assert answer.course.events.t.tolist() == events.t[(events.x == 30) & (events.y == 20)].tolist()
    assert answer.course.t_ns[0] == light.instants[light.lead].t_ns
    assert np.all(answer.course.level_on - answer.course.level_off == pytest.approx(0.3))
    assert len(course_chart(answer.course)["series"]) == 7
    assert statistics_rows({"dvs": shown.statistics})[3] == ["events", f"{len(events):,}"]
    assert interval_chart({"dvs": shown.statistics})["series"][0]["name"] == "dvs"


def test_the_levels_of_a_course_step_at_its_events() -> None:
    t_ns, zero = np.array([0, 10**6, 2 * 10**6, 3 * 10**6]), np.zeros(4)
    sent = Events(np.array([1200, 1700]), *np.zeros((2, 2), np.uint16), np.ones(2, np.uint8))
    level_on = np.array([0.1, 0.1, 0.3, 0.3])
    drawn = course_chart(Course(t_ns, zero, zero, zero, level_on, level_on - 0.2, sent))["series"]
    (on,) = (series["data"] for series in drawn if series["name"] == "ON level")
    assert on == [[0.0, 0.1], [1.0, 0.1], [1.7, 0.3], [2.0, 0.3], [3.0, 0.3]]


def test_half_of_the_intervals_are_below_what_is_said_with_two_digits() -> None:
    def said(t_us: np.ndarray) -> str:
        none = np.zeros(len(t_us), np.uint16)
        return statistics_rows({"it": statistics_of([Events(t_us, none, none, none.astype(np.uint8))], (1, 1))})[-1][1]

    gaps_us = np.random.default_rng(0).exponential(1e4, 5000).astype(np.int64)
    assert said(np.cumsum(gaps_us)) in ("6,700", "6,800", "6,900", "7,000", "7,100")  # 10^4 ln 2 = 6931
    assert said(np.arange(9)) == "1.4" and said(np.zeros(1, np.int64)) == said(10**10 * np.arange(4)) == "–"


@pytest.mark.parametrize("gap_us", [3, 9_999_999, 20_000_000, 3_000_000_000])
def test_no_interval_is_beyond_the_axis(gap_us: int) -> None:
    none = np.zeros(5, np.uint16)
    found = statistics_of([Events(gap_us * np.arange(5), none, none, none.astype(np.uint8))], (1, 1))
    drawn = interval_chart({"it": found})
    (there,) = (at for at, share in drawn["series"][0]["data"] if share > 0)
    assert there <= gap_us < drawn["xAxis"]["max"] and drawn["xAxis"]["max"] >= 1e7


@pytest.mark.parametrize(
    "options",
    [{"start": 0.5, "stop": 0.6}, {"slowdown": 4.0, "start": 0.3}, {"crop": "32x24+10+8"}, {"fps": 50.0, "start": 0.5}],
    ids=lambda options: ",".join(options),
)
def test_a_scene_is_seen_by_the_options_of_its_conversion(setup: Setup, options: dict[str, Any]) -> None:
    for name, value in options.items():
        setup = setup.with_option(name, value)
    source = Recipe.of(SMALL, rig=setup.rig, **options).source
    whole_s = duration_s(setup)
    assert whole_s == pytest.approx(source.duration_expected_s, abs=0.012)
    for start_s in (0.0, 9.0):
        light = LightTable().light(setup, start_s, 0.02)
        begin_ns, end_ns = light.instants[light.lead].t_ns, light.instants[-1].t_ns
        first_ns = next(source.frames()).t_ns
        assert first_ns - 12e6 <= begin_ns <= end_ns <= first_ns + 1e9 * whole_s
        assert (begin_ns <= first_ns) == (start_s == 0.0) and light.sizes[0] == source.size
    if "crop" in options:
        own = LightTable().light(setup, 0.0, 0.02).instants[0].frames[0].light
        assert own == pytest.approx(next(source.frames()).luminance, abs=1e-5)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"start": 5.0}, "start 5 s: nothing is left of the scene, which goes from 0 s to 2 s"),
        ({"fps": 5.0, "start": 0.21, "stop": 0.39}, "fps 5: no picture of the scene from 0.21 s to 0.39 s"),
        ({"motion": "pan"}, "motion 'pan' is for a photograph"),
        ({"upsample": "flwo"}, "upsampling 'flwo': expected one of none, linear, flow"),
        ({"depth": "plane:2"}, "depth 'plane:2' of a scene, which knows its own"),
        ({"seed": -3}, "seed -3: expected a whole number"),
        ({"slowdown": 0.0}, "slowdown 0.0: expected a number"),
        ({"crop": "32x24", "away": True}, "a rig sees all of a scene: leave --crop"),
    ],
)
def test_options_that_a_scene_cannot_have_are_refused_before_its_conversion(
    setup: Setup, options: dict[str, Any], why: str
) -> None:
    if options.pop("away", False):
        setup = setup.with_camera_values(0, {"translation_mm": (30.0, 0.0, 0.0)})
    for name, value in options.items():
        setup = setup.with_option(name, value)
    with pytest.raises(UsageError, match=re.escape(why)):
        LightTable().light(setup, 0.0, 0.02)


@pytest.mark.parametrize(
    "options", [{"stop": 0.0}, {"stop": 1e-9}, {"stop": 1e-310}, {"start": 2.0}, {"start": 0.5, "stop": 0.5}],
    ids=str,
)  # fmt: skip
def test_a_part_of_a_scene_of_no_length_is_a_picture(
    previewer: Previewer, setup: Setup, options: dict[str, float]
) -> None:
    request = Request(replace(setup, options=options), pixel=(0, 30, 20))
    answer = previewer.answer(request)
    assert [*plans_of(previewer.light(request), 0, lambda: None).plans] == ["dvs", "cis"]
    assert answer.span_s == pytest.approx([options.get("start", 0.0)] * 2, abs=1e-8)
    assert answer.cameras[0].caption.startswith("0 events") and answer.duration_s == pytest.approx(0, abs=1e-8)
    assert "the scene is rendered" not in str(answer.notes)


def test_a_video_that_stops_at_once_is_a_picture(previewer: Previewer) -> None:
    setup = Setup("synthetic:moving-edge,size=64x48,fps=100,duration_s=0.1", default_rig(), options={"stop": 0.0})
    assert previewer.answer(Request(setup.with_preset(0, "ideal"))).span_s == (0.0, 0.0)


def test_a_photograph_in_motion_is_previewed(tmp_path: Path) -> None:
    codes = np.random.default_rng(0).integers(0, 255, (60, 90, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), np.kron(codes, np.ones((8, 8, 1), np.uint8)))
    setup = setup_of(str(tmp_path / "photo.png")).with_option("motion", "pan").with_option("size", "320x240")
    light = LightTable().light(setup, 0.0, 0.02, side=40)
    whole = next(iter(Recipe.of(setup.source, motion="pan", size="320x240").source.frames())).light
    eighths = np.asarray(whole).reshape(30, 8, 40, 8).mean((1, 3))
    assert light.instants[0].frames[0].light == pytest.approx(eighths, abs=1e-5) and len(light.instants) > 2


def test_every_view_is_a_picture_and_the_slowest_exposure_is_in_it(previewer: Previewer, setup: Setup) -> None:
    pictures = {previewer.answer(Request(setup, 0.5, 0.01, view=view)).cameras[0].picture for view in VIEWS}
    assert len(pictures) == len(VIEWS) and all(picture.startswith(b"\x89PNG") for picture in pictures)
    answer = previewer.answer(Request(setup.with_sensor_values(1, {"exposure_us": 40e3}), 0.5, 0.01))
    assert answer.span_s[1] - answer.span_s[0] > 0.04 and "no frame" not in answer.cameras[1].caption
    answer = previewer.answer(Request(setup.with_sensor_values(1, {"exposure_us": 1e6}), 0.5, 0.01))
    assert "cis has no frame here: an exposure takes longer than the preview" in answer.notes


def test_large_sources_are_shown_smaller_and_that_is_said(previewer: Previewer) -> None:
    answer = previewer.answer(Request(setup_of("scene:spinning-shapes").with_preset(0, "ideal"), 0.5, 0.005, side=40))
    assert answer.cameras[0].size == (40, 30) and answer.notes[0] == "dvs, cis shown with 40x30 of 640x480 pixels"
    assert smaller((3000, 20), 300) == (300, 2) and smaller((10, 20), 300) == (10, 20)


def test_videos_are_seen_from_where_the_cameras_are(previewer: Previewer) -> None:
    clip = Path(__file__).parents[2] / "examples" / "demo.mp4"
    setup = setup_of(str(clip)).with_preset(0, "ideal").with_option("upsample", "linear")
    straight = previewer.answer(Request(setup, 0.3, 0.02, side=80))
    turned = setup.with_camera_values(0, {"rotation_deg": (0.0, 0.0, 20.0)})
    assert previewer.answer(Request(turned, 0.3, 0.02, side=80)).cameras[0].picture != straight.cameras[0].picture
    assert straight.cameras[0].statistics is not None and straight.cameras[0].statistics.events > 50
    with pytest.raises(UsageError, match="how far the scene is was not said; add --depth"):
        previewer.answer(Request(setup.with_camera_values(0, {"translation_mm": (30.0, 0.0, 0.0)}), 0.3, 0.02, side=80))


def test_in_the_middle_of_a_video_a_preview_has_the_events_of_its_conversion(
    previewer: Previewer, tmp_path: Path
) -> None:
    """Light that goes back and forth: a sensor that has just been switched on sends more of it."""
    phases, rates_hz = np.random.default_rng(0).uniform([[[0]], [[4]]], [[[2 * np.pi]], [[12]]], (2, 36, 48))
    frames = [0.3 * np.exp(0.15 * np.sin(2 * np.pi * rates_hz * k / 30 + phases)) for k in range(40)]
    np.savez(tmp_path / "film.npz", frames=np.array(frames, np.float32), fps=30)
    setup = setup_of(str(tmp_path / "film.npz")).with_preset(0, "ideal").with_option("upsample", "linear")
    answer = previewer.answer(Request(setup, 1.0, 0.03))
    shown = answer.cameras[0].statistics
    sent = Events.concatenate([*events_of(setup.source, "ideal", upsample="linear")])
    there = np.sum((sent.t > 1e6 * answer.span_s[0]) & (sent.t <= 1e6 * answer.span_s[1]))
    assert shown is not None and shown.events == pytest.approx(there, rel=0.1) and there > 500


@pytest.mark.parametrize(("start_s", "options"), [(0.25, {}), (2.0, {}), (3.9, {}), (2.0, {"start": 0.1, "stop": 4.1})])
def test_in_a_gap_between_frames_a_preview_is_of_that(
    start_s: float, options: dict[str, float], tmp_path: Path
) -> None:
    """As of a screen, of which there are frames where something changes."""
    frames = np.linspace(0.1, 0.9, 20)[:, None, None] * np.ones((20, 12, 16))
    times = np.concatenate([np.arange(10) / 30, 4 + np.arange(10) / 30])
    np.savez(tmp_path / "film.npz", frames=frames.astype(np.float32), times_s=times)
    light = LightTable().light(Setup(str(tmp_path / "film.npz"), default_rig(), options=options), start_s, 0.02)
    begin_s = options.get("start", 0.0) + start_s
    assert 1e-9 * light.instants[light.lead].t_ns <= begin_s + 1e-6
    assert 1e-9 * light.instants[light.lead + 1].t_ns > begin_s and 1e-9 * light.instants[-1].t_ns >= begin_s + 0.02


def test_where_a_video_stops_in_a_gap_between_frames_its_last_picture_is_shown(tmp_path: Path) -> None:
    frames = np.linspace(0.1, 0.9, 20)[:, None, None] * np.ones((20, 12, 16))
    times = np.concatenate([np.arange(10) / 30, 40 + np.arange(10) / 30])
    np.savez(tmp_path / "film.npz", frames=frames.astype(np.float32), times_s=times)
    setup = Setup(str(tmp_path / "film.npz"), default_rig(), options={"stop": 20.0})
    assert LightTable().light(setup, 15.0, 0.02).instants[-1].t_ns == 300_000_000


@pytest.mark.parametrize("options", [{}, {"slowdown": 3.0}])
def test_a_preview_of_frames_that_count_from_1970_begins_with_the_first(options: dict, tmp_path: Path) -> None:
    """Whose times have more digits than a number of seconds holds."""
    times_ns = 1_700_000_000_123_456_768 + np.arange(9) * 33_333_333
    np.savez(tmp_path / "film.npz", frames=np.full((9, 12, 16), 0.3, np.float32), times_ns=times_ns)
    light = LightTable().light(Setup(str(tmp_path / "film.npz"), default_rig(), options=options), 0.0, 0.02)
    first = next(iter(Recipe.of(str(tmp_path / "film.npz"), **options).source.frames()))
    assert light.lead == 0 and light.instants[0].t_ns == first.t_ns and len(light.instants) > 1


def test_sensors_of_a_preview_begin_afresh_after_a_cut(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    shots = [cv2.GaussianBlur(random.uniform(0, 1, (60, 120)), (0, 0), 3) for _ in range(2)]
    frames = [np.clip(4 * shots[k >= 20][:, k : k + 80] - 1.5, 0.02, 1) for k in range(40)]
    np.savez(tmp_path / "film.npz", frames=np.array(frames, np.float32), fps=30)
    light = LightTable().light(setup_of(str(tmp_path / "film.npz")), 0.8, 0.03)
    assert light.instants[0].t_ns == pytest.approx(20e9 / 30, abs=1e3) and light.instants[0].cut
    assert light.instants[light.lead].t_ns <= 0.8e9 < light.instants[light.lead + 1].t_ns


def test_a_refusal_is_told_from_a_plan_that_is_not_there(setup: Setup) -> None:
    session, told = Session(setup), list[tuple[str, bool]]()
    session.on("status", lambda status: told.append((status, session.refused)))
    for reply in (Refused(1, "no plan", answered=True), Refused(1, "no such file"), Refused(1, "no such file")):
        session._take(reply)
    session._take(Answer(1, 0.0, (0.0, 0.1), 1.0, (), whole=False))
    assert told == [("no plan", False), ("no such file", True), ("", False)]
    session.close()


def test_of_previews_that_wait_for_their_plan_only_the_last_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vid2ev.gui.worker.plans_of", lambda light, number, check: (light.item(), number))
    sent: SimpleQueue[Any] = SimpleQueue()
    planner, lights = Planner(sent.put, lambda: 9), list[Any]()
    for number in range(10):
        light: Any = np.full(1, 100 * number)
        lights.append(ref(light))
        planner.plan(light, number)
    assert [light().item() for light in lights if light() is not None] == [900]
    planner.start()
    assert sent.get(timeout=60) == (900, 9) and sent.empty()


def test_pictures_come_while_a_slider_moves(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vid2ev.gui.worker.PATIENCE_S", 60.0)
    worker, seen = Worker(), list[int]()
    for number in range(1, 2000):
        moved_on = setup.with_sensor_values(0, {"threshold_on": 0.2 + 1e-4 * number})
        worker.ask(Request(moved_on, 0.5, 0.005, number=number, side=32))
        seen += [reply.number for reply in worker.replies() if isinstance(reply, Answer)]
        if len(seen) > 2:
            break
        time.sleep(0.03)
    worker.close()
    assert sorted(seen) == seen and 1 < seen[-1] < number < 1999


def test_the_cost_of_accuracy_is_drawn_with_its_front() -> None:
    rows = [{"name": name, "time": time, "distance": distance, "front": front} for name, time, distance, front in (
        ("fast", 1.0, 0.3, True), ("slow", 2.0, 0.01, True), ("worse", 2.5, 0.4, False))]  # fmt: skip
    found = {"settings": rows, "reference": rows[1] | {"name": "reference", "front": False}, "recommended": "slow"}
    line, points = cost_chart(found)["series"]
    assert line["data"] == [[1.0, 0.3], [2.0, 0.01]] and len(points["data"]) == 4


def counted(tell: Tell, to: int, folder: str) -> int:
    """A task that can be cancelled."""
    for k in range(to):
        tell(k, to, "counting")
        time.sleep(0.01)
    (Path(folder) / "done").touch()
    return to


def refused(tell: Tell) -> None:
    """A task that is refused."""
    raise UsageError("value 3: expected 2; give 2")


def unheard(tell: Tell) -> None:
    """A task that does not hear."""
    tell(0, None, "")
    time.sleep(600)


def asked_at_every_step(tell: Tell) -> None:
    """A task that is asked to end at every line of telling how far it is."""

    def ask(*_: Any) -> Any:
        signal.raise_signal(signal.SIGTERM)
        return ask

    sys.settrace(ask)
    try:
        tell(0, None, "")
    finally:
        sys.settrace(None)


def finish(job: Job, cancel_after: int | None = None) -> tuple[list[Progress], Done]:
    told: list[Progress] = []
    for _ in range(3000):
        for said in job.news():
            if isinstance(said, Done):
                return told, said
            told.append(said)
            if cancel_after is not None and len(told) > cancel_after:
                job.cancel()
        time.sleep(0.02)
    raise AssertionError("the job did not end")


def test_long_work_tells_how_far_it_is_and_hears_when_nobody_wants_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, broken, wrong = Job(counted, to=5, folder=str(tmp_path)), Job(counted, to=10**5, folder="/"), Job(refused)
    told, end = finish(whole)
    assert end == Done(5) and [said.done for said in told] == [0, 1, 2, 3, 4] and (tmp_path / "done").exists()
    cancelled, refused_at = finish(broken, cancel_after=2)[1], finish(wrong)[1]
    assert cancelled == Done(why_not="cancelled") and refused_at == Done(why_not="value 3: expected 2; give 2")
    assert [done.failed for done in (end, cancelled, refused_at)] == [False, False, True]
    monkeypatch.setattr("vid2ev.gui.jobs.GRACE_S", 0.2)
    deaf = Job(unheard)
    assert finish(deaf, cancel_after=0)[1].why_not == "cancelled"
    for job in (whole, broken, wrong, deaf):
        job.close()
        assert not job.alive


def test_long_work_hears_what_asks_it_to_end_in_the_midst_of_anything() -> None:
    job = Job(asked_at_every_step)
    try:
        assert finish(job)[1] == Done(why_not="cancelled")
    finally:
        job._process.kill()


def test_a_session_keeps_the_last_good_setup_and_leaves_nothing_behind(
    setup: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even one that is never closed, as when the program is ended."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    one, other = Session(setup), Session(setup)
    assert one.change(lambda: setup.with_sensor_values(0, {"threshold_on": 0.0}))
    assert one.setup == setup
    assert one.change(lambda: setup.with_sensor_values(0, {"threshold_on": 0.5})) is None
    assert one.setup.spec(0).threshold_on == 0.5 and other.setup == setup
    assert [*tmp_path.glob("vid2ev*")] == []
    job = one.start(counted, lambda said: None, lambda said: None, to=10**5, folder="/")
    one.close()
    other.close()
    assert not job.alive
