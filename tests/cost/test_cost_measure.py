"""The ladder on a clip: what is timed, what is compared, and on which stretch."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from moving_texture import texture

from vid2ev import Dvs, Frame, events_of, load_sensor
from vid2ev.compare.comparison import compare
from vid2ev.compare.plots import save
from vid2ev.cost.errors import Errors
from vid2ev.cost.front import Budget
from vid2ev.cost.measure import Cost, measured
from vid2ev.cost.passes import Float64Dvs, run
from vid2ev.cost.plot import label, plot
from vid2ev.cost.rung import Rung
from vid2ev.cost.stretch import beginning_of, seen_stretch, stretch_of
from vid2ev.cost.table import cells, recommendation, stretch_in_words, table
from vid2ev.errors import UsageError
from vid2ev.seen.recipe import Recipe
from vid2ev.stream import Events

SIMPLE: dict[str, Any] = {"sensor": "ideal", "fps": 50, "threads": 1, "repeats": 1}


def ticks() -> Any:
    """A clock that goes on by one second whenever it is looked at."""
    return itertools.count().__next__


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> str:
    return texture(tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="module")
def cost(clip: str) -> Cost:
    return measured(clip, clock=ticks(), **SIMPLE | {"repeats": 2})


def test_times_are_those_of_the_clock_in_multiples_of_the_clip(cost: Cost) -> None:
    assert cost.span_s == 0.16 and cost.size == (96, 64)
    assert {row.times for row in (cost.reference, *cost.rows)} == {(6.25, 6.25)}


def test_errors_are_those_of_the_events_that_convert_writes(clip: str, cost: Cost) -> None:
    """Against `events_of` with the options that a setting is said to stand for."""
    options = {"sensor": "ideal", "fps": 50}
    reference = Events.concatenate(events_of(clip, subframes=2 * max(2 * cost.steps, 16), **options))
    assert cost.reference.events == len(reference) > 1000
    changes: dict[str, dict[str, Any]] = {
        "default": {},
        "straight light": {"upsample": "none"},
        "times of frames": {"overrides": ["timing=frame"]},
        "at most 2 steps": {"max_subframes": 2},
    }
    rows = {row.rung.name: row for row in cost.rows}
    assert {*changes, "half the size"} <= {*rows}
    for name, changed in changes.items():
        made = Events.concatenate(events_of(clip, **options | changed))
        said = compare(made, reference, (96, 64))
        assert rows[name].events == len(made)
        assert rows[name].errors.distance == pytest.approx(said.distance, rel=1e-9)
        assert rows[name].errors.timing_us == said.absolute_timing_error_us
        assert rows[name].errors.count_error == said.count_error


def test_light_on_its_way_is_nearer_than_light_that_goes_straight(cost: Cost) -> None:
    errors = {row.rung.name: row.errors.distance or 0.0 for row in cost.rows}
    assert errors["default"] < errors["at most 2 steps"] < errors["straight light"]
    assert errors["linear"] == errors["straight light"]
    assert cost.between["flow"] and cost.between["none"]
    assert cost.between["flow"].psnr_db > cost.between["none"].psnr_db


def test_all_but_the_times_is_the_same_again(clip: str, cost: Cost) -> None:
    again = measured(clip, clock=ticks(), **SIMPLE | {"threads": 2})
    for one, other in zip((cost.reference, *cost.rows), (again.reference, *again.rows), strict=True):
        assert (one.rung, one.errors, one.events) == (other.rung, other.errors, other.events)
    assert cost.between == again.between


def test_the_table_the_json_and_the_picture_say_the_same(cost: Cost, tmp_path: Path) -> None:
    told = json.loads(json.dumps(cost.describe(), allow_nan=False))
    lines = cells(cost)
    assert [line[1] for line in lines[1:]] == [told["reference"]["name"], *(row["name"] for row in told["settings"])]
    assert all(len(line) == len(lines[0]) for line in lines)
    ahead = {row["name"] for row in (told["reference"], *told["settings"]) if row["front"]}
    assert {line[1] for line in lines[1:] if line[0]} == ahead
    assert [line[1] for line in lines if line[0] == ">"] == [told["recommended"]]
    assert [line[1] for line in lines if "another recording" in line[-1]] == ["half the size"]
    assert recommendation(cost) == table(cost).splitlines()[-1]
    assert told["recommended"] in recommendation(cost)
    assert told["warnings"] == [] and "warning" not in table(cost)
    warned = replace(cost, warnings=("truncated",))
    assert warned.describe()["warnings"] == ["truncated"] and "\nwarning: truncated\n" in table(warned)
    plot(cost, tmp_path / "cost.png")
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("apart", [0.0, 0.02, 0.05, 0.1])
def test_no_name_is_under_the_ring_around_the_recommended_point(apart: float) -> None:
    axes = Figure(figsize=(9.5, 6)).add_subplot()
    axes.set(xlim=(0, 10), ylim=(0, 10))
    points = [(5.0 + k * apart, 5.0, f"setting number {k}", "black") for k in range(3)]
    axes.scatter(*zip(*(point[:2] for point in points), strict=True), s=36)
    axes.scatter([5.0], [5.0], s=190, facecolors="none")
    label(axes, points)
    middle, radius_px = axes.transData.transform((5.0, 5.0)), math.sqrt(190) / 2 * axes.figure.dpi / 72
    for text in axes.texts:
        box = text.get_window_extent()
        assert math.dist(middle, np.clip(middle, box.min, box.max)) > radius_px, text.get_text()


@pytest.mark.filterwarnings("error")
def test_names_of_clips_and_numbers_of_threads_are_drawn_as_they_are(
    cost: Cost, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr("vid2ev.cost.plot.save", lambda figure, path: drawn.append(figure) or save(figure, path))
    name = "$\\frac$ and $x^2$, 街.mkv"
    for threads in (1, 2):
        plot(replace(cost, clip=name, threads=threads), tmp_path / "cost.png")
    for figure, threads in zip(drawn, ("(1 thread)", "(2 threads)"), strict=True):
        assert figure.axes[0].get_title(loc="left") == f"{name}, 96x64"
        assert figure.axes[0].get_xlabel().endswith(threads)
    assert "2 threads;" in table(replace(cost, threads=2)) and "1 thread;" in table(replace(cost, threads=1))


def test_a_setting_that_was_found_where_nothing_happens_says_so(cost: Cost) -> None:
    silent = replace(cost, reference=replace(cost.reference, events=0))
    assert "--start S tries another" in recommendation(silent) and "--start" not in recommendation(cost)
    of_frames = {"errors": Errors(rms_lsb=0.0), "events": 0}
    rows = tuple(replace(row, **of_frames) for row in cost.rows)
    alone = replace(cost, reference=replace(cost.reference, **of_frames), rows=rows, budget=Budget.parse("lsb=1"))
    assert recommendation(alone).endswith("0 LSB")


def test_each_pass_is_told_of_in_advance(clip: str) -> None:
    said: list[tuple[int, int, str]] = []
    fixed = {"overrides": ["timing=frame"], "upsample": "none", "given": ("upsample", "size", "effects")}
    found = measured(clip, clock=ticks(), report=lambda *each: said.append(each), **SIMPLE | fixed)
    assert [row.rung.name for row in found.rows] == ["default"] and found.reference.rung.options == {}
    assert said == [(0, 4, "reference"), (1, 4, "default"), (2, 4, "reference"), (3, 4, "default")]
    assert found.rows[0].errors.distance == 0


def test_frames_are_compared_in_codes_of_the_same_camera(clip: str) -> None:
    fixed = {
        "upsample": "none",
        "given": ("upsample",),
        "overrides": ["cis.frame_rate_hz=40", "cis.exposure_us=17000", "timing=linear"],
    }
    found = measured(clip, clock=ticks(), frame_camera=True, **SIMPLE | fixed)
    errors = {row.rung.name: row.errors for row in found.rows}
    assert errors["default"].rms_lsb == 0
    assert 4 < (errors["frames without noise"].rms_lsb or 0) < 6  # (5.2 codes, and none below 0)
    assert (errors["frames of an instant"].rms_lsb or 0) > 1
    assert "frames, LSB" in table(found)


def test_frame_cameras_alone_are_judged_in_codes(clip: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text('[[camera]]\nname = "a"\nkind = "cis"\n')
    found = measured(
        clip,
        clock=ticks(),
        rig=tmp_path / "rig.toml",
        **SIMPLE | {"sensor": "paper", "upsample": "none", "given": ("upsample",)},
    )
    assert found.budget.text == "lsb=1" and found.recommended in (found.reference, found.rows[0])
    assert all(row.errors.distance is None and row.errors.rms_lsb is not None for row in found.rows)
    assert "timing" not in table(found)
    plot(found, tmp_path / "cost.png")


def test_views_by_a_plane_are_compared_with_those_by_depth(clip: str, tmp_path: Path) -> None:
    depth = np.full((64, 96), 4.0, np.float32)
    depth[16:48, 30:70] = 1.0
    np.save(tmp_path / "depth.npy", depth)
    (tmp_path / "rig.toml").write_text('[[camera]]\nname = "a"\nkind = "dvs"\ntranslation_mm = [60, 0, 0]\n')
    fixed = {"upsample": "none", "given": ("upsample", "rig", "depth"), "overrides": ["timing=linear"]}
    rig = {"rig": tmp_path / "rig.toml", "depth": str(tmp_path / "depth.npy")}
    found = measured(clip, clock=ticks(), **SIMPLE | fixed | rig)
    plane = next(row for row in found.rows if row.rung.group == "views")
    assert plane.errors.views and 5 < plane.errors.views.psnr_db < 40 and plane.errors.views.ssim < 0.99
    assert (plane.errors.distance or 0) > 0.05 and found.recommended is not plane


@pytest.mark.parametrize(
    ("options", "frames", "stretch"),
    [
        ({}, 30, (4.25, 5.25)),
        ({"start": 2.0}, 30, (5.25, 6.25)),
        ({"stop": 4.0}, 30, (1.5, 2.5)),
        ({"start": 1.0, "stop": 1.5}, 30, (1.0, 1.5)),
        ({"slowdown": 4.0}, 30, (4.25, 5.25)),
        ({}, 15, (4.5, 5.0)),
    ],
)
def test_the_stretch_is_the_middle(options: dict, frames: int, stretch: tuple[float, float]) -> None:
    recipe = Recipe.of("synthetic:sine,size=64x48,fps=30,duration_s=9.5", "ideal", **options)
    assert stretch_of(recipe, options, frames=frames) == pytest.approx(stretch, abs=0.05)
    begin, end = stretch_of(recipe, options, duration_s=0.2)
    assert begin is not None and end == pytest.approx(begin + 0.2)


@pytest.mark.parametrize(("stop", "duration_s"), [(None, None), (3.0, None), (0.1, None), (3.0, 9.0), (0.1, 0.05)])
def test_no_stretch_goes_on_beyond_what_is_asked_for(stop: float | None, duration_s: float | None) -> None:
    options = {} if stop is None else {"stop": stop}
    recipe = Recipe.of("synthetic:sine,size=64x48,fps=30,duration_s=9.5", "ideal", **options)
    for begin, end in (stretch_of(recipe, options, duration_s), beginning_of(recipe, options, duration_s)):
        assert stop is None or (end is not None and (begin or 0) < end <= stop)


def test_which_part_of_a_clip_was_tried_is_said_by_its_ends() -> None:
    for stretch, words in (((None, None), "all of it"), ((1.0, None), "from 1 s on"), ((None, 2.5), "from 0 to 2.5 s"),
                           ((1.0, 2.5), "from 1 to 2.5 s")):  # fmt: skip
        assert stretch_in_words(stretch) == words


def test_larger_pictures_are_given_less_time() -> None:
    spans = []
    for size in ("640x480", "1280x720", "1920x1440"):
        begin, end = stretch_of(Recipe.of(f"synthetic:sine,size={size},fps=30,duration_s=9", "ideal"), {})
        spans.append((end or 0) - (begin or 0))
    assert spans == pytest.approx([1, 1 / 3, 8 / 30], rel=0.02)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"budget": "vR"}, "budget"),
        ({"repeats": 0}, "repeats 0"),
        ({"duration_s": 0.0}, "duration"),
        ({"duration_s": 0.01}, "a single frame|no frame"),
        ({"sensor": "no-such"}, "no-such"),
    ],
)
def test_what_cannot_be_meant_is_refused(clip: str, options: dict, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        measured(clip, clock=ticks(), **SIMPLE | options)


def test_a_single_frame_is_refused_with_what_to_do(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.zeros((1, 8, 8)))
    with pytest.raises(UsageError, match=r"a single frame .* expected two or more, of a clip with more frames"):
        measured(str(tmp_path / "one.npy"), clock=ticks(), **SIMPLE)


def test_settings_are_tried_where_there_are_pictures(tmp_path: Path) -> None:
    """After the middle, where nothing is in it, as of a screen that waits; at the beginning, where nothing comes."""
    times_s = [*np.arange(40) / 30, *(8 + np.arange(40) / 30)]
    (tmp_path / "screen").mkdir()
    for k in range(len(times_s)):
        cv2.imwrite(str(tmp_path / "screen" / f"{k:03d}.png"), np.full((24, 32), 20 + 2 * k, np.uint8))
    (tmp_path / "screen" / "timestamps.txt").write_text("\n".join(f"{t:.6f}" for t in times_s))
    given = SIMPLE | {"fps": None, "upsample": "none", "given": ("upsample",)}
    found = measured(str(tmp_path / "screen"), clock=ticks(), **given)
    assert found.stretch_s == pytest.approx((8, 8 + 29 / 30), abs=1e-6) and found.reference.events > 0
    (tmp_path / "screen" / "timestamps.txt").write_text("\n".join(f"{t:.6f}" for t in [*times_s[:-1], 60.0]))
    found = measured(str(tmp_path / "screen"), clock=ticks(), **given)
    assert found.stretch_s == pytest.approx((0.0, 1.0), abs=1e-6) and found.reference.events > 0


@pytest.mark.parametrize("options", [{}, {"slowdown": 4.0}])
@pytest.mark.parametrize(
    ("times_s", "expected"),
    [
        pytest.param([*range(6), *(6 + np.arange(480) / 240), *range(8, 15)], 30, id="fast in the middle"),
        pytest.param([*(np.arange(60) / 30), *range(2, 12), *(12 + np.arange(60) / 30)], 8, id="slow in the middle"),
    ],
)
def test_as_many_pictures_are_taken_as_there_are_whatever_a_header_claims(
    tmp_path: Path, times_s: list[float], expected: int, options: dict[str, Any]
) -> None:
    """Of a clip whose times are uneven its rate is a mean, or what its container claims."""
    path = tmp_path / "uneven.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, width=32, height=32, pix_fmt="yuv420p")
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        for time_s in times_s:
            picture = av.VideoFrame(32, 32, "yuv420p")
            picture.pts, picture.time_base = round(1000 * time_s), stream.time_base
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    asked: dict[str, Any] = {"video": str(path), "sensor": "ideal"} | options
    begin, end = seen_stretch(Recipe.of(**asked), asked)
    assert begin is not None and end is not None and begin > 2
    assert len([t for t in times_s if begin - 2e-3 <= t <= end + 2e-3]) == expected


def test_the_reference_draws_the_noise_that_is_drawn_in_a_stretch_from_the_middle(clip: str) -> None:
    """Noise by count is counted from one instant in all settings; else it would be the largest of their errors."""
    options = {"video": clip, "fps": 50, "start": 0.06, "subframes": 4, "tolerance": 0.01}
    one, other = (
        Events.concatenate(run(options, Rung("", float64=float64), 1, keep=True).sent[0].events)
        for float64 in (True, False)
    )
    assert len(one) == len(other) > 1000 and np.abs(one.t - other.t).max() <= 1


def test_what_passes_once_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    once = SimpleNamespace(source=SimpleNamespace(rewindable=False))
    monkeypatch.setattr(Recipe, "of", lambda **_: once)
    with pytest.raises(UsageError, match="passes once"):
        measured("-")


def test_the_reference_carries_all_lags_in_float64() -> None:
    """What lags have beyond float32 is kept in every pixel that moves; otherwise only where they are steep."""
    spec, draw = load_sensor("paper"), np.random.default_rng(0)
    frames = [Frame((0.3 + 0.01 * k * draw.random((8, 16))).astype(np.float32), 100_000 * k) for k in range(9)]
    rests, events = [], []
    for kind in (Float64Dvs, Dvs):
        sensor = kind(spec, (16, 8))
        events.append(Events.concatenate(list(sensor.run(frames))))
        rests.append(np.count_nonzero(sensor.state()["rest"].reshape(2, -1)[:, :128], axis=1).min())
    assert rests[0] > 120 and rests[1] == 0
    assert len(events[0]) == len(events[1]) > 10
    assert np.abs(events[0].t - events[1].t).max() <= 1
