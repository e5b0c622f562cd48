"""Calibration files: what is written reads back, others read it, and files of others are read as they mean it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import dv_processing as dv
import numpy as np
import pytest
import yaml
from drawn_rigs import calibrated_rigs, differences, pair
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError
from vid2ev.rig.calibration import (
    FORMATS,
    UNITS_M,
    calibration_format,
    left_out,
    read_calibration,
    write_calibration,
)
from vid2ev.rig.camera import LATEST_US, Camera, Rig, Source, Viewpoint
from vid2ev.rig.intrinsics import Intrinsics

HELD = {  # coefficients of distortion that a format can hold
    "opencv": {"none": (0,), "radtan": (4, 5, 8), "equidistant": (4,)},
    "dsec": {"none": (0,), "radtan": (4, 5, 8), "equidistant": (4,)},
    "kalibr": {"none": (0,), "radtan": (4,), "equidistant": (4,)},
    "dv": {"none": (0,), "radtan": (4, 5), "equidistant": (4,)},
}
KALIBR = """
cam0:
  camera_model: pinhole
  intrinsics: [461.629, 460.152, 362.680, 246.049]
  distortion_model: radtan
  distortion_coeffs: [-0.27695497, 0.06712482, 0.00087538, 0.00011556]
  T_cam_imu:
  - [0.01779318, 0.99967549,-0.01822936, 0.07008565]
  - [-0.9998017, 0.01795239, 0.00860714,-0.01771023]
  - [0.00893160, 0.01807260, 0.99979678, 0.00399246]
  - [0.0, 0.0, 0.0, 1.0]
  timeshift_cam_imu: -8.121e-05
  rostopic: /cam0/image_raw
  resolution: [752, 480]
cam1:
  camera_model: pinhole
  intrinsics: [833.006, 830.345, 373.850, 253.749]
  distortion_model: equidistant
  distortion_coeffs: [-0.33518750, 0.13211436, 57e-5, 0.00057686]
  T_cn_cnm1:
  - [ 0.99998854, 0.00216014, 0.00427195,-0.11003785]
  - [-0.00221074, 0.99992702, 0.01187697, 0.00045792]
  - [-0.00424598,-0.01188627, 0.99992034,-0.00064487]
  - [0.0, 0.0, 0.0, 1.0]
  resolution: [752, 480]
"""


def views_of(rig: Rig) -> tuple[Viewpoint, ...]:
    return rig.resolved((640, 480)).viewpoints


def projected(view: Viewpoint, rig_points_m: np.ndarray) -> np.ndarray:
    """Pixels [N, 2] of points of the rig, by OpenCV's own projection, which starts from the inverse of a pose."""
    from_rig = view.pose.inverse()
    lens = view.intrinsics
    return cv2.projectPoints(
        rig_points_m,
        cv2.Rodrigues(from_rig.rotation)[0],
        from_rig.translation_m,
        lens.matrix,
        np.array(lens.distortion),
    )[0][:, 0]


@pytest.mark.parametrize("name", FORMATS)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_calibration_reads_back(tmp_path: Path, name: str, data: st.DataObject) -> None:
    rig = data.draw(calibrated_rigs(HELD[name]))
    write_calibration(tmp_path / "calibration", rig, name, overwrite=True)
    found = read_calibration(tmp_path / "calibration")
    assert found.format == name
    turned, moved_m = differences(rig, found.rig)
    assert turned < 1e-9 and moved_m < 1e-9
    keeps = calibration_format(name).keeps
    for ours, theirs in zip(rig.cameras, found.rig.cameras, strict=True):
        assert ours.lens(ours.size or (1, 1)) == theirs.lens(theirs.size or (1, 1))
        assert ours.name == theirs.name
        assert ours.kind == theirs.kind or "kinds" not in keeps
        assert ours.clock_offset_us == theirs.clock_offset_us or "clocks" not in keeps


@pytest.mark.parametrize("name", FORMATS)
def test_poses_count_from_the_first_camera(tmp_path: Path, name: str) -> None:
    moved = [camera.model_copy(update={"size": (64, 48), "fov_deg": 50.0}) for camera in pair().cameras[1:]]
    rig = Rig(cameras=(Camera(name="a", kind="dvs", size=(64, 48), fov_deg=60.0, rotation_deg=(5, 2, 1)), *moved[:1]))
    write_calibration(tmp_path / "calibration", rig, name)
    found = read_calibration(tmp_path / "calibration").rig
    between = [one.cameras[0].pose.inverse() @ one.cameras[1].pose for one in (rig, found)]
    np.testing.assert_allclose(between[0].rotation, between[1].rotation, atol=1e-12)
    np.testing.assert_allclose(between[0].translation_m, between[1].translation_m, atol=1e-12)
    for moved in ({}, {"rotation_deg": (0, 0, 0), "translation_mm": (0, 0, 1)}):
        first = rig.cameras[0].model_copy(update=moved)
        assert "the camera of the video, from which poses counted" in left_out(Rig(cameras=(first,)), name)
    assert left_out(Rig(cameras=(Camera(name="a", kind="dvs"),)), name) == []
    for stated in (Source(fov_deg=90.0), Source(size=(64, 48))):
        assert "[source], the lens of the video" in left_out(Rig(source=stated, cameras=rig.cameras), name)


