"""What is said to Blender and what comes back, without Blender: a plain renderer stands in for it."""

from __future__ import annotations

import ast
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from vid2ev.commands import Commands
from vid2ev.commands.scene import scene
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.held import Held
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.scenes.blender.corners import corners_of
from vid2ev.scenes.blender.program import SCRIPT, VARIABLE, command_of, find_blender
from vid2ev.scenes.blender.renderer import Cycles, render_with_blender, renderer_beside
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Kind, Lamp, Mesh, Shape, Snapshot, Surface, Texture, Thing
from vid2ev.scenes.world import World

pytest.importorskip("OpenEXR", reason="needs the package OpenEXR")

STAND_IN = Path(__file__).with_name("blender_stand_in.py")
ODD = Intrinsics(size=(24, 18), focal_px=(22.0, 27.0), centre_px=(13.2, 7.9))
CLOSE = ODD.model_copy(update={"focal_px": (300.0, 330.0)})
CAMERA = Pose.of((10, -25, 15), (0.3, -0.2, 0.1))
Stand = Callable[..., Path]


@pytest.fixture
def stand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stand:
    """Puts a stand-in in Blender's place, and gives the diary of what it does."""

    def put(mode: str = "well") -> Path:
        program, diary = tmp_path / "bin" / "blender", tmp_path / "diary"
        program.parent.mkdir(exist_ok=True)
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{STAND_IN}" "{diary}" {mode} "$@"\n')
        program.chmod(0o755)
        diary.write_text("")
        monkeypatch.setenv(VARIABLE, str(program))
        return diary

    return put


def there(kind: Kind, mesh: Mesh | None = None, surface: Surface | None = None, name: str = "thing") -> Thing:
    shape = Shape(kind, (1.1, 0.8, 0.6), mesh)
    return Thing(name, shape, surface or Surface(), CAMERA @ Pose.of((40, 25, -10), (0.1, 0, 1.8)))


def clouds(height: int, width: int) -> Texture:
    return Texture(np.random.default_rng(height).random((height, width, 3)))


def pyramid() -> Mesh:
    corners = np.array([[0.5, 0, -0.3], [-0.4, 0.4, -0.3], [-0.4, -0.4, -0.3], [0, 0, 0.5]])
    return Mesh(
        corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]), uv=np.array([[0, 0], [3, 0], [0, 3], [1, 1]])
    )


@pytest.mark.parametrize("kind", ["plane", "box", "mesh"])
@pytest.mark.parametrize("repeat", [(1.0, 1.0), (3.0, 1.0), (0.5, 2.5), (-1.0, -2.5), (-3.0, -0.5)])
def test_what_is_written_is_the_scene(stand: Stand, kind: Kind, repeat: tuple[float, float]) -> None:
    stand()
    surface = Surface(clouds(3, 2), (0.5, 1.0, 2.0), repeat, emission=0.25)
    snapshot = Snapshot([there(kind, pyramid() if kind == "mesh" else None, surface)], [Lamp("ambient", (1, 0.5, 2))])
    with Cycles() as cycles:
        pairs = [(render(snapshot, lens, CAMERA, samples=1), cycles(snapshot, lens, CAMERA)) for lens in (ODD, CLOSE)]
    for ours, theirs in pairs:
        assert np.array_equal(ours.thing, theirs.thing)
        assert np.allclose(ours.depth, theirs.depth, rtol=1e-6)
        assert np.array_equal(np.isinf(theirs.depth), theirs.thing < 0)
    # (from close up: texels are larger than pixels, so there is nothing to filter)
    ours, theirs = pairs[1]
    assert (ours.thing >= 0).any() and np.ptp(ours.light) > 0.1
    assert np.allclose(ours.light, theirs.light, rtol=1e-3, atol=1e-3)


def test_things_that_share_a_surface_keep_their_order(stand: Stand) -> None:
    stand()
    things = [
        Thing(f"{k}", Shape("plane", (1.0 + k, 2.0, 0)), pose=CAMERA @ Pose.of((0, 20, 0), (0.2 * k, 0, 2)))
        for k in range(3)
    ]
    snapshot = Snapshot(things)
    with Cycles() as cycles:
        theirs = cycles(snapshot, ODD, CAMERA)
    ours = render(snapshot, ODD, CAMERA, samples=1)
    assert np.array_equal(ours.thing, theirs.thing)
    assert np.allclose(ours.depth, theirs.depth, rtol=1e-6)


