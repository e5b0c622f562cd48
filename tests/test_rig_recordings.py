"""Recordings of rigs: every camera has its folder, views that are the video's cost nothing and change nothing."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev import CisSpec, DataError, Events, UsageError, convert, read_events
from vid2ev.commands import main
from vid2ev.making.conversion import Paused
from vid2ev.making.split import convert_split
from vid2ev.recording.truth_files import read_depth, read_flow, read_mask, read_pixel_map, read_poses
from vid2ev.rig.bands import Bands
from vid2ev.rig.camera import Camera, Rig, Source
from vid2ev.rig.pose import IDENTITY
from vid2ev.rig.rig_file import read_rig
from vid2ev.scenes.source import SceneSource
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import are_free
from vid2ev.sources import open_source
from vid2ev.sources.synthetic import MovingEdge

CLIP = "synthetic:moving-edge,size=64x48,fps=200,duration_s=0.2"
OPTIONS: dict[str, Any] = {"upsample": "none", "seed": 3, "threads": 1}
FRAMES = Rig(cameras=(Camera(name="aps", kind="cis"),))


def rig(**camera: Any) -> Rig:
    cameras = (
        Camera(name="left", kind="dvs"),
        Camera(name="right", kind="dvs", **camera),
        Camera(name="aps", kind="cis"),
    )
    return Rig(source=Source(fov_deg=60.0), cameras=cameras)


def columns(directory: Path) -> tuple[list[int], ...]:
    events = Events.concatenate(read_events(directory))
    return tuple(getattr(events, name).tolist() for name in ("t", "x", "y", "p"))


def test_a_camera_where_the_video_was_taken_sends_what_it_sends_alone(tmp_path: Path) -> None:
    convert(CLIP, tmp_path / "alone", **OPTIONS)
    convert(CLIP, tmp_path / "rig", rig=rig(seed=3), **OPTIONS)
    convert(CLIP, tmp_path / "frames", cis="paper", **OPTIONS)
    left = columns(tmp_path / "rig" / "left")
    assert left == columns(tmp_path / "frames" / "dvs")
    assert left != columns(tmp_path / "rig" / "right")  # (another camera of one seed)
    # (luminance that is mixed from red, green and blue is rounded differently: by a microsecond here and there)
    alone = columns(tmp_path / "alone")
    pixels = [sorted(zip(x, y, t, p, strict=True)) for t, x, y, p in (alone, left)]
    assert len(pixels[0]) == len(pixels[1]) > 1000
    for one, other in zip(*pixels, strict=True):
        assert one[:2] == other[:2] and one[3] == other[3] and abs(one[2] - other[2]) <= 1


def test_threads_form_views_and_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bands, moved = list[int](), {"rig": rig(translation_mm=(15.0, 0.0, 0.0)), "depth": "plane:2"}
    run = Bands.run
    monkeypatch.setattr(Bands, "run", lambda self, *rest: (bands.append(self.threads), run(self, *rest)))
    for threads in (1, 3):
        bands.clear()
        convert(CLIP, tmp_path / str(threads), **OPTIONS | moved | {"threads": threads})
        assert bands and {*bands} == {threads}
    for name in ("left", "right"):
        files = [tmp_path / threads / name / "events.h5" for threads in "13"]
        assert files[0].read_bytes() == files[1].read_bytes()


def test_the_only_event_camera_of_a_rig_is_the_one_that_is_meant(tmp_path: Path) -> None:
    convert(CLIP, tmp_path / "one", cis="paper", **OPTIONS)
    convert(CLIP, tmp_path / "two", rig=rig(), **OPTIONS)
    for verb, into, target in (("reformat", [], "events.npz"), ("render", ["-o"], "picture.png")):
        made = CliRunner().invoke(main, [verb, str(tmp_path / "one"), *into, str(tmp_path / target)])
        assert made.exit_code == 0, made.output
        unclear = CliRunner().invoke(main, [verb, str(tmp_path / "two"), *into, str(tmp_path / f"two.{target}")])
        assert unclear.exit_code == 2 and "of the cameras aps, left, right; give one" in unclear.output
    assert columns(tmp_path / "events.npz") == columns(tmp_path / "one" / "dvs")


def test_a_recording_holds_the_sensor_files_of_its_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine").mkdir()
    Path("mine/sensor.toml").write_text("[dvs]\nthreshold_on = 0.2\nrefractory_us = 90\n")
    convert(CLIP, "made/out", rig=rig(sensor="mine/sensor.toml", set={"threshold_on": 0.3}), **OPTIONS)
    Path("mine/sensor.toml").unlink()
    Path("made").rename("moved")
    convert(CLIP, "again", rig="moved/out/rig.toml", **OPTIONS)
    assert columns(Path("moved/out/right")) == columns(Path("again/right"))
    convert(CLIP, "again", rig="moved/out/rig.toml", overwrite=True, **OPTIONS)


@pytest.mark.parametrize("name", ["n" * 300, "a\0b", "a/" * 3000])
def test_a_folder_that_cannot_be_is_one_sentence(name: str) -> None:
    with pytest.raises(DataError, match="give one that a folder can have"):
        convert(CLIP, name, **OPTIONS)


def test_every_camera_has_a_recording_of_its_own(tmp_path: Path) -> None:
    manifest = convert(CLIP, tmp_path / "out", rig=rig(), formats=["hdf5", "csv"], **OPTIONS)
    names = {"left": "dvs", "right": "dvs", "aps": "cis"}
    assert list(manifest["cameras"]) == list(manifest["results"]) == list(names)
    for name, kind in names.items():
        own = json.loads((tmp_path / "out" / name / "manifest.json").read_text())
        assert own["camera"] == name and own["sensor"]["kind"] == kind and own["sensor"]["size"] == [64, 48]
        assert own["counts"] == manifest["results"][name]["counts"]
        files = {path.name for path in (tmp_path / "out" / name).iterdir()}
        events = {"events.h5", "events.csv", "preview.mp4", "manifest.json"}
        assert files == (events if kind == "dvs" else {"raw", "frames.mp4", "manifest.json"})
    kept = read_rig(tmp_path / "out" / "rig.toml")
    assert kept.resolved((64, 48)).describe()["cameras"] == manifest["rig"]["cameras"]
    stamps = np.loadtxt(tmp_path / "out" / "aps" / "raw" / "timestamps.txt", dtype=np.int64)
    starts = np.arange(6) * 10**6 // 30
    np.testing.assert_array_equal(stamps, np.stack([starts, starts + 5000], axis=1))
    assert manifest["results"]["aps"]["counts"]["exposures"] == 6
    codes = cv2.imread(str(tmp_path / "out" / "aps" / "raw" / "000003.png"), cv2.IMREAD_UNCHANGED)
    assert codes.dtype == np.uint16 and codes.shape == (48, 64, 3) and codes.max() < 1024


@pytest.mark.parametrize("offset_us", [1_234_567, -5_000_000])
@pytest.mark.parametrize("noise", [{"crossing_noise": 0.05}, {"photoreceptor_noise": 0.05}])
def test_a_clock_of_its_own_moves_times_and_nothing_else(
    tmp_path: Path, offset_us: int, noise: dict[str, float]
) -> None:
    """Of a camera that is the same otherwise, noise that is drawn by count among it."""
    for name, late in (("early", 0), ("late", offset_us)):
        convert(CLIP, tmp_path / name, rig=rig(clock_offset_us=late, set=noise), **OPTIONS)
    early, late = (columns(tmp_path / name / "right") for name in ("early", "late"))
    assert len(early[0]) > 1000 and [t + offset_us for t in early[0]] == late[0] and early[1:] == late[1:]


@pytest.mark.parametrize("kind", ["ros1", "ros2"])
def test_times_that_a_format_does_not_have_are_refused_before_converting(tmp_path: Path, kind: str) -> None:
    early = rig(clock_offset_us=-5000)
    with pytest.raises(UsageError, match=rf"^format {kind} cannot hold times from -0\.005 to 0\.195 s, .*hdf5$"):
        convert(CLIP, tmp_path / "out", rig=early, formats=kind, report=pytest.fail, **OPTIONS)
    assert not list(tmp_path.iterdir())
    convert(CLIP, tmp_path / "out", rig=rig(clock_offset_us=5000), formats=kind, preview=False, **OPTIONS)


def test_what_a_format_can_hold_to_the_end_it_holds_when_a_recording_is_taken_up(tmp_path: Path) -> None:
    light = np.random.default_rng(0).uniform(0.1, 1, (5, 8, 8)).astype(np.float32)
    options: dict[str, Any] = {"formats": "ros1", "preview": False, "piece": 1, **OPTIONS}
    for late_us in (0, 1):  # (times of ROS go to 2**31 s)
        times_us = np.linspace(-400_000, 0, 5).astype(np.int64) + 2**31 * 10**6 - 1 + late_us
        np.savez(tmp_path / f"{late_us}.npz", frames=light, times_us=times_us)
    manifest = convert(tmp_path / "0.npz", tmp_path / "whole", **options)
    links = 0
    while not (tmp_path / "out").exists():
        with suppress(Paused):
            again = convert(tmp_path / "0.npz", tmp_path / "out", resume=True, pause=lambda: True, **options)
        links += 1
    assert manifest.pop("run") and again.pop("run") and again == manifest and links > 2
    with pytest.raises(UsageError, match="cannot hold times"):
        convert(tmp_path / "1.npz", tmp_path / "late", **options)


def test_a_clip_that_passes_once_is_refused_for_its_times_at_its_first_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MovingEdge, "rewindable", False)
    with pytest.raises(UsageError, match=r"cannot hold times from -0\.005"):
        convert(CLIP, tmp_path / "out", rig=rig(clock_offset_us=-5000), formats="ros1", report=pytest.fail, **OPTIONS)
    assert not list(tmp_path.iterdir())


def test_a_camera_beside_the_video_sees_a_plane_shifted_by_its_disparity(tmp_path: Path) -> None:
    options = OPTIONS | {"sensor": "ideal", "depth": "plane:2"}
    focal_px = 32 / np.tan(np.radians(30))
    baseline_mm = 5 * 2000 / focal_px  # (a disparity of 5 px)
    convert(CLIP, tmp_path / "out", rig=rig(translation_mm=(baseline_mm, 0.0, 0.0)), **options)
    left, right = columns(tmp_path / "out" / "left"), columns(tmp_path / "out" / "right")
    assert len(left[0]) > 1000

    def of(events: tuple[list[int], ...], first: int, last: int) -> list[tuple[int, ...]]:
        return sorted((t, x - first, y, p) for t, x, y, p in zip(*events, strict=True) if first <= x <= last)

    assert of(left, 10, 60) == of(right, 5, 55)


@pytest.mark.parametrize("depth", ["one", "each"])
def test_depth_maps_serve_as_a_plane_does(tmp_path: Path, depth: str) -> None:
    maps = np.full((48, 64) if depth == "one" else (41, 48, 64), 2, np.float32)
    np.save(tmp_path / "depth.npy", maps)
    around, options = rig(translation_mm=(40.0, 5.0, 0.0)), OPTIONS | {"sensor": "ideal"}
    convert(CLIP, tmp_path / "plane", rig=around, depth="plane:2", **options)
    convert(CLIP, tmp_path / "maps", rig=around, depth=tmp_path / "depth.npy", **options)
    plane, maps_ = columns(tmp_path / "plane" / "right"), columns(tmp_path / "maps" / "right")
    inside = [sum(4 <= x < 56 and 4 <= y < 44 for x, y in zip(*one[1:3], strict=True)) for one in (plane, maps_)]
    assert inside[0] == inside[1] > 1000


@pytest.mark.parametrize(
    "source",
    [
        Source(size=(64, 48), focal_px=(50.0, 50.0), centre_px=(30.0, 20.0)),  # of the video
        Source(size=(16, 12), focal_px=(25.0, 25.0), centre_px=(9.75, 5.75)),  # of what is left of it
        Source(fov_deg=2 * math.degrees(math.atan(32 / 50))),  # of the video
        Source(focal_px=(50.0, 50.0), centre_px=(30.0, 20.0)),
    ],
    ids=["whole", "part", "field", "without-size"],
)
def test_a_part_of_a_video_is_as_far_as_the_video_and_seen_through_the_same_lens(
    tmp_path: Path, source: Source
) -> None:
    np.save(tmp_path / "disparity.npy", np.full((48, 64), 50 * 0.1 / 4, np.float32))
    beside = Rig(source=source, cameras=(Camera(name="right", kind="dvs", translation_mm=(40.0, 0.0, 0.0)),))
    depth = f"{tmp_path / 'disparity.npy'},baseline_m=0.1"
    recipe = Recipe.of(CLIP, rig=beside, depth=depth, crop="32x24+10+8", size=(16, 12))
    assert recipe.rig.source.size == (16, 12) and recipe.rig.source.focal_px == pytest.approx((25, 25))
    assert recipe.rig.source.centre_px == pytest.approx((9.75, 5.75) if source.fov_deg is None else (10.5, 7.5))
    np.testing.assert_allclose(next(recipe.source.frames()).depth, 4, rtol=1e-6)


@pytest.mark.parametrize(
    ("edit", "focal", "centre_px"),
    [
        ({"size": "64x64!"}, (1, 4 / 3), (31.5, 31.5)),
        ({"crop": "32x24+10+8"}, (1, 1), (21.5, 15.5)),
        ({"crop": "32x24+10+8", "size": "64x24!"}, (2, 1), (43.5, 15.5)),
        ({"size": "16x12"}, (1 / 4, 1 / 4), (7.5, 5.5)),
        ({"size": "24x12"}, (3 / 8, 3 / 8), (11.5, 5.5)),
    ],
)
def test_without_a_rig_the_whole_video_has_the_assumed_field(
    edit: dict[str, str], focal: tuple[float, float], centre_px: tuple[float, float]
) -> None:
    whole_px = 32 / math.tan(math.radians(30))
    assert Recipe.of(CLIP, frame_camera=True).rig.source.focal_px == pytest.approx((whole_px, whole_px))
    part = Recipe.of(CLIP, frame_camera=True, **edit).rig
    assert part.source_assumed and part.source.centre_px == pytest.approx(centre_px)
    assert part.source.focal_px == pytest.approx([whole_px * each for each in focal])
    assert part.viewpoints[0].intrinsics == part.source


def test_a_camera_with_the_field_of_a_video_that_is_made_smaller_gets_its_very_frames() -> None:
    """Whatever its size, to the last bit."""
    for width in range(4, 200, 4):
        size = (width, width * 3 // 4)
        camera = Camera(name="left", kind="dvs", size=size, fov_deg=53.7)
        around = Rig(source=Source(fov_deg=53.7), cameras=(camera,))
        recipe = Recipe.of(CLIP, rig=around, size=size)
        assert are_free(recipe.rig.source, recipe.mounts)


def test_a_part_brought_to_the_size_of_the_whole_has_a_longer_lens(tmp_path: Path) -> None:
    whole = Source(size=(64, 48), focal_px=(50.0, 50.0), centre_px=(30.0, 20.0))
    options = {"crop": "32x24+10+8", "size": (64, 48)} | OPTIONS
    recipe = Recipe.of(CLIP, rig=Rig(source=whole, cameras=(Camera(name="dvs", kind="dvs"),)), **options_of(options))
    assert recipe.rig.source.focal_px == pytest.approx((100, 100))
    assert recipe.rig.source.centre_px == pytest.approx((40.5, 24.5))
    convert(CLIP, tmp_path / "out", rig=Rig(source=whole, cameras=rig().cameras), **options)
    again = Recipe.of(CLIP, rig=tmp_path / "out/rig.toml", **options_of(options))
    assert again.rig.source.focal_px == pytest.approx((100, 100))
    assert again.rig.source.centre_px == pytest.approx((40.5, 24.5))


def options_of(options: dict[str, Any]) -> dict[str, Any]:
    """Those of a recipe."""
    return {name: value for name, value in options.items() if name != "threads"}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rig": rig(translation_mm=(15.0, 0.0, 0.0))}, "camera right stands beside .* add --depth"),
        ({"rig": rig(size=(65535, 65535))}, "size 65535x65535: expected 1x1 to 33554432 pixels in all"),
        ({"rig": rig(size=(65535, 65535)), "effects": "auto"}, "size 65535x65535: expected 1x1 to"),
        ({"rig": rig(set={"threshold": 0.2})}, "threshold"),
        ({"rig": rig(sensor="davis3")}, "did you mean davis346"),
        ({"rig": rig(translation_mm=(15.0, 0.0, 0.0)), "depth": "plane:-1"}, "plane:-1"),
        ({"rig": rig(), "depth": "plane:2", "cis": "papr"}, "did you mean paper"),
        ({"rig": Rig(cameras=rig().cameras[:2]), "cis": "phone"}, "^cis 'phone': expected a frame camera in the rig"),
        (
            {"rig": Rig(cameras=rig().cameras[:2]), "cis": CisSpec()},
            "^cis: expected a frame camera in the rig; add --fr",
        ),
        ({"rig": FRAMES, "sensor": "davis346"}, "^sensor 'davis346': expected an event camera in the rig; add one"),
        ({"truth_rate_hz": 7.0}, "^truth at 7 Hz: expected some to be written; add --truth"),
        ({"depth": "plane:2"}, "leave --depth out"),
        ({"rig": rig(translation_mm=(0.0, 0.0, 0.0)), "depth": "plane:2"}, "leave --depth out"),
        ({"rig": "missing.toml"}, "missing.toml"),
        ({"cis": "paper", "overrides": ["cis.exposure_us=-1"]}, "exposure_us"),
        ({"cis": "paper", "overrides": ["exposure_us=1"]}, r"did you mean cis\.exposure_us"),
        ({"pictures": "png"}, "expected a frame camera"),
        ({"overrides": ["cis.exposure_us=2000"]}, r"cis\.exposure_us=2000': expected a frame camera"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        convert(CLIP, tmp_path / "out", **(OPTIONS | changed))
    assert not (tmp_path / "out").exists()


def test_a_camera_beside_the_video_is_refused_without_a_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """However large it is: a look takes 16 bytes a pixel, and more."""
    monkeypatch.setattr("vid2ev.seen.sight.Views", pytest.fail)
    around = rig(size=(8192, 4096), translation_mm=(15.0, 0.0, 0.0))
    with pytest.raises(UsageError, match=r"camera right stands beside .* add --depth"):
        Recipe.of(CLIP, rig=around)


@pytest.mark.parametrize(
    ("camera", "blind"),
    [
        ({"translation_mm": (15.0, 0.0, 0.0)}, False),
        ({"translation_mm": (0.0, 0.0, 2500.0)}, True),  # beyond the plane
        ({"translation_mm": (15.0, 0.0, 0.0), "rotation_deg": (0.0, 120.0, 0.0)}, True),
        ({"rotation_deg": (0.0, 59.0, 0.0)}, False),  # a column or two
        ({"rotation_deg": (0.0, 61.0, 0.0)}, True),
    ],
)
def test_a_camera_that_sees_nothing_of_the_video_says_so(tmp_path: Path, camera: dict[str, Any], blind: bool) -> None:
    depth = "plane:2" if "translation_mm" in camera else None
    made = convert(CLIP, tmp_path / "out", rig=rig(size=(256, 192), **camera), depth=depth, preview=False, **OPTIONS)
    said = {
        name: any("sees nothing of the video" in text for text in each["warnings"])
        for name, each in made["results"].items()
    }
    assert said == {"left": False, "right": blind, "aps": False}


@pytest.mark.parametrize(
    ("names", "added"), [(["dvs"], "cis"), (["cis"], "cis_2"), (["CIS"], "cis_2"), (["cis", "cis_2", "a"], "cis_3")]
)
def test_a_frame_camera_that_is_added_has_a_name_of_its_own(names: list[str], added: str) -> None:
    around = Rig(cameras=tuple(Camera(name=name, kind="dvs") for name in names))
    recipe = Recipe.of(CLIP, rig=around, frame_camera=True, cis="phone")
    assert [(mount.name, mount.kind) for mount in recipe.mounts] == [*((name, "dvs") for name in names), (added, "cis")]


def test_a_rig_without_a_name_is_not_taken_for_none(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="give a rig file"):
        convert(CLIP, tmp_path / "out", rig="", **OPTIONS)


def test_truth_lies_beside_what_each_camera_sends(tmp_path: Path) -> None:
    around = rig(translation_mm=(100.0, 0.0, 0.0), clock_offset_us=7)
    truth = ["depth,mask", "map", "poses"]
    convert(CLIP, tmp_path / "out", rig=around, depth="plane:2", truth=truth, truth_rate_hz=20, **OPTIONS)
    right = tmp_path / "out" / "right" / "truth"
    assert np.loadtxt(right / "timestamps.txt").tolist() == [7, 50_007, 100_007, 150_007, 200_007]
    t_ns, positions_m, quaternions = read_poses(right / "poses.txt")
    assert t_ns.tolist() == [7000, 50_007_000, 100_007_000, 150_007_000, 200_007_000]
    np.testing.assert_allclose(positions_m, [[0.1, 0, 0]] * 5)
    np.testing.assert_array_equal(quaternions, [[0, 0, 0, 1]] * 5)
    np.testing.assert_array_equal(read_depth(right / "depth" / "000004.npy"), np.full((48, 64), 2, np.float32))
    disparity = 32 / np.tan(np.radians(30)) * 0.1 / 2
    here = np.stack(np.meshgrid(np.arange(64), np.arange(48)), axis=-1)
    shift = read_pixel_map(right / "map_left" / "000002.npz") - here
    np.testing.assert_allclose(shift, np.broadcast_to([disparity, 0], shift.shape), atol=1e-4)
    mask = read_mask(right / "mask" / "000001.png")
    assert mask[:, : 63 - int(disparity)].all() and not mask[:, 64 - int(disparity) :].any()
    assert read_mask(tmp_path / "out" / "left" / "truth" / "mask" / "000001.png").all()


@pytest.mark.parametrize("video", [CLIP, "scene:parallax,seed=4,scene.duration_s=0.05,size=48x36"])
def test_a_map_to_other_cameras_needs_some(tmp_path: Path, video: str) -> None:
    depth = "plane:2" if video == CLIP else None
    with pytest.raises(UsageError, match="truth 'map' is of pixels in other cameras, and there is one"):
        Recipe.of(video, depth=depth, truth="depth,map")
    assert Recipe.of(video, depth=depth, truth="depth,map", frame_camera=True).truth is not None


def test_the_truth_of_a_scene_is_that_of_its_world(tmp_path: Path) -> None:
    scene = "scene:parallax,seed=4,scene.duration_s=0.05,size=48x36"
    around = rig(translation_mm=(15.0, 0.0, 0.0), size=(32, 24))
    manifest = convert(scene, tmp_path / "out", rig=around, truth="depth,flow,poses", truth_rate_hz=40, **OPTIONS)
    assert manifest["upsampling"]["method"] == "none" and manifest["results"]["right"]["counts"]["events"] > 0
    source = open_source(scene)
    assert isinstance(source, SceneSource)
    world = source.world
    stamps_us = np.loadtxt(tmp_path / "out" / "right" / "truth" / "timestamps.txt", dtype=np.int64)
    assert len(stamps_us) == 3 and stamps_us[0] == 0
    right = around.resolved((48, 36), world.intrinsics).viewpoints[1]
    for name, lens, pose in (("left", world.intrinsics, IDENTITY), ("right", right.intrinsics, right.pose)):
        folder = tmp_path / "out" / name / "truth"
        t_ns, positions_m, _ = read_poses(folder / "poses.txt")
        assert (t_ns // 1000).tolist() == stamps_us.tolist()
        picture = world.render(int(t_ns[1]), lens, pose)
        np.testing.assert_array_equal(read_depth(folder / "depth" / "000001.npy"), picture.depth)
        np.testing.assert_allclose(positions_m[1], (world.camera_pose(int(t_ns[1])) @ pose).translation_m)
        flow = world.flow(int(t_ns[1]), int(t_ns[2]), picture, lens, pose).shift
        np.testing.assert_array_equal(read_flow(folder / "flow" / "000001.npz"), flow)
        assert not (folder / "flow" / "000002.npz").exists()


@pytest.mark.parametrize(
    "edit",
    [
        {"size": (24, 12)},
        {"crop": "24x18+6+9"},
        {"slowdown": 3},
        {"start": 0.01, "stop": 0.04, "slowdown": 0.5, "crop": "24x18+6+9", "size": "12x18!"},
    ],
    ids=["size", "crop", "slowdown", "all"],
)
def test_the_truth_of_what_is_left_of_a_scene_is_that_of_its_world(tmp_path: Path, edit: dict[str, Any]) -> None:
    scene, options = "scene:parallax,seed=4,scene.duration_s=0.05,size=48x36", OPTIONS | edit
    del options["upsample"]
    convert(scene, tmp_path / "plain", **options)
    kinds = ("depth", "flow", "mask", "poses")
    convert(scene, tmp_path / "out", truth=kinds, truth_rate_hz=40 * edit.get("slowdown", 1), **options)
    assert columns(tmp_path / "out") == columns(tmp_path / "plain")
    recipe = Recipe.of(scene, **options_of(options))
    world, lens = open_source(scene).world, recipe.mounts[0].intrinsics  # type: ignore[attr-defined]
    folder = tmp_path / "out/truth"
    assert json.loads((folder / "intrinsics.json").read_text()) == lens.model_dump(mode="json")
    t_ns, positions_m, _ = read_poses(folder / "poses.txt")
    assert len(t_ns) >= 2 and set(t_ns.tolist()) <= {frame.t_ns for frame in recipe.source.frames()}
    instants_ns = np.array([frame.t_ns for frame in open_source(scene).frames()])
    at_ns = [int(instants_ns[np.abs(instants_ns - t * edit.get("slowdown", 1)).argmin()]) for t in t_ns.tolist()]
    for number, here_ns in enumerate(at_ns):
        picture = world.render(here_ns, lens)
        np.testing.assert_array_equal(read_depth(folder / f"depth/{number:06d}.npy"), picture.depth)
        np.testing.assert_allclose(positions_m[number], world.camera_pose(here_ns).translation_m)
        if number + 1 < len(at_ns):
            flow = world.flow(here_ns, at_ns[number + 1], picture, lens).shift
            np.testing.assert_array_equal(read_flow(folder / f"flow/{number:06d}.npz"), flow)


def test_a_scene_brings_its_own_rig(tmp_path: Path) -> None:
    scene = "scene:close-object,scene.duration_s=0.01,size=32x24"
    manifest = convert(scene, tmp_path / "out", **OPTIONS)
    (frames, events) = sorted(manifest["cameras"], key=lambda name: manifest["cameras"][name]["kind"])
    poses = {camera["name"]: camera["translation_m"] for camera in manifest["rig"]["cameras"]}
    assert np.hypot(*(np.subtract(poses[frames], poses[events])[:2])) == pytest.approx(0.015)
    with pytest.raises(UsageError, match="leave --depth out"):
        convert(scene, tmp_path / "other", depth="plane:2", **OPTIONS)


@pytest.mark.parametrize(
    ("edit", "focal_px", "centre_px"),
    [
        ({"size": (16, 12)}, 0.5, (7.5, 5.5)),
        ({"crop": "16x12+4+6"}, 1.0, (11.5, 5.5)),
        ({"slowdown": 2.0}, 1.0, (15.5, 11.5)),
    ],
)
def test_what_is_left_of_a_scene_is_seen_through_its_lens(
    edit: dict[str, Any], focal_px: float, centre_px: tuple[float, float]
) -> None:
    scene = "scene:room,scene.duration_s=0.01,size=32x24"
    whole, part = (Recipe.of(scene, frame_camera=True, **edits).rig for edits in ({}, edit))
    assert not part.source_assumed
    assert part.source.focal_px == pytest.approx([focal_px * each for each in whole.source.focal_px])
    assert part.source.centre_px == pytest.approx(centre_px)


@pytest.mark.parametrize(
    ("sensor", "changes", "sentence"),
    [
        ("mine.toml", [], r"rig.toml: camera 'left': Sensor file \S*mine.toml does not exist"),
        ("papr", [], r"rig.toml: camera 'left': Sensor 'papr' is not a preset \(did you mean paper\?\)"),
        ("paper", ["threshold_on=-1"], "^threshold_on = -1 in sensor paper is impossible"),
    ],
)
def test_a_sensor_that_cannot_be_is_that_of_a_camera_of_a_file(
    sensor: str, changes: list[str], sentence: str, tmp_path: Path
) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(f"[[camera]]\nname = 'left'\nkind = 'dvs'\nsensor = '{sensor}'\n")
    with pytest.raises(UsageError, match=sentence):
        Recipe.of(CLIP, overrides=changes, rig=file)


@pytest.mark.parametrize(
    ("sensor", "changes", "sentence"),
    [
        ("paper", [], r"rig.toml: camera 'left': Key 'threshold_onn' in sensor paper is unknown"),
        ("papr", [], "^Sensor 'papr' is not a preset"),
        ("papr", ["threshold_on=-1"], "^Sensor 'papr' is not a preset"),
    ],
)
def test_what_a_file_changes_in_the_sensor_of_the_recording_is_its_own_too(
    sensor: str, changes: list[str], sentence: str, tmp_path: Path
) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("[[camera]]\nname = 'left'\nkind = 'dvs'\nset = { threshold_onn = 0.2 }\n")
    with pytest.raises(UsageError, match=sentence):
        Recipe.of(CLIP, sensor, changes, rig=file)


@pytest.mark.parametrize(
    ("scene", "options"), [("scene:close-object", {}), ("scene:flicker", {"rig": rig(fov_deg=30)})]
)
def test_a_scene_that_cannot_be_rendered_for_its_cameras_is_refused_before_its_first_frame(
    scene: str, options: dict[str, Any]
) -> None:
    with pytest.raises(UsageError, match="a rig sees all of a scene: leave --crop, --size"):
        Recipe.of(scene, size="64x48", **options)
    Recipe.of(scene, stop=0.1, **options)
    Recipe.of("scene:flicker", size="64x48")  # (by one camera, where the scene's own is)


def test_other_depth_is_another_recording(tmp_path: Path) -> None:
    np.save(tmp_path / "depth.npy", np.full((48, 64), 2, np.float32))
    options = OPTIONS | {"rig": rig(translation_mm=(40.0, 0.0, 0.0)), "depth": f"{tmp_path / 'depth.npy'},scale=1"}
    made = convert(CLIP, tmp_path / "out", **options)
    assert convert(CLIP, tmp_path / "out", resume=True, **options) == made
    np.save(tmp_path / "depth.npy", np.full((48, 64), 3, np.float32))
    with pytest.raises(UsageError, match="was begun with"):
        convert(CLIP, tmp_path / "out", resume=True, **options)


def test_another_seed_is_another_recording_of_a_rig(tmp_path: Path) -> None:
    options = OPTIONS | {"rig": rig()}
    made = convert(CLIP, tmp_path / "out", **options)
    assert convert(CLIP, tmp_path / "out", resume=True, **options) == made
    with pytest.raises(UsageError, match="was begun with seed = 3, not 4"):
        convert(CLIP, tmp_path / "out", resume=True, **options | {"seed": 4})


def test_changes_to_sensors_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="'exposure_us=5': expected an event camera to change; keys of frame sensors"):
        convert(CLIP, tmp_path / "out", rig=FRAMES, overrides=["exposure_us=5"], **OPTIONS)
    with pytest.raises(UsageError, match="expected a list of texts"):
        convert(CLIP, tmp_path / "out", overrides="threshold_on=0.2", **OPTIONS)


@pytest.mark.parametrize(
    ("asked", "name"),
    [({"bayer": "RGGB"}, "bayer"), ({"labels": True}, "labels"), ({"frames": "npz"}, "frames of events"),
     ({"probe": ["5,5"]}, "probe"), ({"noise_maps": True}, "noise_maps"), ({"formats": "csv,dat"}, "format csv, dat")],
)  # fmt: skip
def test_what_is_of_events_alone_is_refused_where_no_camera_sends_any(
    tmp_path: Path, asked: dict[str, Any], name: str
) -> None:
    with pytest.raises(UsageError, match=f"^{name} without an event camera: .* leave {name} out"):
        convert(CLIP, tmp_path / "out", rig=FRAMES, **asked, **OPTIONS)
    assert not (tmp_path / "out").exists()


def test_a_seed_that_was_drawn_is_that_of_the_rig_when_it_is_taken_up(tmp_path: Path) -> None:
    options = OPTIONS | {"rig": rig(), "seed": None}
    with pytest.raises(Paused):
        convert(CLIP, tmp_path / "out", piece=1, pause=lambda: True, **options)
    made = convert(CLIP, tmp_path / "out", resume=True, **options)
    whole = convert(CLIP, tmp_path / "whole", **options | {"seed": made["seed"]})
    assert columns(tmp_path / "out" / "left") == columns(tmp_path / "whole" / "left")
    assert made["seed"] == whole["seed"] != convert(CLIP, tmp_path / "other", **options)["seed"]


def test_frames_are_asked_for_beside_any_rig(tmp_path: Path) -> None:
    events = Rig(cameras=(Camera(name="left", kind="dvs"),))
    manifest = convert(CLIP, tmp_path / "one", rig=events, frame_camera=True, **OPTIONS)
    assert {name: camera["kind"] for name, camera in manifest["cameras"].items()} == {"left": "dvs", "cis": "cis"}
    manifest = convert(CLIP, tmp_path / "other", rig=rig(), frame_camera=True, **OPTIONS)
    assert list(manifest["cameras"]) == ["left", "right", "aps"]
    assert list(convert(CLIP, tmp_path / "plain", frame_camera=True, **OPTIONS)["cameras"]) == ["dvs", "cis"]


def test_codes_of_a_sensor_are_not_taken_for_pictures(tmp_path: Path) -> None:
    convert(CLIP, tmp_path / "out", frame_camera=True, pictures="raw,png", **OPTIONS)
    with pytest.raises(UsageError, match="codes of a sensor's ADC"):
        convert(tmp_path / "out" / "cis" / "raw", tmp_path / "again", **OPTIONS)
    with pytest.raises(UsageError, match=r"out/cis/frames"):
        convert(tmp_path / "out" / "cis", tmp_path / "again", **OPTIONS)
    again = convert(tmp_path / "out" / "cis" / "frames", tmp_path / "again", **OPTIONS)
    assert again["counts"]["frames"] == 6
    for folder, message in ((tmp_path / "out", "cameras cis, dvs"), (tmp_path / "out" / "cis", "frames and no events")):
        with pytest.raises(UsageError, match=message):
            next(read_events(folder))


def test_a_recording_does_not_take_the_place_of_what_it_is_made_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    convert(CLIP, tmp_path / "out", frame_camera=True, pictures="png,mp4", **OPTIONS)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    monkeypatch.chdir(tmp_path)
    for source in (Path("out/cis/frames"), tmp_path / "out" / "cis" / "frames.mp4"):
        for make in (convert, lambda *a, **b: convert_split(str(a[0]), a[1], "tiles", 2, list, **b)):
            with pytest.raises(UsageError, match=f"out holds what it is to be made of, {source}; choose another"):
                make(source, Path("out"), overwrite=True, **OPTIONS)
        for more in (["--dry-run"], ["--budget", "vR=1"]):
            said = CliRunner().invoke(main, ["convert", str(source), "-o", "out", "--overwrite", *more])
            assert said.exit_code == 2 and "out holds what it is to be made of" in said.stderr, said.output
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    assert convert("out/cis/frames", Path("again"), overwrite=True, **OPTIONS)["counts"]["frames"] == 6


def test_the_folder_that_one_is_in_is_what_its_own_name_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    convert(CLIP, tmp_path / "out", "ideal", ["cis.gamma=2.2"], rig=rig(), pictures="raw,png", **OPTIONS)
    for kind in ("frames", "raw"):
        folder = tmp_path / "out" / "aps" / kind
        named = open_source(folder)
        monkeypatch.chdir(folder)
        here = open_source(".")
        assert here.describe() | {"path": ""} == named.describe() | {"path": ""}
        assert here.taken_by == named.taken_by is not None
        assert Recipe.of(".", transfer="linear").describe() == Recipe.of(folder, transfer="linear").describe()
    with pytest.raises(UsageError, match="codes of a sensor's ADC"):
        convert(".", tmp_path / "again", **OPTIONS)
    assert "codes     of a sensor's ADC" in CliRunner().invoke(main, ["info", "."]).stdout


def test_codes_and_pictures_of_a_frame_camera_are_read_by_its_curve(tmp_path: Path) -> None:
    """Codes of an ADC are linear; those of 8 bits are as `gamma` says, and the light is what it was."""
    for gamma in ("srgb", "2.2"):
        out = tmp_path / gamma
        convert(CLIP, out, "ideal", [f"cis.gamma={gamma}"], cis="ideal", pictures="raw,png,mp4", **OPTIONS)
        said = json.loads(CliRunner().invoke(main, ["info", str(out / "cis" / "raw"), "--json"]).stdout)
        assert said["transfer"] == "linear"
        assert "codes     of a sensor's ADC" in CliRunner().invoke(main, ["info", str(out / "cis" / "raw")]).stdout
    places = [(gamma, kind) for gamma in ("srgb", "2.2") for kind in ("frames", "raw", "frames.mp4")]
    lights = [next(open_source(tmp_path / gamma / "cis" / kind).frames()).light for gamma, kind in places]
    assert np.ptp(lights[0]) > 0.4 and np.array(lights) == pytest.approx(np.array([lights[0]] * 6), abs=0.02)


@pytest.mark.parametrize("known", [True, False])
def test_frames_of_a_recording_are_seen_through_the_lens_of_their_camera(tmp_path: Path, known: bool) -> None:
    """Where that is known, not guessed; whether they are pictures or codes, and with or without truth."""
    taken = Source(fov_deg=80.0) if known else Source()
    cameras = Rig(source=taken, cameras=(Camera(name="aps", kind="cis", size=(32, 24)),))
    convert(CLIP, tmp_path / "out", rig=cameras, pictures="raw,png", **OPTIONS)
    for kind in ("frames", "raw"):
        found = Recipe.of(tmp_path / "out" / "aps" / kind, frame_camera=True, transfer="linear").rig
        assert found.source_assumed != known and found.source.size == (32, 24)
        assert found.source.fov_deg == pytest.approx(80 if known else 60)


def test_frames_are_seen_through_the_lens_that_their_camera_states_whatever_the_video_was_guessed_to_see(
    tmp_path: Path,
) -> None:
    bent = {"distortion_model": "radtan", "distortion": (-0.2, 0.05, 0.0, 0.0)}
    stated: tuple[dict[str, Any], ...] = ({"fov_deg": 50.0}, {"focal_px": (20.0, 21.0)}, bent)
    cameras = [Camera(name=f"c{k}", kind="cis", size=(32, 24), **lens) for k, lens in enumerate(stated)]
    convert(CLIP, tmp_path / "out", rig=Rig(cameras=tuple(cameras)), pictures="png", **OPTIONS)
    for camera in json.loads((tmp_path / "out/manifest.json").read_text())["rig"]["cameras"]:
        found = Recipe.of(tmp_path / "out" / camera["name"] / "frames", frame_camera=True).rig
        assert not found.source_assumed
        assert found.source.model_dump(mode="json") == camera["intrinsics"]


def test_a_camera_with_finer_pixels_sees_a_scene_more_often() -> None:
    scene = "scene:parallax,seed=4,scene.duration_s=0.3,size=48x36,scene.min_fps=1"
    alone = Recipe.of(scene).source.frames_expected
    finer = Recipe.of(scene, rig=rig(size=(192, 144))).source.frames_expected
    coarser = Recipe.of(scene, rig=rig(size=(24, 18))).source.frames_expected
    assert alone is not None and finer is not None and coarser == alone
    assert 3.5 * (alone - 1) < finer - 1 < 4.5 * (alone - 1)