def test_the_first_camera_is_at_the_origin_of_the_rig_wherever_a_file_has_it(tmp_path: Path) -> None:
    path = tmp_path / "pair.yml"
    write_calibration(path, pair(), "opencv")
    still, moved = "data: [ 0., 0., 0. ]", "data: [ 1., -2., 3. ]"
    assert path.read_text().count(still) == 1
    path.write_text(path.read_text().replace(still, moved))
    first = read_calibration(path).rig.cameras[0].pose
    np.testing.assert_allclose(first.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(first.translation_m, 0, atol=1e-12)


def test_a_unit_may_be_given_where_it_is_the_files_own(tmp_path: Path) -> None:
    (tmp_path / "camchain.yaml").write_text(KALIBR)
    turned, moved_m = differences(*(read_calibration(tmp_path / "camchain.yaml", unit).rig for unit in ("m", None)))
    assert turned == moved_m == 0
    with pytest.raises(UsageError, match="counts in m; leave --unit mm out"):
        read_calibration(tmp_path / "camchain.yaml", "mm")


@pytest.mark.parametrize(("unit", "other"), [("m", "mm"), ("cm", "m"), ("mm", "cm")])
def test_the_unit_that_opencvs_yaml_says_is_that_of_its_translations(tmp_path: Path, unit: str, other: str) -> None:
    path = tmp_path / "pair.yml"
    write_calibration(path, pair(), "opencv")
    path.write_text(path.read_text().replace("unit: m\n", f"unit: {unit}\n"))
    far = [read_calibration(path, said).rig.cameras[1].pose.translation_m for said in (None, unit)]
    wanted = UNITS_M[unit] * (pair().cameras[0].pose.inverse() @ pair().cameras[1].pose).translation_m
    np.testing.assert_allclose(far, [wanted] * 2, atol=1e-12)
    assert not read_calibration(path).notes
    with pytest.raises(UsageError, match=f"counts in {unit}; leave --unit {other} out"):
        read_calibration(path, other)
    path.write_text(path.read_text().replace(f"unit: {unit}\n", "unit: inch\n"))
    with pytest.raises(DataError, match="unit is 'inch', not one of m, cm, mm"):
        read_calibration(path)


def test_a_rig_file_counts_in_mm_whatever_is_asked(tmp_path: Path) -> None:
    write_calibration(tmp_path / "rig.toml", pair(), "rig")
    assert read_calibration(tmp_path / "rig.toml", "mm").rig == pair()
    for unit in ("m", "cm"):
        with pytest.raises(UsageError, match=f"rig.toml counts in mm; leave --unit {unit} out"):
            read_calibration(tmp_path / "rig.toml", unit)


def test_kalibrs_documentation_is_read_as_it_means_it(tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(KALIBR)
    first, second = read_calibration(path).rig.cameras
    assert (first.name, first.kind, second.name) == ("cam0", "cis", "cam1")
    assert first.clock_offset_us == 81  # t_imu = t_cam + shift
    lens = second.intrinsics(Intrinsics.of_field((1, 1)))
    assert lens.size == (752, 480) and lens.focal_px == (833.006, 830.345) and lens.centre_px == (373.85, 253.749)
    assert lens.model == "equidistant" and lens.distortion[2] == 57e-5
    # "takes cam0 to cam1 coordinates": the origin of cam0 is where the last column says, seen from cam1 ...
    seen = second.pose.inverse().apply(first.pose.translation_m)
    np.testing.assert_allclose(seen, (-0.11003785, 0.00045792, -0.00064487), atol=1e-12)
    # ... so that cam1 stands 11 cm to the right of cam0
    np.testing.assert_allclose(second.pose.translation_m, (0.11, 0, 0), atol=2e-3)


def test_kalibrs_topics_say_name_and_kind_however_deep_they_are(tmp_path: Path) -> None:
    for topic, name, kind in (
        ("/dvs/events", "dvs", "dvs"),
        ("/davis/left/events", "left", "dvs"),
        ("/davis/left/image_raw", "left", "cis"),
        ("/robot/head/flir/image_raw", "flir", "cis"),
        ("/davis/left/image_mono", "cam0", "dvs"),  # (nothing that is known)
    ):
        text = KALIBR.replace("rostopic: /cam0/image_raw", f"rostopic: {topic}")
        (tmp_path / "camchain.yaml").write_text(text)
        first = read_calibration(tmp_path / "camchain.yaml").rig.cameras[0]
        assert (first.name, first.kind) == (name, kind)


def test_kalibrs_imu_places_cameras_as_well(tmp_path: Path) -> None:
    write_calibration(tmp_path / "chain.yaml", pair(), "kalibr")
    chain = yaml.safe_load((tmp_path / "chain.yaml").read_text())
    imu = np.array(yaml.safe_load(KALIBR)["cam0"]["T_cam_imu"])
    placed = np.linalg.qr(imu[:3, :3])[0]
    imu[:3, :3] = placed if np.linalg.det(placed) > 0 else -placed
    for camera in chain.values():
        imu = np.array(camera.pop("T_cn_cnm1", np.eye(4))) @ imu
        camera["T_cam_imu"] = imu.tolist()
    (tmp_path / "imu.yaml").write_text(yaml.safe_dump(chain))
    turned, moved_m = differences(pair(), read_calibration(tmp_path / "imu.yaml").rig)
    assert turned < 1e-9 and moved_m < 1e-9


def test_dsec_is_read_as_its_page_says(tmp_path: Path) -> None:
    """T_XY takes points of camera Y to camera X; 0 and 3 are event cameras, 1 and 2 frame cameras."""

    def camera(kind: str, side: str, size: list[int]) -> dict[str, object]:
        return {
            "camera_type": kind,
            "camera_location": side,
            "camera_matrix": [550.0, 551.0, 320.0, 240.0],
            "camera_model": "pinhole",
            "distortion_model": "radtan",
            "distortion_coeffs": [-0.1, 0.2, 0.0, 0.001],
            "resolution": size,
        }

    def step(metres: float) -> list[list[float]]:
        return [[1, 0, 0, metres], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

    event, frame = [640, 480], [1440, 1080]
    kinds = [("event", "left", event), ("frame", "left", frame), ("frame", "right", frame), ("event", "right", event)]
    tree = {
        "intrinsics": {f"cam{index}": camera(*about) for index, about in enumerate(kinds)} | {"camRect0": {}},
        "extrinsics": {"T_10": step(-0.04), "T_21": step(-0.51), "T_32": step(-0.05)},
    }
    (tmp_path / "cam_to_cam.yaml").write_text(yaml.safe_dump(tree))
    cameras = read_calibration(tmp_path / "cam_to_cam.yaml").rig.cameras
    assert [camera.name for camera in cameras] == ["cam0", "cam1", "cam2", "cam3"]
    assert [camera.kind for camera in cameras] == ["dvs", "cis", "cis", "dvs"]
    assert [camera.size for camera in cameras] == [(640, 480), (1440, 1080), (1440, 1080), (640, 480)]
    np.testing.assert_allclose([camera.translation_mm[0] for camera in cameras], [0, 40, 550, 600])
    tree["intrinsics"]["cam0"]["camera_matrix"] = [[550.0, 0, 320.0], [0, 551.0, 240.0], [0, 0, 1]]
    del tree["intrinsics"]["cam0"]["camera_location"]
    (tmp_path / "matrix.yaml").write_text(yaml.safe_dump(tree | {"intrinsics": {"cam0": tree["intrinsics"]["cam0"]}}))
    (alone,) = read_calibration(tmp_path / "matrix.yaml").rig.cameras
    assert (alone.name, alone.focal_px, alone.centre_px) == ("cam0", (550.0, 551.0), (320.0, 240.0))
    for index in range(4):  # (as files are that do not say it)
        del tree["intrinsics"][f"cam{index}"]["camera_type"]
    (tmp_path / "unsaid.yaml").write_text(yaml.safe_dump(tree))
    unsaid = read_calibration(tmp_path / "unsaid.yaml").rig.cameras
    assert [camera.kind for camera in unsaid] == ["dvs", "cis", "cis", "dvs"]


def test_rows_of_a_rectified_pair_show_the_same(tmp_path: Path) -> None:
    """What DSEC's readers do: to a rectified camera by its rotation, K, and disparity to depth by Q."""
    write_calibration(tmp_path / "cam_to_cam.yaml", pair(), "dsec")
    tree = yaml.safe_load((tmp_path / "cam_to_cam.yaml").read_text())
    points = np.random.default_rng(0).uniform((-1, -1, 3), (1, 1, 8), (50, 3))
    left, right = (
        cv2.undistortPoints(
            projected(view, points)[:, None],
            view.intrinsics.matrix,
            np.array(view.intrinsics.distortion),
            R=np.array(tree["extrinsics"][f"R_rect{index}"]),
            P=np.diag([*tree["intrinsics"][f"camRect{index}"]["camera_matrix"][:2], 1.0])
            + np.pad(np.array(tree["intrinsics"][f"camRect{index}"]["camera_matrix"][2:])[:, None], ((0, 1), (2, 0))),
        )[:, 0]
        for index, view in ((0, views_of(pair())[0]), (2, views_of(pair())[2]))
    )
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-3)
    found = (
        np.c_[left, left[:, 0] - right[:, 0], np.ones(len(left))] @ np.array(tree["disparity_to_depth"]["cams_02"]).T
    )
    turned = points @ np.array(tree["extrinsics"]["R_rect0"]).T
    np.testing.assert_allclose(found[:, :3] / found[:, 3:], turned, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(
    "changed",
    [
        {"size": (320, 240)},
        {"translation_mm": (1e-8, 0, 0)},
        {"translation_mm": (0, 0, 150), "rotation_deg": (0, 0, 0)},  # (one before the other)
        {"distortion_model": "equidistant", "distortion": (0.1, 0, 0, 0)},
        {"kind": "cis"},
    ],
    ids=str,
)
def test_cameras_that_are_no_pair_are_not_turned(tmp_path: Path, changed: dict[str, object]) -> None:
    left, _, right = pair().cameras
    write_calibration(tmp_path / "pair.yaml", Rig(cameras=(left, right)), "dsec")
    write_calibration(tmp_path / "none.yaml", Rig(cameras=(left, right.model_copy(update=changed))), "dsec")
    one, other = (yaml.safe_load((tmp_path / name).read_text()) for name in ("pair.yaml", "none.yaml"))
    assert [*one["disparity_to_depth"]] == ["cams_01"] and other["disparity_to_depth"] == {}
    for index in range(2):
        np.testing.assert_array_equal(other["extrinsics"][f"R_rect{index}"], np.eye(3))
        lenses = [other["intrinsics"][f"cam{rect}{index}"]["camera_matrix"] for rect in ("", "Rect")]
        assert lenses[0] == lenses[1]


def test_rectified_pictures_are_full_of_light(tmp_path: Path) -> None:
    write_calibration(tmp_path / "cam_to_cam.yaml", pair(), "dsec")
    tree = yaml.safe_load((tmp_path / "cam_to_cam.yaml").read_text())
    for index in (0, 2):
        (fx, fy, cx, cy), lens = (
            tree["intrinsics"][f"camRect{index}"]["camera_matrix"],
            views_of(pair())[index].intrinsics,
        )
        across, down = cv2.initUndistortRectifyMap(
            lens.matrix,
            np.array(lens.distortion),
            np.array(tree["extrinsics"][f"R_rect{index}"]),
            np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]),
            lens.size,
            cv2.CV_32FC1,
        )
        for places, side in ((across, lens.size[0]), (down, lens.size[1])):
            assert places.min() > -1 and places.max() < side


@pytest.mark.parametrize("name", ["kalibr", "dsec", "dv"])
def test_cameras_come_in_the_order_of_their_numbers(tmp_path: Path, name: str) -> None:
    cameras = [
        Camera(name=f"c{k}", kind="dvs", size=(64, 48), fov_deg=60.0, translation_mm=(k * k, 0, 0)) for k in range(12)
    ]
    path = tmp_path / "calibration"
    write_calibration(path, Rig(cameras=tuple(cameras)), name)
    tree = yaml.safe_load(path.read_text())
    for key in ("intrinsics", "cameras"):
        if key in tree:
            tree[key] = dict(reversed(tree[key].items()))
    path.write_text(json.dumps(dict(reversed(tree.items()))))
    found = read_calibration(path).rig.cameras
    assert [camera.name for camera in found] == [camera.name for camera in cameras]
    np.testing.assert_allclose([camera.translation_mm[0] for camera in found], [k * k for k in range(12)], atol=1e-9)


def test_a_set_of_dv_processing_may_begin_with_another_camera(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    write_calibration(path, pair(), "dv")
    tree = json.loads(path.read_text())
    del tree["cameras"]["C0"]
    path.write_text(json.dumps(tree))
    found = read_calibration(path).rig
    between = [one.cameras[-2].pose.inverse() @ one.cameras[-1].pose for one in (pair(), found)]
    assert np.array_equal(found.cameras[0].pose.rotation, np.eye(3)) and not found.cameras[0].pose.translation_m.any()
    np.testing.assert_allclose(between[0].rotation, between[1].rotation, atol=1e-9)
    np.testing.assert_allclose(between[0].translation_m, between[1].translation_m, atol=1e-9)
    tree["cameras"]["C1"]["focalLength"][0] = True
    path.write_text(json.dumps(tree))
    with pytest.raises(DataError, match=r"cameras.C1.focalLength\[0\] is True, not a number"):
        read_calibration(path)


def test_opencv_reads_what_is_written(tmp_path: Path) -> None:
    rig, path = pair(), tmp_path / "cameras.yml"
    write_calibration(path, rig, "opencv")
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    node = file.getNode("cameras")
    views = views_of(rig)
    assert node.size() == 3
    points = np.random.default_rng(0).uniform((-1, -1, 3), (1, 1, 8), (20, 3))
    for index, view in enumerate(views):
        entry = node.at(index)
        assert entry.getNode("camera_name").string() == view.camera.name
        assert int(entry.getNode("image_width").real()) == view.intrinsics.size[0]
        seen = cv2.projectPoints(
            points,
            *(entry.getNode(key).mat() for key in ("rotation", "translation")),
            *(entry.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients")),
        )[0][:, 0]
        np.testing.assert_allclose(seen, projected(view, points), atol=1e-9)


def test_opencv_reads_a_pair_by_the_names_of_its_sample(tmp_path: Path) -> None:
    left, _, right = pair().cameras
    write_calibration(tmp_path / "pair.yml", Rig(cameras=(left, right)), "opencv")
    file = cv2.FileStorage(str(tmp_path / "pair.yml"), cv2.FILE_STORAGE_READ)
    m2, d2, r, t = (file.getNode(key).mat() for key in ("M2", "D2", "R", "T"))
    points = np.array([[0.1, -0.2, 3.0], [-0.5, 0.4, 5.0]])
    seen = cv2.projectPoints(points, cv2.Rodrigues(r)[0], t, m2, d2)[0][:, 0]
    np.testing.assert_allclose(seen, projected(views_of(pair())[2], points), atol=1e-9)
    write_calibration(tmp_path / "one.yml", Rig(cameras=(left,)), "opencv")
    file = cv2.FileStorage(str(tmp_path / "one.yml"), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(file.getNode("camera_matrix").mat(), views_of(pair())[0].intrinsics.matrix)


def opencv_file(path: Path, **values: object) -> Path:
    """A file that OpenCV writes."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        file.write(key, value)
    file.release()
    return path


def test_files_of_opencvs_samples_are_read(tmp_path: Path) -> None:
    matrix = np.array([[501.5, 0, 320.25], [0, 502.5, 240.75], [0, 0, 1]])
    radtan = np.array([[0.1, -0.2, 0.001, 0.002, 0.05]])
    one = opencv_file(
        tmp_path / "camera.yml", image_width=640, image_height=480, camera_matrix=matrix, distortion_coefficients=radtan
    )
    found = read_calibration(one)
    (camera,) = found.rig.cameras
    assert not found.notes  # (one camera has no translation whose unit could matter)
    assert (camera.size, camera.focal_px, camera.centre_px) == ((640, 480), (501.5, 502.5), (320.25, 240.75))
    assert (camera.distortion_model, camera.distortion) == ("radtan", (0.1, -0.2, 0.001, 0.002, 0.05))
    long = np.pad(radtan, ((0, 0), (0, 9)))
    turn, shift = cv2.Rodrigues(np.array([0.0, 0.1, 0.0]))[0], np.array([[-60.0], [1], [2]])
    both = {"M1": matrix, "D1": long, "M2": matrix, "D2": long, "R": turn, "T": shift}
    stereo = opencv_file(tmp_path / "stereo.yml", image_width=640, image_height=480, **both)
    found = read_calibration(stereo, unit="mm")
    assert not found.notes and len(found.rig.cameras[0].distortion) == 8
    np.testing.assert_allclose(found.rig.cameras[1].pose.inverse().translation_m, (-0.06, 0.001, 0.002))
    assert "taken as m, cameras are 60.0" in read_calibration(stereo).notes[0]
    sizeless = opencv_file(tmp_path / "sizeless.yml", **both)
    with pytest.raises(DataError, match="the file has no image_width"):
        read_calibration(sizeless)
    tilted = opencv_file(tmp_path / "tilted.yml", image_width=640, image_height=480, **(both | {"D1": long + 1}))
    with pytest.raises(DataError, match="D1 has a thin prism or a tilt"):
        read_calibration(tilted)


def test_what_opencvs_files_leave_open_is_told_by_their_numbers(tmp_path: Path) -> None:
    matrix, four = np.array([[501.5, 0, 320.25], [0, 502.5, 240.75], [0, 0, 1]]), np.array([[0.1, -0.2, 0.001, 0.002]])

    def read(**changed: object) -> Camera:
        stated = {"size": np.array([640, 480]), "camera_matrix": matrix, "distortion_coefficients": four, **changed}
        return read_calibration(opencv_file(tmp_path / "camera.yml", **stated)).rig.cameras[0]

    assert read().size == (640, 480)
    assert (
        read(fisheye_model=0).distortion_model == "radtan" and read(fisheye_model=1).distortion_model == "equidistant"
    )
    turn, shift = cv2.Rodrigues(np.array([0.0, 0.1, 0.0]))[0], np.array([[-0.06], [0], [0]])
    pair = {"M1": matrix, "D1": four, "M2": matrix, "D2": four, "R": turn, "T": shift, "size": np.array([640, 480])}
    for said, model in (
        ({}, "radtan"),
        ({"fisheye_model": 1}, "equidistant"),
        ({"distortion_model": "fisheye"}, "equidistant"),
    ):
        found = read_calibration(opencv_file(tmp_path / "pair.yml", **pair, **said)).rig.cameras
        assert [camera.distortion_model for camera in found] == [model] * 2
    assert read(distortion_coefficients=0 * four).distortion_model == "none"
    with pytest.raises(DataError, match="not a camera matrix of fx, 0, cx"):
        read(camera_matrix=matrix + np.eye(3, k=1) * [0, 0.5, 0])
    for first in ("%YAML:1.0", "# YAML"):  # (lines are counted with the first one)
        (tmp_path / "broken.yml").write_text(f"{first}\nsize: [\n  ]]\n")
        with pytest.raises(DataError, match="line 3"):
            read_calibration(tmp_path / "broken.yml")


def test_distortions_have_the_names_that_ros_gives_them(tmp_path: Path) -> None:
    for count, name in ((4, "plumb_bob"), (5, "plumb_bob"), (8, "rational_polynomial")):
        lens = {"size": (64, 48), "fov_deg": 60.0, "distortion_model": "radtan", "distortion": (0.01,) * count}
        write_calibration(tmp_path / "c.yml", Rig(cameras=(Camera(name="a", kind="dvs", **lens),)), "opencv", True)
        assert f"distortion_model: {name}" in (tmp_path / "c.yml").read_text()


def test_ros_camera_info_is_read(tmp_path: Path) -> None:
    (tmp_path / "ost.yaml").write_text("""
image_width: 640
image_height: 480
camera_name: narrow_stereo/left
camera_matrix:
  rows: 3
  cols: 3
  data: [500.1, 0, 320, 0, 501.2, 240, 0, 0, 1]
distortion_model: equidistant
distortion_coefficients: {rows: 1, cols: 4, data: [1e-1, 2e-2, -3e-3, 0]}
""")
    (camera,) = read_calibration(tmp_path / "ost.yaml").rig.cameras
    assert camera.name == "narrow_stereo_left" and camera.focal_px == (500.1, 501.2)
    assert (camera.distortion_model, camera.distortion) == ("equidistant", (0.1, 0.02, -0.003, 0.0))


def test_dv_processing_reads_what_is_written(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    write_calibration(path, pair(), "dv")
    found = dv.camera.CalibrationSet.LoadFromFile(str(path))
    assert found.getCameraList() == ["C0", "C1", "C2"]
    for key, view in zip(found.getCameraList(), views_of(pair()), strict=True):
        theirs = found.getCameraCalibration(key)
        lens, to_camera = view.intrinsics, view.pose.inverse()
        assert theirs.name == view.camera.name and theirs.resolution == lens.size and theirs.master == (key == "C0")
        np.testing.assert_allclose(theirs.focalLength, lens.focal_px, rtol=1e-6)
        np.testing.assert_allclose(theirs.principalPoint, lens.centre_px, rtol=1e-6)
        np.testing.assert_allclose(theirs.distortion, lens.distortion, rtol=1e-6)
        motion = theirs.transformationToC0.getTransform()
        np.testing.assert_allclose(motion[:3, :3], to_camera.rotation, atol=1e-6)
        np.testing.assert_allclose(motion[:3, 3], to_camera.translation_m, atol=1e-6)


def test_dv_processing_means_the_motion_from_c0_to_the_camera(tmp_path: Path) -> None:
    """Its own rectification brings both views of a point to one row: the matrix has the direction that it means."""
    left, _, right = (
        camera.model_copy(update={"distortion_model": "none", "distortion": ()}) for camera in pair().cameras
    )
    rig = Rig(cameras=(left, right))
    write_calibration(tmp_path / "calibration.json", rig, "dv")
    found = dv.camera.CalibrationSet.LoadFromFile(str(tmp_path / "calibration.json"))
    stereo = dv.camera.StereoGeometry(found.getCameraCalibration("C0"), found.getCameraCalibration("C1"))
    sides = (dv.camera.StereoGeometry.CameraPosition.LEFT, dv.camera.StereoGeometry.CameraPosition.RIGHT)
    points = np.random.default_rng(0).uniform((-0.5, -0.5, 3), (0.5, 0.5, 6), (100, 3))
    pixels = [np.round(projected(view, points)).astype(np.int32) for view in views_of(rig)]
    rows = [[stereo.remapPoint(side, pixel) for pixel in of] for side, of in zip(sides, pixels, strict=True)]
    apart = [abs(int(a[1]) - int(b[1])) for a, b in zip(*rows, strict=True) if a is not None and b is not None]
    assert len(apart) > 80 and max(apart) <= 2


def test_what_dv_processing_writes_is_read(tmp_path: Path) -> None:
    theirs = dv.camera.CalibrationSet()
    for index, (name, view) in enumerate(zip(("DVXplorer DXA0213", "b"), views_of(pair())[::2], strict=True)):
        lens, motion = view.intrinsics, np.eye(4, dtype=np.float32)
        motion[:3, :3], motion[:3, 3] = view.pose.inverse().rotation, view.pose.inverse().translation_m
        theirs.addCameraCalibration(
            dv.camera.calibrations.CameraCalibration(
                name,
                "",
                index == 0,
                lens.size,
                lens.centre_px,
                lens.focal_px,
                lens.distortion,
                dv.camera.DistortionModel.RADIAL_TANGENTIAL,
                dv.kinematics.Transformationf(0, motion),
                None,
            )
        )
    theirs.writeToFile(str(tmp_path / "theirs.json"))
    found = read_calibration(tmp_path / "theirs.json")
    assert [camera.name for camera in found.rig.cameras] == ["DVXplorer_DXA0213", "b"]
    left, _, right = pair().cameras
    turned, moved_m = differences(Rig(cameras=(left, right)), found.rig)
    assert turned < 1e-6 and moved_m < 1e-6
    assert "which cameras give events" in found.notes[0]


@pytest.mark.parametrize(
    ("name", "key", "sentence"),
    [
        ("kalibr", "intrinsics", "cam0 has no intrinsics"),
        ("kalibr", "distortion_model", "cam0 has no distortion_model"),
        ("kalibr", "distortion_coeffs", "cam0 has no distortion_coeffs"),
        ("kalibr", "resolution", "cam0 has no resolution"),
        ("kalibr", "T_cn_cnm1", "cam1 has no T_cn_cnm1"),
        ("dsec", "extrinsics", "the file has no extrinsics"),
        ("dsec", "T_10", "extrinsics has no T_10"),
        ("dsec", "T_21", "extrinsics has no T_21"),
        ("dsec", "camera_matrix", "intrinsics.cam0 has no camera_matrix"),
        ("dsec", "resolution", "intrinsics.cam0 has no resolution"),
        ("dsec", "distortion_coeffs", "intrinsics.cam0 has no distortion_coeffs"),
        ("dv", "resolution", "cameras.C0 has no resolution"),
        ("dv", "focalLength", "cameras.C0 has no focalLength"),
        ("dv", "principalPoint", "cameras.C0 has no principalPoint"),
        ("dv", "distortionModel", "cameras.C0 has no distortionModel"),
        ("dv", "transformationToC0", "cameras.C0 has no transformationToC0"),
        ("opencv", "camera_matrix", "cameras[0] has no camera_matrix"),
        ("opencv", "image_height", "cameras[0] has no image_height"),
        ("opencv", "distortion_coefficients", "cameras[0] has no distortion_coefficients"),
        ("opencv", "rotation", "cameras[0] has no rotation"),
    ],
)
def test_a_key_that_is_missing_is_named(tmp_path: Path, name: str, key: str, sentence: str) -> None:
    path = tmp_path / "calibration"
    write_calibration(path, pair(), name)
    path.write_text(re.sub(rf"\b{key}\b(?=\"?:)", "something_else", path.read_text()))
    with pytest.raises(DataError) as refusal:
        read_calibration(path)
    assert str(path) in str(refusal.value) and sentence in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("pinhole", "omni", "cam0 is an 'omni' camera"),
        ("radtan", "fov", "cam0.distortion_model is 'fov'; vid2ev knows 'none', 'radtan', 'equidistant'"),
        ("[752, 480]", "[752]", "cam0.resolution is ['752'], not 2 numbers"),
        ("[752, 480]", "[752.5, 480]", "cam0.resolution[0] is '752.5', not a whole number of pixels"),
        ("461.629, ", "", "cam0.intrinsics is ['460.152', '362.680', '246.049'], not 4 numbers"),
        ("461.629", "-461.629", "cam0: focal lengths must be greater than 0"),
        ("461.629", "many", "cam0.intrinsics[0] is 'many', not a number"),
        ("461.629", ".nan", "cam0.intrinsics[0] is '.nan', not a number"),
        ("0.99998854", "0.5", "cam1.T_cn_cnm1 is"),
        ("-0.11003785", "-1.1e6", "cameras stand more than 1000 km apart"),
        ("[752, 480]", "[0, 480]", "cam0.resolution[0] is '0', not a whole number of pixels"),
        ("87]\n  - [0.0, 0.0, 0.0, 1.0]", "87]\n  - [0.0, 0.0, 0.0, 2.0]", "last row of 0, 0, 0, 1"),
        ("[-0.33518750, 0.13211436, 57e-5, 0.00057686]", str([0] * 1001), "not at most 1000 numbers"),
        ("-8.121e-05", f"{1.1e-6 * LATEST_US}", "cam0.timeshift_cam_imu is '"),
        ("-8.121e-05", "1e12", "cam0.timeshift_cam_imu is '1e12', not a shift of a clock"),
    ],
)
def test_a_value_that_cannot_be_is_named(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in KALIBR
    (tmp_path / "camchain.yaml").write_text(KALIBR.replace(old, new, 1))
    with pytest.raises(DataError) as refusal:
        read_calibration(tmp_path / "camchain.yaml")
    assert sentence in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_lens_that_a_format_cannot_hold_is_refused(tmp_path: Path) -> None:
    lens = {"size": (64, 48), "fov_deg": 60.0, "distortion_model": "radtan", "distortion": (0, 0, 0, 0, 0, 0, 0, 1.0)}
    rig = Rig(cameras=(Camera(name="a", kind="dvs", **lens),))
    for name in ("kalibr", "dv"):
        with pytest.raises(UsageError, match="camera a has 8; choose --as opencv"):
            write_calibration(tmp_path / "calibration", rig, name)
        padded = Rig(cameras=(Camera(name="a", kind="dvs", **(lens | {"distortion": (0.1, 0, 0, 0, 0, 0, 0, 0)})),))
        write_calibration(tmp_path / name, padded, name)
        assert (
            read_calibration(tmp_path / name).rig.cameras[0].distortion == (0.1, 0, 0, 0, 0)[: HELD[name]["radtan"][-1]]
        )
        (tmp_path / name).unlink()
    with pytest.raises(UsageError, match="camera dvs has no size"):
        write_calibration(tmp_path / "calibration", Rig(cameras=(Camera(name="dvs", kind="dvs"),)), "dsec")
    with pytest.raises(UsageError, match="expected rig or one of dsec, kalibr, dv, opencv"):
        write_calibration(tmp_path / "calibration", pair(), "ros")
    assert not list(tmp_path.iterdir())


def test_a_field_that_is_the_videos_is_written(tmp_path: Path) -> None:
    """Its width in degrees is enough, whatever the size of the video."""
    seen = Rig(source=Source(fov_deg=80.0), cameras=(Camera(name="a", kind="dvs", size=(64, 48)),))
    write_calibration(tmp_path / "calibration", seen, "kalibr")
    found = read_calibration(tmp_path / "calibration").rig.cameras[0]
    assert found.focal_px == pytest.approx(seen.resolved((1280, 720)).viewpoints[0].intrinsics.focal_px)
    seen = Rig(source=Source(focal_px=(300, 300), size=(640, 480)), cameras=seen.cameras)
    write_calibration(tmp_path / "pixels", seen, "kalibr")
    found = read_calibration(tmp_path / "pixels").rig.cameras[0]
    assert found.focal_px == pytest.approx(views_of(seen)[0].intrinsics.focal_px)
    for source in (Source(), Source(focal_px=(100, 100)), Source(size=(640, 480))):
        with pytest.raises(UsageError, match="camera a has no size with fov_deg or focal_px"):
            write_calibration(tmp_path / "calibration", Rig(source=source, cameras=seen.cameras), "kalibr")


def test_names_become_names_of_folders(tmp_path: Path) -> None:
    write_calibration(tmp_path / "calibration", pair(), "dv")
    tree = json.loads((tmp_path / "calibration").read_text())
    for called, expected in ((("a/b", "A_B", "con"), ["a_b", "A_B_2", "con_2"]), (("x" * 300,) * 3, None)):
        for key, name in zip(tree["cameras"], called, strict=True):
            tree["cameras"][key]["name"] = name
        (tmp_path / "calibration").write_text(json.dumps(tree))
        names = [camera.name for camera in read_calibration(tmp_path / "calibration").rig.cameras]
        assert names == (expected or ["x" * 48, f"{'x' * 48}_2", f"{'x' * 48}_3"])


def test_files_of_no_format_are_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "calibration"
    texts = ["", "3", "[]", "{}", "{", "a: [", "a: 1", "- 1", "\t", "&a [*a]", "[" * 5000, "{" * 5000]
    texts += ["cameras: 3", "cameras: []", "cameras: {}", "cameras: []\nK: 1", "cam0: 1", "intrinsics: {cam0: 1}"]
    for text in texts:
        path.write_text(text)
        with pytest.raises(DataError) as refusal:
            read_calibration(path)
        assert "\n" not in str(refusal.value)
    with pytest.raises(UsageError, match="no such file"):
        read_calibration(tmp_path / "none")


@pytest.mark.parametrize("name", FORMATS)
def test_damage_is_never_a_traceback(tmp_path: Path, name: str) -> None:
    path = tmp_path / "calibration"
    write_calibration(path, pair(), name)
    whole, read = path.read_bytes(), 0
    numbers = [b"0", b"-1", b"1e300", b"nan", b"x", b"[]", b"{}", b"null", b"9" * 400, b'""', b"*a", b"&a", b"!!int x"]
    for attempt in range(80):
        random = np.random.default_rng(attempt)
        data = bytearray(whole)
        for _ in range(random.integers(1, 4)):
            if random.random() < 0.5 and (found := list(re.finditer(rb"-?\d[\d.e-]*", data))):
                place = found[random.integers(len(found))]
                data[place.start() : place.end()] = numbers[random.integers(len(numbers))]
            else:
                at = int(random.integers(len(data)))
                data[at : at + int(random.integers(0, 9))] = random.bytes(int(random.integers(0, 4)))
        path.write_bytes(data[: len(data) if random.random() < 0.8 else int(random.integers(len(data)))])
        try:
            views_of(read_calibration(path).rig)
            read += 1
        except (DataError, UsageError) as error:
            assert "\n" not in str(error)
    assert read < 80