def test_light_adds_up_lamp_by_lamp(stand: Stand) -> None:
    diary = stand()
    lamps = [
        Lamp("ambient", (0.5, 0.5, 0.5)),
        Lamp("sun", (1.0, 2.0, 3.0)),
        Lamp("point", (0.25, 0.0, 0.0), position_m=(1, 2, 3)),
        Lamp("point", (0.0, 0.0, 0.0)),
    ]
    background = Texture(np.full((1, 1, 3), 0.125, np.float32))
    snapshot = Snapshot([there("plane")], lamps, environment=background, environment_gain=2.0)
    with Cycles() as cycles:
        picture = cycles(snapshot, ODD, CAMERA)
    seen = picture.thing >= 0
    assert np.allclose(picture.light[seen], [0.5 + 0.25 + 1.25, 0.5 + 0.25 + 2, 0.5 + 0.25 + 3])
    assert np.allclose(picture.light[~seen], [0.25 + 1.25, 0.25 + 2, 0.25 + 3])
    assert diary.read_text().split() == ["started", "geometry", "light-0", "light-1"]  # (a dark lamp has no pass)


def test_a_picture_of_the_sky_has_a_pass_of_its_own(stand: Stand, tmp_path: Path) -> None:
    stand()
    around = clouds(4, 8)
    with Cycles(folder=tmp_path / "kept") as cycles:
        cycles(Snapshot([there("plane")], [Lamp("sun")], environment=around, environment_gain=3.0), ODD, CAMERA)
    (request,) = (json.loads(path.read_text()) for path in (tmp_path / "kept").glob("*.json"))
    assert [(one["around"], one["lamps"]) for one in request["passes"]] == [(False, []), (True, []), (False, [0])]
    assert request["things"][0]["light"] == [0.0, 0.0, 0.0]
    # seen from a camera that is turned, the sky is turned back
    assert np.allclose(request["sky"]["turn"], CAMERA.rotation)
    assert np.array_equal(np.load(tmp_path / "kept" / request["sky"]["texture"]), around.pixels)


def test_what_is_rendered_is_not_rendered_again(stand: Stand, tmp_path: Path) -> None:
    diary = stand()
    snapshot = Snapshot([there("box")], [Lamp("sun"), Lamp("sun", (0.5, 0.5, 0.5))])
    with Cycles(folder=tmp_path / "kept") as cycles:
        first = cycles(snapshot, ODD, CAMERA)
    assert diary.read_text().split() == ["started", "geometry", "light-0", "light-1"]
    with Cycles(folder=tmp_path / "kept") as cycles:
        again = cycles(snapshot, ODD, CAMERA)
    assert diary.read_text().count("started") == 1
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    next((tmp_path / "kept").glob("*.light-1.exr")).unlink()
    with Cycles(folder=tmp_path / "kept") as cycles:
        cycles(snapshot, ODD, CAMERA)
        cycles(snapshot, ODD, CAMERA @ Pose.of((0, 1, 0)))
    assert diary.read_text().split()[4:] == ["started", "light-1", "geometry", "light-0", "light-1"]
    meshes = list((tmp_path / "kept").glob("*.npz"))
    assert len(meshes) == 1


def test_a_world_at_instants(stand: Stand) -> None:
    stand()
    world = World.of("parallax", 1)
    small = Intrinsics.of_field((12, 9), 60)
    planes = [k for k, thing in enumerate(world.snapshot(0).things) if thing.shape.kind in ("plane", "box")]
    pictures = list(render_with_blender(world, [0, 10**9], intrinsics=small))
    for t_ns, theirs in zip([0, 10**9], pictures, strict=True):
        ours = render(world.snapshot(t_ns), small, world.camera_pose(t_ns), samples=1)
        flat = np.isin(ours.thing, planes)
        assert flat.any()
        assert np.array_equal(ours.thing[flat], theirs.thing[flat])


