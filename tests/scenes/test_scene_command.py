"""`vid2ev scene`: what it writes, that it is whole or not there, and that `convert` reads it."""

from __future__ import annotations

import itertools
import json
import shutil
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import av
import click
import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image
from scipy.spatial.transform import Rotation

from vid2ev.commands import Commands
from vid2ev.commands.convert import convert
from vid2ev.commands.scene import scene
from vid2ev.recording.flow_files import read_flow
from vid2ev.rig.camera import Camera, Rig, Source
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.scenes import camera_folder
from vid2ev.scenes import folder as folder_module
from vid2ev.scenes.camera_folder import Contents
from vid2ev.scenes.folder import write_scene
from vid2ev.scenes.own_files import with_own_files
from vid2ev.scenes.scene_file import read_scene, scene_names
from vid2ev.scenes.source import SceneSource
from vid2ev.scenes.world import World
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import scene_of
from vid2ev.sources import open_source

QUICK = ["--size", "48x36", "--duration", "0.05", "--fps", "100", "--no-preview"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Both(Commands):
    """The command line with these two commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return ["convert", "scene"]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return {"convert": convert, "scene": scene}.get(cmd_name)


def vid2ev(*arguments: str) -> Result:
    result = CliRunner().invoke(Both("vid2ev"), arguments)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def refused(exit_code: int, sentence: str, *arguments: str) -> None:
    """The error of a command, which must be one line and leave the folder as it was."""
    before = sorted(Path().rglob("*"))
    result = vid2ev("scene", *arguments)
    assert result.exit_code == exit_code, result.output
    line = result.stderr.strip()
    assert line.startswith("error: ") and "\n" not in line and sentence in line, line
    assert sorted(Path().rglob("*")) == before


def test_the_list_names_all_scenes() -> None:
    shown = vid2ev("scene", "list").stdout
    assert all(f"{name} " in shown for name in scene_names())
    assert set(json.loads(vid2ev("scene", "list", "--json").stdout)) == set(scene_names())


def test_a_scene_is_written_with_its_truth() -> None:
    arguments = ["scene", "flying-shapes", "-o", "out", "--seed", "5", "--truth", "depth,flow,poses", *QUICK]
    assert vid2ev(*arguments).exit_code == 0
    out = Path("out")
    world = World.of(out / "scene.toml")
    assert world.scene == read_scene("flying-shapes", ["camera.size=[48, 36]", "duration_s=0.05"]).resolved(5)
    times = [int(line) for line in (out / "timestamps.txt").read_text().splitlines()[1:]]
    assert times == [k * 10**7 for k in range(6)]
    assert sorted(path.name for path in out.glob("*.png")) == [f"{k:06d}.png" for k in range(6)]
    assert len(list((out / "depth").iterdir())) == 6 and len(list((out / "flow").iterdir())) == 5
    picture = world.render(times[2])
    assert np.array_equal(np.load(out / "depth/000002.npy"), picture.depth)
    shift, _ = world.flow(times[2], times[3], picture)
    assert np.array_equal(read_flow(out / "flow/000002.npz"), shift, equal_nan=True)
    poses = np.loadtxt(out / "poses.txt")
    assert poses.shape == (6, 8) and np.allclose(poses[:, 0], 1e-9 * np.array(times), atol=1e-12)
    for row, t_ns in zip(poses, times, strict=True):
        pose = world.camera_pose(t_ns)
        assert np.allclose(row[1:4], pose.translation_m, atol=1e-9)
        assert np.allclose(Rotation.from_quat(row[4:]).as_matrix(), pose.rotation, atol=1e-8)
    assert json.loads((out / "intrinsics.json").read_text())["size"] == [48, 36]


def source_of_a_ball(folder: Path, rig: str, position_m: list[float], velocity_m_s: list[float]) -> SceneSource:
    """A ball on its way, seen by a camera of 32x24 pixels and the cameras of a rig."""
    (folder / "rig.toml").write_text(rig)
    (folder / "scene.toml").write_text(
        '[scene]\nduration_s = 0.1\nmin_fps = 1\nambient = 1\nrig = "rig.toml"\n'
        "[camera]\nsize = [32, 24]\nfocal_px = [24, 24]\n"
        '[[objects]]\nname = "ball"\nkind = "sphere"\n'
        f'trajectory = {{ kind = "straight", position_m = {position_m}, velocity_m_s = {velocity_m_s} }}\n'
    )
    return SceneSource(World.of(folder / "scene.toml"))


def farthest_px(folder: Path) -> float:
    """How far anything moves from one picture of a camera to the next."""
    flows = [read_flow(file) for file in sorted((folder / "flow").iterdir())]
    return max(float(np.nanmax(np.hypot(*np.moveaxis(flow, -1, 0)))) for flow in flows)


def test_instants_suit_the_finest_camera_of_a_rig(tmp_path: Path) -> None:
    rig = (
        '[[camera]]\nname = "coarse"\nkind = "dvs"\n'
        '[[camera]]\nname = "fine"\nkind = "cis"\nsize = [96, 72]\nfocal_px = [72, 72]\n'
    )
    source = source_of_a_ball(tmp_path, rig, [0, 0, 3], [1, 0, 0])
    write_scene(tmp_path / "out", source, Contents(truth=("flow",), preview=False))
    farthest = {name: farthest_px(tmp_path / "out" / name) for name in ("coarse", "fine")}
    assert 0.3 < farthest["fine"] <= 0.5  # (`max_shift_px`)
    assert farthest["coarse"] == pytest.approx(farthest["fine"] / 3, rel=0.1)


def test_instants_suit_cameras_of_a_rig_that_look_elsewhere(tmp_path: Path) -> None:
    rig = '[[camera]]\nname = "back"\nkind = "dvs"\nsize = [32, 24]\nfocal_px = [24, 24]\nrotation_deg = [0, 180, 0]\n'
    source = source_of_a_ball(tmp_path, rig, [0, 0, -3], [4, 0, 0])
    assert len(source.instants) <= 2  # (of the reference camera, before which nothing moves)
    write_scene(tmp_path / "out", source, Contents(truth=("flow",), preview=False))
    assert 0.3 < farthest_px(tmp_path / "out" / "back") <= 0.5
    alone = SceneSource(source.world)
    recipe = Recipe.of(str(tmp_path / "scene.toml"))
    assert len(scene_of(recipe.source).instants) == len(source.instants) > len(alone.instants)


def test_every_camera_of_a_rig_has_its_folder() -> None:
    arguments = ["scene", "close-object", "-o", "out", "--truth", "depth:png,flow:flo,poses", *QUICK]
    assert vid2ev(*arguments).exit_code == 0
    names = {path.name for path in Path("out").iterdir()}
    assert {"scene.toml", "timestamps.txt", "depth", "flow", "000000.png", "dvs", "cis"} <= names
    assert {path.name for path in Path("out/cis").iterdir()} == names - {"scene.toml", "files", "dvs", "cis"}
    assert np.array_equal(cv2.imread("out/000003.png"), cv2.imread("out/dvs/000003.png"))
    left, right = np.loadtxt("out/dvs/poses.txt"), np.loadtxt("out/cis/poses.txt")
    assert np.allclose(np.linalg.norm(left[:, 1:4] - right[:, 1:4], axis=1), 0.015)
    assert {path.suffix for path in Path("out/cis/flow").iterdir()} == {".flo"}
    assert (Path("out/cis/depth/000000.png")).is_file()
    assert vid2ev("convert", "out/cis", "-o", "events", "--upsample", "none", "--sensor", "ideal", "-q").exit_code == 0


@pytest.mark.parametrize(("kind", "error"), [("png", 1 / 255), ("png16", 1 / 65535), ("tiff", 1e-7), ("exr", 1e-7)])
def test_frames_are_read_again_as_they_were_rendered(kind: str, error: float) -> None:
    if kind == "exr":
        pytest.importorskip("OpenEXR")
    assert vid2ev("scene", "low-light", "-o", "out", "--frames", kind, *QUICK).exit_code == 0
    source = open_source("out", colour="rgb")
    rendered = open_source("scene:low-light,size=48x36,duration_s=0.05", fps=100, colour="rgb")
    brightest = 0.0
    for read, frame in zip(source.frames(), rendered.frames(), strict=True):
        assert read.t_ns == frame.t_ns
        light = frame.light if kind in ("tiff", "exr") else np.clip(frame.light, 0, 1)
        assert np.abs(read.light - light).max() <= 1.2 * error
        brightest = max(brightest, float(read.light.max()))
    assert (brightest > 10) == (kind in ("tiff", "exr"))


def test_convert_reads_the_folder_and_many_of_them() -> None:
    fast = ["--size", "48x36", "--duration", "0.03", "--fps", "300"]
    assert vid2ev("scene", "spinning-shapes", "-o", "many", "--count", "2", "--seed", "8", *fast).exit_code == 0
    assert {path.name for path in Path("many").iterdir()} == {"spinning-shapes-0008", "spinning-shapes-0009"}
    assert "preview.mp4" in {path.name for path in Path("many/spinning-shapes-0008").iterdir()}
    result = vid2ev("convert", "many", "-o", "events", "--upsample", "none", "--threads", "1", "--sensor", "ideal")
    assert result.exit_code == 0, result.output
    for name in ("spinning-shapes-0008", "spinning-shapes-0009"):
        manifest = json.loads(Path(f"events/{name}_events/manifest.json").read_text())
        assert manifest["counts"]["frames"] == 10 and manifest["counts"]["events"] > 20
    assert (
        vid2ev(
            "convert", "many/spinning-shapes-0008", "-o", "one", "--upsample", "none", "--sensor", "ideal", "-q"
        ).exit_code
        == 0
    )


def test_convert_sees_the_folder_through_the_lens_that_rendered_it() -> None:
    assert vid2ev("scene", "spinning-shapes", "-o", "out", "--set", "camera.fov_deg=80", *QUICK).exit_code == 0
    lens = Intrinsics.model_validate_json(Path("out/intrinsics.json").read_text())
    assert lens.fov_deg == pytest.approx(80)
    found = Recipe.of("out", frame_camera=True).rig
    assert found.source == lens and not found.source_assumed
    part = Recipe.of("out", frame_camera=True, crop="24x18+10+8", size="48x36", start=0.01, slowdown=2).rig
    assert part.source.focal_px == pytest.approx([2 * each for each in lens.focal_px]) and not part.source_assumed
    assert part.source.centre_px == pytest.approx((2 * 14 - 0.5, 2 * 10 - 0.5))
    stated = Rig(source=Source(fov_deg=50.0), cameras=(Camera(name="left", kind="dvs"),))
    assert Recipe.of("out", rig=stated).rig.source.fov_deg == pytest.approx(50)  # (who says something is believed)
    np.save("disparity.npy", np.full((36, 48), 2.0, np.float32))
    deep = Recipe.of("out", frame_camera=True, depth="disparity.npy,baseline_m=0.1", truth="depth")
    depth = next(deep.source.frames()).depth
    assert depth is not None and depth.min() == pytest.approx(lens.focal_px[0] * 0.1 / 2)


@pytest.mark.parametrize("text", ["", "[" * 9999, '{"fx": 20}', "of others", "another size", "a number too large"])
def test_a_file_of_others_says_nothing_of_the_lens(text: str) -> None:
    Path("clip").mkdir()
    for number in range(2):
        cv2.imwrite(f"clip/{number}.png", np.full((12, 16), 90 * number, np.uint8))
    lens = Intrinsics.of_field((16, 12), 80).model_dump_json()
    said = {"another size": lens.replace("[16,12]", "[16,14]"), "a number too large": lens.replace("7.5", "1e300")}
    Path("clip/intrinsics.json").write_text(said.get(text, text))
    found = Recipe.of("clip", frame_camera=True, fps=30).rig
    assert found.source_assumed and found.source.fov_deg == pytest.approx(60)


def test_a_scene_with_photographs_of_its_own_is_rendered_again_from_its_folder() -> None:
    rng = np.random.default_rng(0)
    Path("own").mkdir()
    for name in ("wall", "sky"):
        cv2.imwrite(f"own/{name}.png", rng.integers(0, 255, (16, 16, 3), np.uint8))
    text = '[scene]\nduration_s = 0.01\nenvironment = "sky.png"\n[camera]\nsize = [16, 12]\n'
    Path("own/scene.toml").write_text(f'{text}[[objects]]\nname = "wall"\nkind = "plane"\ntexture = "wall.png"\n')
    assert vid2ev("scene", "own/scene.toml", "-o", "first", "-q").exit_code == 0
    shutil.rmtree("own")
    Path("first").rename("moved")
    assert vid2ev("scene", "moved/scene.toml", "-o", "second", "-q").exit_code == 0
    assert Path("moved/000000.png").read_bytes() == Path("second/000000.png").read_bytes()


def scene_with_meshes_and_a_rig(folder: Path) -> Path:
    """A scene file whose meshes name pictures and buffers, with a rig that names a sensor."""
    trimesh = pytest.importorskip("trimesh", reason="trimesh reads meshes")
    from trimesh.exchange.gltf import export_gltf

    rng, shape = np.random.default_rng(0), "kind = 'mesh'\ntrajectory = { kind = 'fixed', position_m ="
    (folder / "obj/skins").mkdir(parents=True)
    (folder / "gltf").mkdir()
    cv2.imwrite(str(folder / "obj/skins/skin.png"), rng.integers(0, 255, (16, 16, 3), np.uint8))
    box = trimesh.creation.box()
    skin = Image.open(folder / "obj/skins/skin.png")
    box.visual = trimesh.visual.TextureVisuals(uv=rng.random((len(box.vertices), 2)), image=skin)
    box.export(folder / "obj/box.obj")
    material = folder / "obj/material.mtl"
    material.write_text(material.read_text().replace("material_0.png", "skins/skin.png"))
    for name, content in export_gltf(trimesh.Scene(box)).items():
        (folder / "gltf" / name).write_bytes(content)
    (folder / "sheet.ply").write_text(
        "ply\nformat ascii 1.0\ncomment TextureFile obj/skins/skin.png\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n-1 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    )
    (folder / "mine.toml").write_text("[dvs]\nthreshold_on = 0.3\n")
    (folder / "stereo.toml").write_text("[[camera]]\nname = 'left'\nkind = 'dvs'\nsensor = 'mine.toml'\n")
    scene = folder / "scene.toml"
    scene.write_text(
        "[scene]\nduration_s = 0.01\nambient = 1\nrig = 'stereo.toml'\n[camera]\nsize = [24, 16]\n"
        f"[[objects]]\nname = 'a'\nfile = 'obj/box.obj'\n{shape} [-0.7, 0, 3] }}\n"
        f"[[objects]]\nname = 'b'\nfile = 'gltf/model.gltf'\n{shape} [0.7, 0, 3] }}\n"
        f"[[objects]]\nname = 'c'\nfile = 'sheet.ply'\n{shape} [0, 0, 2] }}\n"
    )
    return scene


def test_a_scene_with_meshes_and_a_rig_is_rendered_and_converted_again_from_its_folder() -> None:
    Path("own").mkdir()
    scene_file = scene_with_meshes_and_a_rig(Path("own"))
    (Path("own/obj/material_0.png")).unlink()
    assert vid2ev("scene", str(scene_file), "-o", "first", "-q").exit_code == 0
    shutil.rmtree("own")
    Path("first").rename("moved")
    assert vid2ev("scene", "moved/scene.toml", "-o", "second", "-q").exit_code == 0
    seen = cv2.imread("moved/000000.png")
    assert np.array_equal(seen, cv2.imread("second/000000.png")) and np.ptp(seen, axis=2).max() > 40  # (their colours)
    assert Recipe.of("second/scene.toml").mounts[0].sensor.spec.threshold_on == 0.3  # type: ignore[union-attr]
    assert vid2ev("scene", "close-object", "-o", "close", *QUICK).exit_code == 0
    assert len(Recipe.of("close/scene.toml").mounts) == 2


def test_a_folder_of_other_files_is_not_taken_for_this_one() -> None:
    Path("own").mkdir()
    arguments = (str(scene_with_meshes_and_a_rig(Path("own"))), "-o", "first", "-q")
    assert vid2ev("scene", *arguments).exit_code == 0
    for name in ("obj/skins/skin.png", "obj/box.obj", "obj/material.mtl", "gltf/model.gltf", "mine.toml", "sheet.ply"):
        file = Path("own", name)
        content = file.read_bytes()
        file.write_bytes(content + b"\n")
        refused(2, "made with other options or files", *arguments, "--resume")
        file.write_bytes(content)
        assert vid2ev("scene", *arguments, "--resume").exit_code == 0


@pytest.mark.parametrize("name", ["a\nb", "a\rb", "a\x01b", "a\udcffb", "aäb"])
def test_a_scene_file_may_have_any_name(name: str) -> None:
    try:
        Path(f"{name}.toml").write_text("[scene]\nduration_s = 0.01\n[camera]\nsize = [4, 3]\n")
    except OSError:
        pytest.skip("this file system has no such names")
    arguments = (f"{name}.toml", "-o", "out", "-q")
    assert vid2ev("scene", *arguments).exit_code == 0
    assert read_scene("out/scene.toml").resolved() == read_scene(f"{name}.toml").resolved()
    assert vid2ev("scene", *arguments, "--resume").exit_code == 0


@pytest.mark.parametrize("there", ["files/1", "files/1.png", "files/1/skin.obj", "files/2"])
def test_no_file_takes_the_place_of_one_that_is_there(there: str) -> None:
    """What a picture is its content says: its name may have no suffix."""
    things = [{"name": name, "texture": name} for name in (there, "/one", "/two.png", "/one")]
    tables, files = with_own_files({"objects": things})
    names = [thing["texture"] for thing in tables["objects"]]
    assert names[0] == there and names[1] == names[3] and len({Path(name).with_suffix("") for name in names}) == 3
    assert files == {names[1]: Path("/one"), names[2]: Path("/two.png")}


def test_a_dry_run_names_files_as_they_are_seen_from_here() -> None:
    Path("own").mkdir()
    scene_file = scene_with_meshes_and_a_rig(Path("own"))
    Path("again.toml").write_text(vid2ev("scene", str(scene_file), "--dry-run").stdout)
    assert str(Path.cwd()) not in Path("again.toml").read_text()
    assert read_scene("again.toml").resolved() == read_scene(scene_file).resolved()
    Path("close.toml").write_text(vid2ev("scene", "close-object", "--dry-run").stdout)
    assert read_scene("close.toml").resolved() == read_scene("close-object").resolved()


def test_the_preview_is_a_film_of_the_scene() -> None:
    options = ["--size", "49x35", "--duration", "0.1", "--fps", "60"]  # (odd sides)
    assert vid2ev("scene", "spinning-shapes", "-o", "out", *options).exit_code == 0
    film = cv2.VideoCapture("out/preview.mp4")
    shown = [film.read()[1] for _ in range(int(film.get(cv2.CAP_PROP_FRAME_COUNT)))]
    assert len(shown) == 4 and shown[0].shape[:2] == (36, 50)  # (the last row and column are there twice)
    whole = np.pad(cv2.imread("out/000000.png"), ((0, 1), (0, 1), (0, 0)), mode="edge").astype(float)
    assert np.abs(shown[0] - whole).mean() < 12


@pytest.mark.parametrize("fps", ["5", "24", "30", "50", "60", "100"])
def test_the_preview_shows_the_newest_picture_at_each_instant(fps: str, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = itertools.count()
    monkeypatch.setattr(camera_folder, "srgb_codes", lambda light: light)
    monkeypatch.setattr(
        camera_folder.Reel,
        "picture",
        lambda *_: (SimpleNamespace(light=np.full((8, 8, 3), 10 * next(counted), np.uint8)), None),
    )
    monkeypatch.setattr(camera_folder, "writer_of", lambda kind: (lambda light, path: None, ".png"))
    options = ["--size", "8x8", "--duration", "0.2", "--fps", fps]
    assert vid2ev("scene", "spinning-shapes", "-o", "out", *options).exit_code == 0
    times_ns = np.loadtxt("out/timestamps.txt")
    with av.open("out/preview.mp4") as film:
        shown = [(frame.time, frame.to_ndarray(format="rgb24").mean() / 10) for frame in film.decode(video=0)]
    newest = [np.searchsorted(times_ns, 1e9 * time_s + 1e9 / 120) - 1 for time_s, _ in shown[:-1]]
    assert [round(float(number)) for _, number in shown] == [*newest, len(times_ns) - 1]


def test_many_scenes_go_on_where_they_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ["scene", "flying-shapes", "-o", "many", "--count", "3", *QUICK]
    write, written = folder_module._write_all, list[Path]()

    def break_down(partial: Path, *rest: object) -> None:
        if len(written) == 1:
            raise KeyboardInterrupt
        written.append(partial)
        write(partial, *rest)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setattr(folder_module, "_write_all", break_down)
        assert vid2ev(*arguments).exit_code == 130
    assert [path.name for path in Path("many").iterdir()] == ["flying-shapes-0000"]
    changed_ns = Path("many/flying-shapes-0000/scene.toml").stat().st_mtime_ns
    refused(2, "--resume leaves it", *arguments[1:])
    result = vid2ev(*arguments, "--resume")
    assert result.exit_code == 0 and "flying-shapes-0000: is there already" in result.stdout
    assert len(list(Path("many").iterdir())) == 3
    assert Path("many/flying-shapes-0000/scene.toml").stat().st_mtime_ns == changed_ns
    refused(2, "made with other options", *arguments[1:], "--resume", "--truth", "none")
    assert vid2ev(*arguments, "--overwrite", "--truth", "none").exit_code == 0
    assert not Path("many/flying-shapes-0002/poses.txt").exists()


@pytest.mark.parametrize("own", [b"[scene]\nduration_s = 0.05\n", b"\xff\xfe[\0s\0"])
@pytest.mark.parametrize("option", ["--overwrite", "--resume"])
def test_a_folder_with_a_scene_file_of_a_persons_own_is_left_alone(own: bytes, option: str) -> None:
    Path("mine").mkdir()
    Path("mine/scene.toml").write_bytes(own)
    Path("mine/photo.jpg").write_text("photo")
    refused(2, "is no rendered scene", "room", "-o", "mine", option, *QUICK)
    assert Path("mine/scene.toml").read_bytes() == own


@pytest.mark.parametrize("frames", ["png16", "tiff", "exr"])
def test_what_was_put_beside_a_rendered_scene_is_not_replaced_with_it(frames: str) -> None:
    if frames == "exr":
        pytest.importorskip("OpenEXR")
    arguments = ["close-object", "-o", "out", "--truth", "depth:png,flow:png,poses", *QUICK[:-1], "--frames", frames]
    for more in ([], ["--overwrite"]):  # (with a folder of each camera of its rig)
        assert vid2ev("scene", *arguments, *more).exit_code == 0
    for name, said in (
        ("notes.txt", "notes.txt"),
        ("events/manifest.json", "events"),
        ("depth/notes.txt", "depth/notes.txt"),
        ("dvs/flow/mine.png", "dvs/flow/mine.png"),
        ("cis/events/manifest.json", "cis/events"),
    ):
        Path("out", name).parent.mkdir(exist_ok=True)
        Path("out", name).write_text("mine")
        refused(2, f"no rendered scene ({said})", *arguments, "--overwrite")
        shutil.rmtree(Path("out", name).parent) if "manifest" in name else Path("out", name).unlink()


@pytest.mark.parametrize("seed", ["0", "4"])
def test_a_seed_that_is_given_counts_more_than_that_of_the_name(seed: str) -> None:
    given, named, both = (
        vid2ev("scene", name, *options, "--dry-run").stdout
        for name, *options in (("room", "--seed", seed), ("room,seed=3",), ("room,seed=3", "--seed", seed))
    )
    assert both == given != named


@pytest.mark.parametrize(("rate", "other"), [("29.97", "30000/1001"), ("100", "100.00001")])
def test_a_folder_of_another_rate_is_not_taken_for_this_one(rate: str, other: str) -> None:
    arguments = ["flying-shapes", "-o", "out", "--size", "8x6", "--duration", "0.05", "--no-preview", "--fps"]
    assert vid2ev("scene", *arguments, rate).exit_code == 0
    refused(2, "made with other options", *arguments, other, "--resume")
    assert "is there already" in vid2ev("scene", *arguments, rate, "--resume").stdout


def test_a_disk_that_is_full_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(folder_module, "_write_all", full)
    refused(1, "out cannot be written: No space left on device", "flying-shapes", "-o", "out", *QUICK)


def test_what_cannot_be_meant_is_one_sentence() -> None:
    refused(2, "did you mean room?", "rooom")
    refused(
        2,
        "truth 'colour': expected some of depth:npy|exr|png, flow:npz|flo|png, poses:txt",
        "room",
        "--truth",
        "colour",
        *QUICK,
    )
    twice = "truth 'depth:exr': depth is to be png as well; give one format of it"  # one of them would be left out
    refused(2, twice, "room", "--truth", "depth:png,depth:exr", *QUICK)
    refused(2, "size 'big': expected WIDTHxHEIGHT", "room", "--size", "big")
    refused(2, "no 'lamb' (did you mean lamp?)", "room", "--set", "lights.lamb.reach_m=3")
    Path("taken").mkdir()
    Path("taken/mine.txt").write_text("mine")
    refused(2, "is no rendered scene", "room", "-o", "taken", "--overwrite", *QUICK)
    for place in (".", "..", "taken/..", "/"):
        refused(2, "cannot be renamed into place; give a folder within it", "room", "-o", place, "--overwrite", *QUICK)
    refused(1, "File name too long", "room", "-o", 300 * "x", *QUICK)
    Path("bad.toml").write_text("[scene]\nduration = 2\n")
    refused(2, "did you mean duration_s?", "bad.toml")
    Path("rig.toml").write_text("[[camera]]\nname = 'left'\nkind = 'dvs'\n")
    refused(2, "rig.toml is a rig file, not a scene; use it with", "rig.toml", "--size", "16x12")


def test_a_dry_run_prints_the_scene_and_does_nothing() -> None:
    result = vid2ev("scene", "parallax", "--dry-run", "--seed", "4")
    Path("again.toml").write_text(result.stdout)
    assert read_scene("again.toml").resolved(0) == read_scene("parallax").resolved(4)
    assert [path.name for path in Path().iterdir()] == ["again.toml"]
    printed = vid2ev("scene", "parallax", "--dry-run", "--seed", "4", "--json").stdout
    assert json.loads(printed) == tomllib.loads(result.stdout)
    for wrong in (["--truth", "banana"], ["--samples", "4"], ["--renderer", "blender", "--blender", "no-such-program"]):
        assert vid2ev("scene", "parallax", "--dry-run", *wrong).exit_code == 2


@pytest.mark.parametrize(
    "name", ["scene:parallax,seed=4,size=64x48,duration_s=0.5", "parallax,seed=4,camera.size=[64,48]"]
)
def test_a_scene_is_named_as_convert_takes_it(name: str) -> None:
    asked = ["parallax", "--seed", "4", "--size", "64x48", "--set", "duration_s=0.5"]
    said = vid2ev("scene", name, "--dry-run", "--set", "duration_s=0.5").stdout
    assert said and said == vid2ev("scene", *asked, "--dry-run").stdout
    for seed in ("5", "0"):  # (what is given goes before what the name says)
        other = vid2ev("scene", *asked, "--seed", seed, "--dry-run").stdout
        assert said != other == vid2ev("scene", name, "--dry-run", "--set", "duration_s=0.5", "--seed", seed).stdout


def test_the_listing_loads_no_renderer() -> None:
    import subprocess

    program = (
        "import sys; from vid2ev.commands.scene import scene; print('numba' in sys.modules, 'numpy' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
    )
    assert done.stdout.split() == ["False", "False"]
