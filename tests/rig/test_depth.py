"""Depth from files, planes and models: read as others write it, refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.depth_files import write_depth
from vid2ev.rig.depth import DepthScale, between, open_depth
from vid2ev.rig.intrinsics import Intrinsics

SOURCE = Intrinsics.of_field((32, 24), 60)
VALUES = np.random.default_rng(0).uniform(0.5, 8, (24, 32)).astype(np.float32)


def test_a_plane_is_a_plane() -> None:
    depth = open_depth("plane:2.5", SOURCE)
    assert depth.plane_m == 2.5 and (depth.at(7) == 2.5).all() and depth.at(0).shape == (24, 32)
    assert open_depth("plane:inf", SOURCE).plane_m == np.inf


def test_codes_of_16_bits_in_millimetres(tmp_path: Path) -> None:
    codes = np.rint(VALUES * 1000).astype(np.uint16)
    codes[3, 4] = 0
    for name in ("depth.png", "depth.tiff"):
        assert cv2.imwrite(str(tmp_path / name), codes)
        found = open_depth(tmp_path / name, SOURCE, scale=0.001).at(11)
        assert found.dtype == np.float32 and np.isnan(found[3, 4])
        np.testing.assert_allclose(found[codes > 0], codes[codes > 0] / 1000, rtol=1e-6)
        with pytest.raises(UsageError, match=r"uint16 codes may mean any depth; give the scale"):
            open_depth(tmp_path / name, SOURCE)


def test_codes_that_vid2ev_wrote_say_themselves_what_they_mean(tmp_path: Path) -> None:
    """65535 is infinitely far there, and in codes of others a depth as any other."""
    depth = VALUES.copy()
    depth[3, 4], depth[5, 6] = np.nan, np.inf
    write_depth(tmp_path / "000000.png", depth, 0.002)
    np.testing.assert_allclose(open_depth(tmp_path, SOURCE).at(0), depth, atol=0.001)
    assert open_depth(tmp_path, SOURCE, scale=0.002).at(0)[5, 6] == pytest.approx(131.07)


def test_disparities_as_those_of_kitti(tmp_path: Path) -> None:
    codes = np.rint(VALUES * 256).astype(np.uint16)
    codes[0, 0] = 0
    cv2.imwrite(str(tmp_path / "d.png"), codes)
    depth = open_depth(tmp_path / "d.png", SOURCE, scale=1 / 256, baseline_m=0.54, focal_px=721.5)
    expected = 721.5 * 0.54 / (np.maximum(codes, 1) / 256)
    np.testing.assert_allclose(depth.at(0)[1:], expected[1:], rtol=1e-6)
    assert np.isnan(depth.at(0)[0, 0])
    own = open_depth(tmp_path / "d.png", SOURCE, scale=1 / 256, baseline_m=0.54).at(0)
    np.testing.assert_allclose(own[1:], expected[1:] * SOURCE.focal_px[0] / 721.5, rtol=1e-6)


def pfm(values: np.ndarray, order: str) -> bytes:
    """Portable float map, as its description has it: rows from below, the sign of the scale says little-endian."""
    scale = -1.0 if order == "<" else 1.0
    return f"Pf\n{values.shape[1]} {values.shape[0]}\n{scale}\n".encode() + values[::-1].astype(f"{order}f4").tobytes()


@pytest.mark.parametrize("order", "<>")
def test_disparities_as_those_of_middlebury(tmp_path: Path, order: str) -> None:
    values = VALUES * 10
    values[5, 6] = np.inf
    (tmp_path / "disp0.pfm").write_bytes(pfm(values, order))
    found = open_depth(tmp_path / "disp0.pfm", SOURCE, baseline_m=0.193, focal_px=995, shift=31.1).at(0)
    known = np.isfinite(values)
    np.testing.assert_allclose(found[known], 995 * 0.193 / (values[known] + 31.1), rtol=1e-6)
    assert np.isnan(found[5, 6])


@pytest.mark.parametrize("channel", ["Z", "Depth.Z", "ViewLayer.Depth.Z", "V"])
def test_depth_of_exr(tmp_path: Path, channel: str) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    channels = {channel: VALUES} if channel == "V" else {"R": VALUES * 0, channel: VALUES}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(tmp_path / "d.exr"))
    np.testing.assert_array_equal(open_depth(tmp_path / "d.exr", SOURCE).at(0), VALUES)
    OpenEXR.File(header, {"R": VALUES, "G": VALUES}).write(str(tmp_path / "rg.exr"))
    with pytest.raises(DataError, match="channels"):
        open_depth(tmp_path / "rg.exr", SOURCE)


def test_arrays_one_for_all_or_one_for_each(tmp_path: Path) -> None:
    stack = np.stack([VALUES, VALUES * 1.1, VALUES * 3])
    np.save(tmp_path / "one.npy", VALUES.astype(np.float64))
    np.save(tmp_path / "stack.npy", stack)
    np.savez_compressed(tmp_path / "many.npz", depth=stack, mask=VALUES > 1)
    one = open_depth(tmp_path / "one.npy", SOURCE)
    np.testing.assert_array_equal(one.at(0), VALUES)
    assert one.at(5) is one.at(0)
    for name in ("stack.npy", "many.npz"):
        depth = open_depth(tmp_path / name, SOURCE)
        for k in (0, 2, 1):
            np.testing.assert_array_equal(depth.at(k), stack[k])
        with pytest.raises(DataError, match="3 depth maps, but the video has more frames"):
            depth.at(3)


def test_a_folder_is_in_natural_order(tmp_path: Path) -> None:
    for k in (1, 2, 10):
        cv2.imwrite(str(tmp_path / f"depth{k}.png"), np.full((24, 32), k, np.uint16))
    (tmp_path / "notes.txt").write_text("not a map")
    depth = open_depth(tmp_path, SOURCE, scale=1)
    assert [depth.at(k)[0, 0] for k in range(3)] == [1, 2, 10]


def test_between_two_frames_inverse_depth_is_interpolated() -> None:
    before, after = (
        np.float32([2, 2, np.nan, 5, np.nan, np.inf, np.inf, 1]),
        np.float32([2.1, 2.6, 3, np.nan, np.nan, np.inf, 2, 1]),
    )
    early, late = between(before, after, 0.4), between(before, after, 0.6)
    np.testing.assert_allclose(early, [1 / (0.6 / 2 + 0.4 / 2.1), 2, 3, 5, np.nan, np.inf, np.inf, 1], rtol=1e-6)
    np.testing.assert_allclose(late, [1 / (0.4 / 2 + 0.6 / 2.1), 2.6, 3, 5, np.nan, np.inf, 2, 1], rtol=1e-6)


@given(
    st.lists(st.floats(width=32), min_size=1),
    st.sampled_from(["depth", "disparity", "inverse"]),
    st.floats(1e-6, 1e6),
    st.floats(-1e6, 1e6),
)
def test_any_numbers_are_a_depth_or_unknown(values, kind, scale, shift) -> None:  # type: ignore[no-untyped-def]
    for dtype in (np.float32, np.uint16):
        with np.errstate(invalid="ignore"):
            array = np.array(values, np.float32).astype(dtype)
        depth_m = DepthScale(kind, scale, shift, 100.0, 0.1).depth_m(array)
        assert (np.isnan(depth_m) | (depth_m >= 0)).all() and depth_m.dtype == np.float32
        assert np.isnan(depth_m[array == 0]).all() or dtype == np.float32


def test_what_is_unknown() -> None:
    values = np.float32([0, -1, np.nan, np.inf, -np.inf, 2])
    unknown = np.isnan(DepthScale().depth_m(values))
    np.testing.assert_array_equal(unknown, [True, True, True, False, True, False])
    assert DepthScale().depth_m(values)[3] == np.inf
    disparity = DepthScale("disparity", 1, 0, 100, 0.1).depth_m(values)
    np.testing.assert_array_equal(np.isnan(disparity), [True, True, True, True, True, False])
    inverse = DepthScale("inverse", 1, 0).depth_m(values)
    np.testing.assert_array_equal(np.isinf(inverse), [True, True, False, False, True, False])
    np.testing.assert_array_equal(np.isnan(inverse), [False, False, True, True, False, False])


@pytest.mark.parametrize("depth", [0.0, -2.0, np.nan])
def test_a_map_of_nothing_that_is_known_is_refused(tmp_path: Path, depth: float) -> None:
    np.save(tmp_path / "d.npy", np.full_like(VALUES, depth, np.float32))
    with pytest.raises(DataError, match="none of its depth is known"):
        open_depth(tmp_path / "d.npy", SOURCE)


@pytest.mark.parametrize(
    "text, options, message",
    [
        ("", {}, "depth '': expected a map"),
        ("plane:0", {}, "plane:0"),
        ("plane:-2", {}, "plane:-2"),
        ("plane:nan", {}, "plane:nan"),
        ("plane:near", {}, "plane:near"),
        ("nowhere.png", {}, "no such file or folder"),
        ("plane:1", {"scale": 0.0}, "scale 0"),
        ("plane:1", {"shift": np.nan}, "shift nan"),
        ("plane:1", {"kind": "disparity"}, "without a baseline"),
        ("plane:1", {"focal_px": 900.0}, "focal_px 900 of depth: expected of disparity"),
        ("plane:1", {"kind": "inverse", "baseline_m": 0.1}, "baseline_m 0.1 of depth: expected of disparity"),
        ("plane:1", {"kind": "distance"}, "possible are depth, disparity, inverse"),
        ("model:", {}, "without a name"),
    ],
)
def test_what_cannot_be_meant_is_refused(text: str, options: dict, message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        open_depth(text, SOURCE, **options)
    assert "\n" not in str(caught.value)


def test_files_that_hold_no_depth_are_refused(tmp_path: Path) -> None:
    cases: dict[str, tuple[object, str]] = {
        "size.npy": (np.ones((12, 16)), "depth of 16x12 pixels, expected 32x24 like the video"),
        "four.npy": (np.ones((2, 24, 32, 3)), "no depth map"),
        "empty.npy": (np.ones((0, 24, 32)), "no depth map"),
        "text.npy": (np.array([["a"]]), "no depth map"),
    }
    for name, (array, message) in cases.items():
        np.save(tmp_path / name, array)
        with pytest.raises(DataError, match=message):
            open_depth(tmp_path / name, SOURCE)
    np.savez(tmp_path / "two.npz", a=VALUES, b=VALUES)
    with pytest.raises(DataError, match="holds a, b"):
        open_depth(tmp_path / "two.npz", SOURCE)
    cv2.imwrite(str(tmp_path / "colour.png"), np.zeros((24, 32, 3), np.uint8))
    with pytest.raises(DataError, match="no depth map"):
        open_depth(tmp_path / "colour.png", SOURCE, scale=1)
    (tmp_path / "video.bin").write_bytes(b"neither this nor that")
    with pytest.raises(DataError, match="not a depth map"):
        open_depth(tmp_path / "video.bin", SOURCE)
    (tmp_path / "folder").mkdir()
    with pytest.raises(DataError, match="no depth maps in this folder"):
        open_depth(tmp_path / "folder", SOURCE)


@pytest.mark.parametrize("suffix", ["npy", "npz", "png", "pfm", "exr"])
def test_damaged_files_are_refused_in_one_sentence(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"d.{suffix}"
    if suffix == "npz":
        np.savez_compressed(path, depth=VALUES)
    elif suffix == "npy":
        np.save(path, VALUES)
    elif suffix == "pfm":
        path.write_bytes(pfm(VALUES, "<"))
    elif suffix == "exr":
        OpenEXR = pytest.importorskip("OpenEXR")
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Z": VALUES}).write(str(path))
    else:
        cv2.imwrite(str(path), (VALUES * 1000).astype(np.uint16))
    whole, random = path.read_bytes(), np.random.default_rng(0)
    for trial in range(60):
        damaged = bytearray(whole[: random.integers(1, len(whole))] if trial % 2 else whole)
        for place in random.integers(0, len(damaged), 4 if trial else 0):
            damaged[place] = random.integers(0, 256)
        path.write_bytes(damaged)
        try:
            found = open_depth(path, SOURCE, scale=0.001).at(0)
            assert found.shape == (24, 32)
        except (DataError, UsageError) as error:
            assert "\n" not in str(error)