@pytest.mark.parametrize(
    ("mode", "sentence"),
    [
        ("no-start", "this Blender does not start"),
        ("no-module", "failed: ModuleNotFoundError: No module named 'that'; run it"),
        ("crashes", "failed: SIGKILL; run it"),
        ("dies", "MemoryError: the scene is too large"),
        ("garbage", "not an EXR file that can be read"),
        ("small", "is no picture of 24x18 pixels"),
        ("no-index", "has no channel Object Index.X"),
        ("too-many", "has numbers of things from"),
    ],
)
def test_a_blender_that_fails_is_told_of_in_a_sentence(stand: Stand, mode: str, sentence: str) -> None:
    stand(mode)
    with Cycles() as cycles:
        for _ in range(2):  # (the second time another is begun)
            with pytest.raises(DataError, match=sentence) as caught:
                cycles(Snapshot([there("box")]), ODD, CAMERA)
            assert "\n" not in str(caught.value)


def test_a_blender_that_is_too_old_is_none(stand: Stand) -> None:
    stand("old")
    with Cycles() as cycles, pytest.raises(UsageError, match=r"of version 3\.4\.1; give one of 4\.2 or later"):
        cycles(Snapshot([there("box")]), ODD, CAMERA)


@pytest.mark.parametrize("place", [".", "..", "/"])
def test_a_place_that_has_none_beside_it_is_refused(stand: Stand, place: str) -> None:
    stand()
    with pytest.raises(UsageError, match="cannot be renamed into place"), renderer_beside(Path(place)):
        pass


def test_requests_that_cannot_be_meant(stand: Stand, monkeypatch: pytest.MonkeyPatch) -> None:
    stand()
    bent = ODD.model_copy(update={"model": "radtan", "distortion": (0.1, 0.0, 0.0, 0.0)})
    with Cycles() as cycles, pytest.raises(UsageError, match="no lens with distortion 'radtan'"):
        cycles(Snapshot(), bent, CAMERA)
    with pytest.raises(UsageError, match="0 samples"):
        Cycles(0)
    with pytest.raises(UsageError, match="'nonesuch' is no program"):
        Cycles(program="nonesuch")
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UsageError, match=VARIABLE):
        find_blender()


def test_a_python_will_do() -> None:
    assert command_of(Path("/usr/bin/python3.11")) == ["/usr/bin/python3.11", "-P", str(SCRIPT)]
    assert command_of(Path("/opt/blender"))[-2:] == ["--python", str(SCRIPT)]
    assert "--background" in command_of(Path("/opt/blender"))


def test_the_script_asks_nothing_of_blender_that_it_has_not() -> None:
    nodes = ast.walk(ast.parse(SCRIPT.read_text(encoding="utf-8")))
    named = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    nodes = ast.walk(ast.parse(SCRIPT.read_text(encoding="utf-8")))
    named |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    assert named - {"bpy", "numpy"} <= sys.stdlib_module_names


@pytest.mark.parametrize("kind", ["plane", "box", "sphere", "cylinder"])
def test_corners(kind: Kind) -> None:
    size = np.array([1.2, 0.8, 0.6])
    made = corners_of(Shape(kind, tuple(size)))
    spots = made.vertices[made.triangles]
    across = np.cross(spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0])
    volume = np.einsum("tk,tk->", spots[:, 0], across) / 6  # (of what is closed and counter-clockwise from outside)
    wanted = {
        "plane": 0.0,
        "box": size.prod(),
        "sphere": math.pi / 6 * size.prod(),
        "cylinder": math.pi / 4 * size.prod(),
    }
    assert volume == pytest.approx(wanted[kind], rel=1e-3)
    if kind in ("sphere", "cylinder"):
        assert np.allclose(np.linalg.norm(made.normals, axis=-1), 1)
        solid = np.linalg.norm(across, axis=1) > 1e-9
        facing = np.einsum("tk,tk->t", made.normals[solid].mean(axis=1), across[solid])
        assert (facing > 0.9 * np.linalg.norm(across[solid], axis=1)).all()
    assert made.uv.min() >= 0 and made.uv.max() <= 1
    assert made.colours.shape == (len(made.triangles), 3, 3)


def test_longitude_and_latitude() -> None:
    made = corners_of(Shape("sphere", (1.2, 0.8, 0.6)))
    x, y, z = (made.vertices[made.triangles] / (0.6, 0.4, 0.3)).transpose(2, 0, 1)
    assert np.allclose(made.uv[..., 1], np.arccos(np.clip(-y, -1, 1)) / np.pi, atol=1e-6)
    turns = made.uv[..., 0] - (0.5 + np.arctan2(x, -z) / (2 * np.pi))
    assert np.allclose((turns - np.round(turns))[x**2 + z**2 > 1e-6], 0, atol=1e-6)


