"""A scene as a source: the protocol of sources, edits, resumes, rigs; and what is said of requests that are none."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from render_pools import pools_begun

from vid2ev import Dvs, convert, load_sensor
from vid2ev.errors import UsageError
from vid2ev.making import conversion
from vid2ev.recording.manifest import read_manifest
from vid2ev.scenes.source import SceneSource, parse_request, split_outside
from vid2ev.scenes.world import World
from vid2ev.sources import open_source
from vid2ev.stream.frames import Frame

TEXT = "scene:flying-shapes,seed=3,size=48x36,duration_s=0.05"


def same(one: Frame, other: Frame) -> bool:
    return one.t_ns == other.t_ns and np.array_equal(one.light, other.light)


def test_a_scene_is_a_source() -> None:
    source = open_source(TEXT)
    frames = list(source.frames())
    assert source.size == (48, 36) and source.rewindable and source.dense  # type: ignore[attr-defined]
    assert len(frames) == source.frames_expected and source.duration_expected_s == pytest.approx(0.05)
    assert frames[0].t_ns == 0 and frames[-1].t_ns == 50_000_000
    assert all(frame.light.shape == (36, 48) and frame.light.dtype == np.float32 for frame in frames)
    about = json.loads(json.dumps(source.describe()))
    assert about["kind"] == "scene" and about["seed"] == 3 and about["scene"]["objects"]


@pytest.mark.parametrize("key", ["environment", "objects.crate.texture"])
def test_it_is_another_with_another_photograph_under_the_same_name(tmp_path: Path, key: str) -> None:
    photograph = tmp_path / "photograph.png"

    def with_light(code: int) -> dict[str, Any]:
        cv2.imwrite(str(photograph), np.full((4, 4, 3), code, np.uint8))
        os.utime(photograph, (1, 1))
        return open_source(f"scene:room,size=16x12,duration_s=0.01,{key}={photograph}").describe()

    first = with_light(40)
    assert with_light(40) == first != with_light(220)


MESH = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl m\nf 1/1 2/2 3/3\n"


@pytest.mark.parametrize("changed", ["m.mtl", "skin.png", "mesh.obj"])
def test_it_is_another_where_what_a_mesh_names_is_another(tmp_path: Path, changed: str) -> None:
    (tmp_path / "mesh.obj").write_text(MESH)
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    cv2.imwrite(str(tmp_path / "skin.png"), np.full((4, 4, 3), 40, np.uint8))
    scene = f"scene:room,size=16x12,duration_s=0.01,objects.crate.kind=mesh,objects.crate.file={tmp_path / 'mesh.obj'}"

    def known_by() -> Any:
        return json.dumps(open_source(scene).describe()["files"])

    first = known_by()
    assert known_by() == first
    with open(tmp_path / changed, "ab") as file:
        file.write(b"\n")
    assert known_by() != first


@pytest.mark.parametrize("fps", [None, 200])
def test_frames_from_an_index_on_are_those_of_the_whole(fps: float | None) -> None:
    source = open_source(TEXT, fps=fps)
    whole = list(source.frames())
    for start in (0, 1, len(whole) - 1, len(whole)):
        again = list(open_source(TEXT, fps=fps).frames(start))
        assert len(again) == len(whole) - start and all(map(same, again, whole[start:]))


def test_colour_is_luminance_or_rgb() -> None:
    grey, rgb = (next(iter(open_source(TEXT, colour=colour).frames())) for colour in ("luminance", "rgb"))
    assert rgb.light.shape == (36, 48, 3) and np.allclose(rgb.luminance, grey.light, atol=1e-6)


@pytest.mark.parametrize(
    "edits", [{}, {"stop": 0.02}, {"start": 0.01, "stop": 0.02}, {"slowdown": 4}, {"size": "20x15"}]
)
def test_its_description_says_how_long_what_is_left_of_it_lasts(edits: dict[str, object]) -> None:
    source = open_source(TEXT, **edits)  # type: ignore[arg-type]
    assert source.describe()["duration_expected_s"] == source.duration_expected_s


def test_parts_and_sizes_are_those_of_any_source() -> None:
    whole = list(open_source(TEXT, fps=1000).frames())
    part = open_source(TEXT, fps=1000, start=0.0105, stop=0.02)
    assert [frame.t_ns for frame in part.frames()] == [k * 10**6 for k in range(11, 21)]
    assert all(map(same, islice(part.frames(), 3), whole[11:14]))
    assert next(iter(open_source(TEXT, fps=1000, crop="24x20+2+3", size="12").frames())).light.shape == (10, 12)


def test_instants_between_two_are_those_of_the_frames() -> None:
    source = open_source(TEXT, fps=100)
    assert isinstance(source, SceneSource)
    instants = [frame.t_ns for frame in source.frames()]
    assert source.instants_between(None, None) == instants
    assert source.instants_between(instants[1], instants[-2], 1) == instants[2:-1]
    between = [frame.t_ns for frame in source.frames_between(instants[1] - 5, instants[-2] + 5)]
    assert between == instants[1:-1]


def test_settings_may_be_longer_than_any_name_of_a_file(tmp_path: Path) -> None:
    text = f"scene:room,size=32x24,scene.duration_s=0.05{'0' * 250}"
    assert open_source(text).duration_expected_s == pytest.approx(0.05)
    convert(text, tmp_path / "made", preview=False, threads=1)
    assert read_manifest(tmp_path / "made" / "manifest.json")["source"]["path"] == text


def test_a_scene_file_is_a_source(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text('[scene]\nduration_s = 0.1\n[camera]\nsize = [8, 6]\n[[objects]]\nname = "a"\nkind = "box"\n')
    assert open_source(file).size == (8, 6)
    assert open_source(f"scene:{file},size=10x5").size == (10, 5)


@pytest.mark.parametrize("edits", [{}, {"size": "96x72"}])
@pytest.mark.parametrize(("threads", "pools"), [(1, set()), (2, {2}), (None, {3})])
def test_a_scene_is_rendered_by_as_many_threads_as_its_conversion_is_given(
    threads: int | None, pools: set[int], edits: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By default by as many as there are cores for this process, however many the machine has."""
    begun = pools_begun(monkeypatch, 3, conversion)
    text = "scene:room,size=128x96,duration_s=0.02"
    convert(text, tmp_path / "made", "ideal", preview=False, threads=threads, fps=100, **edits)
    assert begun == pools


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scene:rooom", "did you mean room?"),
        ("scene:", "is unknown"),
        ("scene:room,seed=x", "seed 'x', expected a whole number"),
        ("scene:room,seed=-1", "seed '-1'"),
        ("scene:room,seed=9999999999999999999", "from 0 to 2"),
        ("scene:room,fov=3", "key 'scene.fov' is unknown"),
        ("scene:room,size=0x5", "1 to 16384"),
        ("scene:room,camera", "not of the form key=value"),
    ],
)
def test_requests_that_are_none_are_refused_in_one_sentence(text: str, said: str) -> None:
    with pytest.raises(UsageError) as refused:
        open_source(text)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_other_options_that_cannot_be_meant() -> None:
    with pytest.raises(UsageError, match="linear already"):
        open_source(TEXT, transfer="pq")
    with pytest.raises(UsageError, match="fps 0"):
        open_source(TEXT, fps=0)


