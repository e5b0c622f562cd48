"""Rig files: what is written reads back equal, and every way to get one wrong is one sentence."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from drawn_rigs import pair, rigs
from hypothesis import HealthCheck, given, settings

from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.rig.camera import Camera, Rig, Source, default_rig, nearest_rotation
from vid2ev.rig.intrinsics import Framing
from vid2ev.rig.pose import rotation_of
from vid2ev.rig.rig_file import EXAMPLE, read_rig, rig_text, write_rig

CAMERA = "[[camera]]\nname = 'a'\nkind = 'dvs'\n"


def rig_file(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rigs())
def test_a_rig_reads_back_equal(tmp_path: Path, rig: Rig) -> None:
    write_rig(tmp_path / "rig.toml", rig, overwrite=True)
    assert read_rig(tmp_path / "rig.toml", to_use=False) == rig


def test_the_example_is_a_rig_and_explains_every_key() -> None:
    rig, text = read_rig(EXAMPLE), EXAMPLE.read_text()
    assert {camera.kind for camera in rig.cameras} == {"dvs", "cis"}
    events, frames = (camera.pose.translation_m for camera in rig.cameras)
    np.testing.assert_allclose(np.linalg.norm(events - frames), 0.015)
    assert all(re.search(rf"^(# )?{key} = .*#|^(# )?{key} = ", text, re.MULTILINE) for key in Camera.model_fields)


def test_every_line_of_the_example_that_is_switched_off_can_be_switched_on(tmp_path: Path) -> None:
    on = re.sub(r"^# (?=\w+ = )", "", EXAMPLE.read_text(), flags=re.MULTILINE)
    rig = read_rig(rig_file(tmp_path, re.sub(r"^(fov_deg|rotation_deg) = .*\n", "", on, flags=re.MULTILINE)))
    camera, source = rig.cameras[0], rig.source
    unstated = {"fov_deg", "rotation_deg"}  # (which others stand in place of)
    assert {key for key in Camera.model_fields if getattr(camera, key) is None} == unstated
    assert {key for key in Source.model_fields if getattr(source, key) is None} == {"fov_deg"}


def test_poses_are_from_camera_to_rig_in_mm() -> None:
    camera = Camera(name="a", kind="dvs", rotation_deg=(0, 90, 0), translation_mm=(15, 0, 0))
    # (a quarter turn about the axis down looks to the right)
    np.testing.assert_allclose(camera.pose.apply(np.array([0, 0, 1.0])), (1.015, 0, 0), atol=1e-12)
    turned = Camera(name="a", kind="dvs", rotation=tuple(map(tuple, camera.pose.rotation.tolist())))
    np.testing.assert_allclose(turned.pose.rotation, camera.pose.rotation, atol=1e-12)


def test_a_matrix_of_few_digits_becomes_a_rotation() -> None:
    exact = rotation_of(np.array([0.3, -1.0, 0.2]))
    nearest = nearest_rotation(exact.round(4))
    np.testing.assert_allclose(nearest.T @ nearest, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(nearest, exact, atol=1e-4)


def test_what_is_left_out_is_that_of_the_video() -> None:
    rig = Rig(
        source=Source(size=(1280, 720), fov_deg=80.0),
        cameras=(
            Camera(name="same", kind="cis"),
            Camera(name="half", kind="dvs", size=(320, 180)),
            Camera(name="wide", kind="dvs", fov_deg=100.0),
            Camera(name="lens", kind="dvs", distortion_model="radtan", distortion=(0.1, 0, 0, 0)),
        ),
    ).resolved((640, 360))
    same, half, wide, lens = (view.intrinsics for view in rig.viewpoints)
    assert same == rig.source and same.size == (640, 360) and same.fov_deg == pytest.approx(80)
    assert half.size == (320, 180) and half.fov_deg == pytest.approx(80)
    assert wide.size == (640, 360) and wide.fov_deg == pytest.approx(100)
    assert lens.matrix.tolist() == same.matrix.tolist() and lens.distortion == (0.1, 0, 0, 0)
    assert not rig.source_assumed and not rig.viewpoints[0].pose.translation_m.any()


def test_the_field_of_the_video_is_assumed_where_nobody_states_it() -> None:
    rig = default_rig(frames=True).resolved((64, 48))
    assert rig.source_assumed and rig.source.fov_deg == pytest.approx(60)
    assert rig.describe()["source"]["assumed"]
    assert [(view.camera.name, view.camera.sensor) for view in rig.viewpoints] == [("dvs", None), ("cis", None)]
    assert all(view.intrinsics == rig.source for view in rig.viewpoints)
    assert [camera.name for camera in default_rig().cameras] == ["dvs"]


@pytest.mark.parametrize(("model", "distortion"), [("radtan", (-2.0, 0, 0, 0)), ("equidistant", (-5.0, 0, 0, 0))])
def test_a_lens_that_does_not_see_the_field_that_is_assumed_is_refused(model: str, distortion: tuple) -> None:
    """Where it is not stated; whoever took the video may say it, too."""
    cameras = (Camera(name="a", kind="dvs"),)
    rig = Rig(source=Source(distortion_model=model, distortion=distortion), cameras=cameras)
    for framing in (None, Framing((64, 48), (10, 8), (32, 24), (32, 24))):
        with pytest.raises(
            UsageError, match="less than the 60 degrees that are assumed then; state fov_deg or focal_px"
        ):
            rig.resolved((32, 24) if framing else (64, 48), framing=framing)
    taker = Source(size=(64, 48), focal_px=(50.0, 50.0), centre_px=(31.5, 23.5))
    assert rig.around(taker).resolved((64, 48)).source.focal_px == (50, 50)


@pytest.mark.parametrize(
    ("source", "camera", "whose"),
    [
        ({"size": (32, 24), "focal_px": (9e11, 9e11)}, {}, "the source's"),
        ({"size": (128, 96), "focal_px": (1e-12, 1e-12)}, {}, "the source's"),
        ({"focal_px": (9e11, 9e11)}, {"size": (128, 96)}, "camera a's"),
        ({"focal_px": (5.0, 5.0), "centre_px": (-9e11, 0.0)}, {"size": (128, 96)}, "camera a's"),
    ],
)
def test_a_lens_that_no_rig_file_can_state_at_its_size_is_refused(source: dict, camera: dict, whose: str) -> None:
    """The recording could not write its rig.toml in the end, or nobody could read it."""
    rig = Rig(source=Source(**source), cameras=(Camera(name="a", kind="dvs", **camera),))
    with pytest.raises(UsageError, match=f"{whose} lens.* 1e-12 to 1e\\+12 px"):
        rig.resolved((64, 48))


def test_a_lens_of_another_shape_than_the_video_is_refused() -> None:
    rig = Rig(source=Source(size=(1280, 720), fov_deg=80.0), cameras=(Camera(name="a", kind="dvs"),))
    assert rig.resolved((641, 360)).source.size == (641, 360)  # (rounded off)
    with pytest.raises(UsageError, match="1280x720 is of another shape than the video, 640x480"):
        rig.resolved((640, 480))
    assert rig.resolved((640, 361)).source.size == (640, 361)
    with pytest.raises(UsageError, match="640x362"):  # (two rows are not)
        rig.resolved((640, 362))


def test_sensor_files_are_found_beside_the_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "rigs"
    folder.mkdir()
    rig = read_rig(rig_file(folder, CAMERA + "sensor = 'mine.toml'\n"))
    assert rig.cameras[0].sensor == str(folder / "mine.toml")
    monkeypatch.chdir(tmp_path)
    near = read_rig(Path("rigs/rig.toml"))
    assert near.cameras[0].sensor == "rigs/mine.toml"
    write_rig(tmp_path / "moved.toml", near)
    assert read_rig(Path("moved.toml")) == near


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "there is no camera; write a table [[camera]]"),
        ("camera = 3", "there is no camera"),
        (f"cameras = 1\n{CAMERA}", "'cameras' is unknown (did you mean camera?)"),
        (f"source = 1\n{CAMERA}", "[source] is no table"),
        (f"[source]\nfov = 3\n{CAMERA}", "[source]: 'fov' is unknown (did you mean fov_deg?)"),
        ("[[camera]]\nkind = 'dvs'", "camera 1: name is missing"),
        ("[[camera]]\nname = 'a'", "camera 'a': kind is missing (dvs: events; cis: frames)"),
        ("[[camera]]\nname = 'a'\nkind = 'dvx'", "camera 'a': kind = 'dvx' is impossible: it must be 'dvs' or 'cis'"),
        (f"{CAMERA}translation_m = [0, 0, 1]", "'translation_m' is unknown (did you mean translation_mm?)"),
        (f"{CAMERA}threshold_on = 0.2", "; of its sensor they are KEYs in set = { KEY = VALUE }"),
        (f"{CAMERA}size = [0, 480]", "size = [0, 480] is impossible: it must be greater than or equal to 1"),
        (f"{CAMERA}size = [640]", "size = [640] is impossible: it has too few values (width and height [px]"),
        (f"{CAMERA}size = [1, 2, 3]", "size = [1, 2, 3] is impossible: it has too many values"),
        (f"{CAMERA}size = '640x480'", "size = '640x480' is impossible: it must be a list"),
        (f"{CAMERA}size = [640.0, 480]", "it must be a valid integer"),
        (f"{CAMERA}size = [true, 480]", "it must be a valid integer"),
        (f"{CAMERA}fov_deg = '60'", "it must be a valid number"),
        (f"{CAMERA}fov_deg = nan", "fov_deg = nan is impossible: it must be a finite number"),
        (f"{CAMERA}fov_deg = 150\ndistortion_model = 'radtan'\ndistortion = [-3, 0, 0, 0]", "more than this lens sees"),
        (f"{CAMERA}fov_deg = 180", "fov_deg = 180 is impossible: it must be less than or equal to 179"),
        (f"{CAMERA}fov_deg = 60\nfocal_px = [1, 2]", "keep one of them"),
        (f"{CAMERA}centre_px = [1, 2]", "centre_px needs focal_px"),
        (f"{CAMERA}focal_px = [1, 2]", "focal_px needs size"),
        (f"{CAMERA}size = [8, 8]\nfocal_px = [1e-320, 1]", "it must be greater than or equal to"),
        (f"{CAMERA}fov_deg = 179\ndistortion_model = 'radtan'\ndistortion = [0, 0, 0, 0, 1e12]", "1e-12 px or more"),
        (f"{CAMERA}distortion = [1, 2]", "distortion needs distortion_model beside it"),
        (f"{CAMERA}distortion_model = 'fisheye'", "it must be 'none', 'radtan' or 'equidistant'"),
        (f"{CAMERA}distortion_model = 'radtan'", "'radtan' takes 4 or 5 or 8 coefficients"),
        (f"{CAMERA}rotation_deg = [0, 0, inf]", "rotation_deg = [0, 0, inf] is impossible"),
        (f"{CAMERA}rotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "at right angles, as a rotation's are"),
        (f"{CAMERA}rotation = [[1e300, 0, 0], [0, 1, 0], [0, 0, 1]]", "rotation = "),
        (f"{CAMERA}rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nrotation_deg = [0, 0, 0]", "keep one of them"),
        (f"{CAMERA}clock_offset_us = 1.5", "clock_offset_us = 1.5 is impossible: it must be a valid integer"),
        (f"{CAMERA}seed = -1", "seed = -1 is impossible"),
        (f"{CAMERA}sensor = ''", "sensor = '' is impossible: it must not be empty"),
        (CAMERA.replace("'a'", f"'{'a' * 65}'"), "a name is a folder's: up to 64 letters, digits, _ and -"),
        (f"{CAMERA}set = 3", "set = 3 is impossible: it must be a table"),
        (f"{CAMERA}set = {{ a = 2020-01-01 }}", "it must be a table of numbers, texts"),
        (f"{CAMERA}{CAMERA}", "two cameras are called a: give each a name of its own"),
        (f"{CAMERA}{CAMERA.replace('a', 'A')}", "[[cAmerA]]"),
    ],
)
def test_a_bad_rig_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = rig_file(tmp_path, text)
    if "cAmerA" in sentence:
        path.write_text(CAMERA + CAMERA.replace("'a'", "'A'"))
        sentence = "two cameras are called A, as a is on some systems"
    with pytest.raises(UsageError) as refusal:
        read_rig(path)
    said = str(refusal.value)
    assert said.startswith(str(path)) and sentence in said and "\n" not in said


@pytest.mark.parametrize(
    "name", ["", ".", "..", "a/b", "/", "a b", "-a", "_a", "frames", "a.b", "con", "COM1", "truth", "Rig", "x" * 65]
)
def test_names_that_are_no_folders_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match=r"name = .* is impossible"):
        read_rig(rig_file(tmp_path, f"[[camera]]\nname = '{name}'\nkind = 'dvs'\n"))


@pytest.mark.parametrize("text", ["[[camera]\n", "a = ", "\x00", "x = " + "9" * 5000, "[" * 3000])
def test_what_is_no_toml_is_one_sentence(tmp_path: Path, text: str) -> None:
    with pytest.raises(DataError) as refusal:
        read_rig(rig_file(tmp_path, text))
    assert "\n" not in str(refusal.value)


def test_files_that_cannot_be_read_or_written_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "binary.toml", tmp_path):
        with pytest.raises(DataError):
            read_rig(path)
    with pytest.raises(UsageError, match="no such file"):
        read_rig(tmp_path / "none.toml")
    write_rig(tmp_path / "rig.toml", pair())
    with pytest.raises(UsageError, match="--overwrite"):
        write_rig(tmp_path / "rig.toml", pair())
    with pytest.raises(UsageError, match="give a file's name"):
        write_rig(tmp_path, pair(), overwrite=True)
    with pytest.raises(DataError, match="cannot be written"):
        write_rig(tmp_path / "nowhere" / "rig.toml", pair())


def test_damage_to_a_rig_file_is_never_a_traceback(tmp_path: Path) -> None:
    whole = (EXAMPLE.read_text() + rig_text(pair())).encode()
    for number in range(400):
        random = np.random.default_rng(number)
        data = bytearray(whole)
        for _ in range(random.integers(1, 4)):
            at = int(random.integers(len(data)))
            data[at : at + int(random.integers(0, 6))] = random.bytes(int(random.integers(0, 4)))
        (tmp_path / "rig.toml").write_bytes(data)
        try:
            rig = read_rig(tmp_path / "rig.toml")
            rig.resolved(rig.source.size or (64, 48)).describe()
        except Vid2evError as error:
            assert "\n" not in str(error)