class OneCommand(Commands):
    """The command line with this command."""

    def list_commands(self, ctx) -> list[str]:  # type: ignore[no-untyped-def]
        return ["scene"]

    def get_command(self, ctx, cmd_name):  # type: ignore[no-untyped-def]
        return scene


MINE = """
[scene]
duration_s = 0.03
ambient = 0.5
[camera]
size = [24, 18]
[[objects]]
name = "sheet"
kind = "plane"
trajectory = { kind = "straight", position_m = [0, 0, 2], velocity_m_s = [1, 0, 0] }
"""


def vid2ev(*arguments: str) -> Result:
    Path("mine.toml").write_text(MINE)
    many = ["--fps", "100", "--frames", "tiff", "--truth", "depth,flow,poses", "--no-preview"]
    result = CliRunner().invoke(OneCommand("vid2ev"), ["scene", "mine.toml", "-o", "out", *many, *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_the_command(stand: Stand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from vid2ev.recording.depth_files import read_depth
    from vid2ev.recording.flow_files import read_flow

    monkeypatch.chdir(tmp_path)
    stand()
    assert vid2ev().exit_code == 0
    Path("out").rename("embedded")
    made = vid2ev("--renderer", "blender", "--samples", "3")
    assert made.exit_code == 0 and "Blender 5.0 of tests, Cycles: 4 pictures, " in made.stdout
    files = [sorted(path.relative_to(top) for path in Path(top).rglob("*")) for top in ("embedded", "out")]
    assert files[0] == files[1]
    assert not Path("out.cycles").exists()
    for name in ("000000", "000002"):
        pair = [read_depth(Path(top, "depth", f"{name}.npy")) for top in ("embedded", "out")]
        assert np.allclose(*pair, rtol=1e-6)
        shifts = [read_flow(Path(top, "flow", f"{name}.npz")) for top in ("embedded", "out")]
        assert np.allclose(*shifts, atol=1e-4)
    assert "Cycles with 3 samples" in Path("out/scene.toml").read_text().splitlines()[0]
    assert vid2ev("--renderer", "blender", "--samples", "3", "--resume").exit_code == 0
    other = vid2ev("--renderer", "blender", "--samples", "4", "--resume")
    assert other.exit_code == 2 and "was made with other options" in other.stderr


def test_a_command_that_is_interrupted_goes_on(stand: Stand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    diary = stand("dies-later")
    failed = vid2ev("--renderer", "blender")
    assert failed.exit_code == 1 and "MemoryError" in failed.stderr and failed.stderr.count("\n") == 1
    assert not Path("out").exists() and not Path("out.partial").exists()
    assert len(list(Path("out.cycles").glob("*.geometry.exr"))) == 2
    diary = stand()
    assert vid2ev("--renderer", "blender").exit_code == 0
    assert diary.read_text().split().count("geometry") == 2  # (of four frames)
    assert not Path("out.cycles").exists()


@pytest.mark.parametrize("there", [False, True])
def test_what_another_process_renders_for_the_same_place_is_left_alone(
    stand: Stand, there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From its first request on, before there is a picture; where a scene is to be replaced, too."""
    monkeypatch.chdir(tmp_path)
    stand()
    assert not there or vid2ev("--renderer", "blender").exit_code == 0
    request = Path("out.cycles/request.json")
    request.parent.mkdir()
    request.write_text("{}")
    with Held(Path("out.new")):
        second = vid2ev("--renderer", "blender", *["--resume"] * there)
        assert request.exists() and (second.exit_code == 0 if there else "another vid2ev is writing" in second.stderr)
    assert vid2ev("--renderer", "blender", "--resume").exit_code == 0
    assert Path("out").exists() and not Path("out.cycles").exists() and not Path("out.new").exists()


def test_errors_of_the_command(stand: Stand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stand("dies")
    for code, sentence, arguments in (
        (1, "MemoryError", ["--renderer", "blender"]),
        (2, "add --renderer blender", ["--samples", "8"]),
        (2, "add --renderer blender", ["--blender", "blender"]),
        (2, "'nonesuch' is no program", ["--renderer", "blender", "--blender", "nonesuch"]),
    ):
        result = vid2ev(*arguments)
        assert result.exit_code == code and sentence in result.stderr and result.stderr.count("\n") == 1, result.output
        assert sorted(path.name for path in Path().iterdir()) == ["bin", "diary", "mine.toml"]