def test_commas_within_brackets_and_quotes_belong_to_a_value() -> None:
    text = "room,a.b=[1, 2],c.d={ uniform = [1, 2] },e=\"x,y\",f='[,',seed=4"
    assert split_outside(text) == ["room", "a.b=[1, 2]", "c.d={ uniform = [1, 2] }", 'e="x,y"', "f='[,'", "seed=4"]
    request = parse_request("room,size=64x48,camera.fov_deg=70,seed=12")
    assert request == ("room", 12, ["camera.size=[64, 48]", "camera.fov_deg=70"])


# ------------------------------------------------------------------------------------- how exact the events are

SMOOTH = """
[scene]
duration_s = 0.2
[camera]
size = [32, 24]
[camera.trajectory]
kind = "keyframes"
times_s = [-0.1, 0.1, 0.3]
positions_m = [[-0.04, 0, 0], [0.0, 0.01, 0], [0.05, 0, 0.02]]
[[objects]]
name = "wall"
kind = "plane"
size_m = [4, 4, 0]
repeat = [2, 2]
texture = { pattern = "noise", roughness = 2.5, size_px = 128, seed = 3, colours = [[0.1, 0.1, 0.1], [0.9, 0.9, 0.9]] }
trajectory = [{ kind = "fixed", position_m = [0, 0, 1] }, { kind = "spin", rate_deg_s = 40 }]
[[lights]]
name = "lamp"
kind = "point"
trajectory = { kind = "orbit", centre_m = [0, 0, 0.2], radius_m = 0.3, period_s = 0.5 }
[[lights]]
name = "rest"
kind = "ambient"
colour = 0.5
flicker = { frequency_hz = 7, depth = 0.3 }
"""


def crossings(world: World, fps: float | None = None) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """The events of each pixel: times [us] and polarities."""
    found: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for events in Dvs(load_sensor("ideal", ["threshold_on=0.1", "threshold_off=0.1"]), world.intrinsics.size).run(
        SceneSource(world, fps=fps).frames()
    ):
        for t, x, y, p in zip(events.t, events.x, events.y, events.p, strict=True):
            found.setdefault((int(x), int(y)), []).append((int(t), int(p)))
    return found


def errors_us(one: dict, truth: dict) -> Iterator[int]:
    """How far times of events are apart, in pixels that have the same events."""
    for pixel, events in one.items():
        other = truth.get(pixel, [])
        if [p for _, p in events] == [p for _, p in other]:
            yield from (abs(a - b) for (a, _), (b, _) in zip(events, other, strict=True))


def test_events_converge_as_the_square_of_the_sampling_interval(tmp_path: Path) -> None:
    file = tmp_path / "smooth.toml"
    file.write_text(SMOOTH)
    world = World.of(file)
    truth = crossings(world, 2400)
    assert sum(map(len, truth.values())) > 2000
    means = []
    for fps in (75, 150, 300):
        errors = list(errors_us(crossings(world, fps), truth))
        assert len(errors) > 1500
        means.append(np.percentile(errors, 75))
    orders = np.log2(np.array(means[:-1]) / means[1:])
    assert orders.min() > 1.6, (means, orders)  # (2 but for the microseconds to which times are rounded)


def test_so_do_those_of_a_predefined_scene_with_the_shift_that_is_asked_for() -> None:
    settings = ["camera.size=[64, 48]", "duration_s=0.1", "min_fps=1"]
    truth = crossings(World.of("flying-shapes", 1, [*settings, "max_shift_px=0.06"]))
    medians = []
    for shift in (0.8, 0.4, 0.2):
        events = crossings(World.of("flying-shapes", 1, [*settings, f"max_shift_px={shift}"]))
        medians.append(np.median(list(errors_us(events, truth))))
    orders = np.log2(np.array(medians[:-1]) / medians[1:])
    assert orders.min() > 1.5 and orders.max() < 2.6, (medians, orders)
