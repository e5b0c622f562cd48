"""Files of truth: what is written reads back, others read it by formulas of their own, and damage is one sentence."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.truth_files import (
    read_depth,
    read_flow,
    read_mask,
    read_pixel_map,
    write_depth,
    write_flow,
    write_mask,
    write_pixel_map,
)

SHAPES = st.tuples(st.integers(1, 7), st.integers(1, 9))
FLOWS = st.tuples(st.integers(1, 7), st.integers(1, 9), st.just(2))


def depth_of(shape: tuple[int, int] = (24, 32)) -> np.ndarray:
    """Depth from 0.4 m to 60 m, with nothing in a corner and a hole in another."""
    depth = np.geomspace(0.4, 60, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    depth[:3, :4], depth[-2:, -5:] = np.inf, np.nan
    return depth


def flow_of(shape: tuple[int, int] = (24, 32)) -> np.ndarray:
    flow = np.random.default_rng(0).uniform(-200, 200, (*shape, 2)).astype(np.float32)
    flow[5:8, 2:9] = np.nan
    return flow


@pytest.mark.parametrize("suffix", [".npy", ".exr"])
@given(depth=arrays.arrays(np.float32, SHAPES, elements=st.floats(2.0**-60, np.inf, exclude_min=True, width=32)))
def test_depth_reads_back_to_the_bit(tmp_path_factory: pytest.TempPathFactory, suffix: str, depth: np.ndarray) -> None:
    path = tmp_path_factory.getbasetemp() / f"depth{suffix}"
    depth[::3, ::2] = np.nan
    write_depth(path, depth)
    np.testing.assert_array_equal(read_depth(path), depth)


@pytest.mark.skipif(os.name == "nt", reason="names of files are text there")
@pytest.mark.parametrize("suffix", [".npy", ".exr", ".png"])
def test_depth_in_a_folder_whose_name_is_no_text_reads_back(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / os.fsdecode(b"of \xff") / f"depth{suffix}"
    path.parent.mkdir()
    write_depth(path, np.full((2, 3), 4, np.float32), 0.5)
    assert np.array_equal(read_depth(path), np.full((2, 3), 4)) and {*path.parent.iterdir()} >= {path}


@pytest.mark.parametrize("m_per_code", [0.001, 1 / 256, 0.1])
def test_depth_as_png_is_within_half_a_code(tmp_path: Path, m_per_code: float) -> None:
    depth = depth_of()
    write_depth(tmp_path / "depth.png", depth, m_per_code)
    found = read_depth(tmp_path / "depth.png")
    np.testing.assert_array_equal(np.isnan(found), np.isnan(depth))
    np.testing.assert_array_equal(np.isinf(found), np.isinf(depth))
    known = np.isfinite(depth)
    assert np.abs(found[known] - depth[known]).max() <= m_per_code / 2 * (1 + 1e-4)


def test_depth_as_png_is_read_by_its_formula(tmp_path: Path) -> None:
    write_depth(tmp_path / "000001.png", depth_of())
    codes = cv2.imread(str(tmp_path / "000001.png"), cv2.IMREAD_UNCHANGED)
    key, value = (tmp_path / "depth.txt").read_text().split()
    assert codes.dtype == np.uint16 and key == "m_per_code" and float(value) == 0.001
    assert codes[0, 0] == 65535 and codes[-1, -1] == 0
    np.testing.assert_allclose(codes[10, 10] * float(value), depth_of()[10, 10], atol=0.0005)


def test_what_is_very_near_is_not_unknown(tmp_path: Path) -> None:
    write_depth(tmp_path / "depth.png", np.full((2, 2), 1e-5, np.float32))
    np.testing.assert_allclose(read_depth(tmp_path / "depth.png"), 0.001)


def test_what_is_far_is_not_nothing(tmp_path: Path) -> None:
    """The farthest code but one is a depth; what would have the last one's is refused."""
    write_depth(tmp_path / "a.png", np.full((2, 3), 65534.4, np.float32), m_per_code=1.0)
    assert (read_depth(tmp_path / "a.png") == 65534).all()
    with pytest.raises(UsageError, match="there are 65535 m"):
        write_depth(tmp_path / "b.png", np.full((2, 3), 65535, np.float32), m_per_code=1.0)


def test_a_folder_has_one_scale(tmp_path: Path) -> None:
    write_depth(tmp_path / "0.png", depth_of())
    write_depth(tmp_path / "1.png", depth_of())
    with pytest.raises(UsageError, match=r"depth.txt says 0.001, not 0.01"):
        write_depth(tmp_path / "2.png", depth_of(), 0.01)
    assert not (tmp_path / "2.png").exists()
    (tmp_path / "depth.txt").unlink()
    with pytest.raises(DataError, match=r"needs .*depth.txt beside it"):
        read_depth(tmp_path / "0.png")
    for text in ("", "m_per_code", "m_per_code x", "m_per_code 0", "m_per_code nan", "codes_per_px 3", "a b c"):
        (tmp_path / "depth.txt").write_text(text)
        with pytest.raises(DataError, match=r"depth.txt"):
            read_depth(tmp_path / "0.png")


@pytest.mark.parametrize("number", [float, np.float64, np.float32])
def test_a_scale_may_be_a_number_of_numpy(tmp_path: Path, number: type) -> None:
    write_depth(tmp_path / "0.png", np.ones((2, 3)), m_per_code=number(0.25))
    assert (read_depth(tmp_path / "0.png") == 1).all()
    write_flow(tmp_path / "1.png", np.ones((2, 3, 2)), codes_per_px=np.int64(number(64)))
    assert (read_flow(tmp_path / "1.png") == 1).all()


@pytest.mark.parametrize("suffix", [".npz", ".flo"])
@given(flow=arrays.arrays(np.float32, FLOWS, elements=st.floats(-(2.0**29), 2.0**29, width=32)))
def test_flow_reads_back_to_the_bit(tmp_path_factory: pytest.TempPathFactory, suffix: str, flow: np.ndarray) -> None:
    path = tmp_path_factory.getbasetemp() / f"flow{suffix}"
    flow[::3, ::2] = np.nan
    write_flow(path, flow)
    np.testing.assert_array_equal(read_flow(path), flow)


@pytest.mark.parametrize("codes_per_px", [64, 128])
def test_flow_as_png_is_within_half_a_code(tmp_path: Path, codes_per_px: int) -> None:
    write_flow(tmp_path / "flow.png", flow_of(), codes_per_px)
    np.testing.assert_allclose(read_flow(tmp_path / "flow.png"), flow_of(), atol=0.5 / codes_per_px)
    (tmp_path / "flow.txt").unlink()
    np.testing.assert_allclose(read_flow(tmp_path / "flow.png", codes_per_px), flow_of(), atol=0.5 / codes_per_px)
    with pytest.raises(DataError, match=r"needs .*flow.txt beside it, with a line such as 'codes_per_px 128'"):
        read_flow(tmp_path / "flow.png")


def test_opencv_reads_and_writes_flo(tmp_path: Path) -> None:
    flow = flow_of()
    write_flow(tmp_path / "flow.flo", flow)
    theirs = cv2.readOpticalFlow(str(tmp_path / "flow.flo"))
    known = ~np.isnan(flow).any(axis=2)
    np.testing.assert_array_equal(theirs[known], flow[known])
    assert (np.abs(theirs[~known]) > 1e9).all()  # (which Middlebury takes for unknown)
    cv2.writeOpticalFlow(str(tmp_path / "theirs.flo"), np.nan_to_num(flow))
    np.testing.assert_array_equal(read_flow(tmp_path / "theirs.flo"), np.nan_to_num(flow))


def test_flow_as_png_is_read_as_kitti_and_dsec_say(tmp_path: Path) -> None:
    """KITTI: u = (I(u, v, 1) - 2^15) / 64, valid = I(u, v, 3); DSEC: the same with 128; the channels are R, G, B."""
    for codes_per_px in (64, 128):
        folder = tmp_path / str(codes_per_px)
        folder.mkdir()
        write_flow(folder / "flow.png", flow_of(), codes_per_px)
        blue_green_red = cv2.imread(str(folder / "flow.png"), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
        valid, v, u = (blue_green_red[..., channel].astype(np.float64) for channel in range(3))
        np.testing.assert_array_equal(valid, ~np.isnan(flow_of()[..., 0]))
        known = valid == 1
        for found, truth in ((u, flow_of()[..., 0]), (v, flow_of()[..., 1])):
            np.testing.assert_allclose((found[known] - 2**15) / codes_per_px, truth[known], atol=0.5 / codes_per_px)


def test_depth_of_renderers_is_read(tmp_path: Path) -> None:
    import OpenEXR

    for name in ("ViewLayer.Depth.Z", "V", "depth.Y"):
        channels = {name: depth_of().astype(np.float16), "ViewLayer.Combined.B": depth_of()}
        OpenEXR.File({}, channels).write(str(tmp_path / "0001.exr"))
        np.testing.assert_array_equal(read_depth(tmp_path / "0001.exr"), depth_of().astype(np.float16))
    OpenEXR.File({}, {"B": depth_of()}).write(str(tmp_path / "0001.exr"))
    with pytest.raises(DataError, match="has no channel Z of depth, only B"):
        read_depth(tmp_path / "0001.exr")


def test_half_known_flow_is_not_known(tmp_path: Path) -> None:
    flow = np.zeros((2, 2, 2), np.float32)
    flow[0, 0, 1] = np.nan
    for name in ("flow.png", "flow.flo"):
        write_flow(tmp_path / name, flow)
        assert np.isnan(read_flow(tmp_path / name)).sum() == 2


def test_masks_and_pixel_maps_read_back(tmp_path: Path) -> None:
    mask = np.random.default_rng(0).random((17, 23)) < 0.5
    write_mask(tmp_path / "valid.png", mask)
    np.testing.assert_array_equal(read_mask(tmp_path / "valid.png"), mask)
    seen = cv2.imread(str(tmp_path / "valid.png"), cv2.IMREAD_UNCHANGED)
    assert seen.dtype == np.uint8 and seen.shape == mask.shape and set(np.unique(seen)) == {0, 255}
    write_pixel_map(tmp_path / "map.npz", flow_of())
    np.testing.assert_array_equal(read_pixel_map(tmp_path / "map.npz"), flow_of())
    with np.load(tmp_path / "map.npz") as stored:
        assert list(stored) == ["pixels"]


def test_the_same_truth_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("flow.npz", "flow.flo", "flow.png"):
        write_flow(tmp_path / name, flow_of())
        first = (tmp_path / name).read_bytes()
        write_flow(tmp_path / name, flow_of())
        assert (tmp_path / name).read_bytes() == first
    assert not list(tmp_path.glob("*.new"))


@pytest.mark.parametrize(
    ("depth", "name", "sentence"),
    [
        (np.zeros((2, 2), np.float32), "a.npy", "depth is greater than 0, +inf or NaN; found 0 m"),
        (np.full((2, 2), -np.inf, np.float32), "a.exr", "found -inf m"),
        (np.ones((2, 2, 2), np.float32), "a.npy", "depth is float [H, W], not float32 [2, 2, 2]"),
        (np.ones((2, 2), np.int32), "a.npy", "not int32"),
        (np.ones((0, 2), np.float32), "a.npy", "not float32 [0, 2]"),
        (np.ones((2, 2), np.float32), "a.tiff", "depth is kept as .npy or .exr or .png, not '.tiff'"),
        (
            np.full((2, 2), 70, np.float32),
            "a.png",
            "0.001 reaches 65.534 m, and there are 70 m; take 0.00107",
        ),
    ],
)
def test_what_is_no_depth_is_refused(tmp_path: Path, depth: np.ndarray, name: str, sentence: str) -> None:
    with pytest.raises(UsageError) as refusal:
        write_depth(tmp_path / name, depth)
    assert sentence in str(refusal.value) and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("flow", "name", "sentence"),
    [
        (np.full((2, 2, 2), np.inf, np.float32), "a.npz", "found an infinite one"),
        (np.zeros((2, 2), np.float32), "a.npz", "flow is float [H, W, 2]"),
        (np.zeros((2, 2, 3), np.float32), "a.npz", "not float32 [2, 2, 3]"),
        (np.full((2, 2, 2), 300, np.float32), "a.png", "128 codes in a pixel reach 256 px, and there are 300"),
        (np.full((2, 2, 2), 2e9, np.float32), "a.flo", "takes 2e+09 px for not known; choose .npz"),
        (np.zeros((2, 2, 2), np.float32), "a.npy", "flow is kept as .npz or .flo or .png, not '.npy'"),
    ],
)
def test_what_is_no_flow_is_refused(tmp_path: Path, flow: np.ndarray, name: str, sentence: str) -> None:
    with pytest.raises(UsageError) as refusal:
        write_flow(tmp_path / name, flow)
    assert sentence in str(refusal.value) and not list(tmp_path.iterdir())


def test_what_is_no_mask_or_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a mask is bool"):
        write_mask(tmp_path / "a.png", np.zeros((2, 2), np.uint8))
    with pytest.raises(UsageError, match="pixel map is float"):
        write_pixel_map(tmp_path / "a.npz", np.zeros((2, 2), np.float32))
    with pytest.raises(UsageError, match=r"kept as .npz"):
        write_pixel_map(tmp_path / "a.png", np.zeros((2, 2, 2), np.float32))
    with pytest.raises(OSError):
        write_mask(tmp_path / "nowhere" / "a.png", np.zeros((2, 2), bool))
    with pytest.raises(OSError):
        write_depth(tmp_path / "nowhere" / "a.exr", depth_of())


def test_pictures_of_other_kinds_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    (tmp_path / "depth.txt").write_text("m_per_code 1")
    for picture in (np.zeros((3, 3), np.uint8), np.zeros((3, 3, 3), np.uint16), np.zeros((3, 3, 4), np.uint8)):
        cv2.imwrite(str(path), picture)
        with pytest.raises(DataError, match="depth has one channel of 16 bits"):
            read_depth(path)
    for picture in (np.zeros((3, 3), np.uint16), np.zeros((3, 3, 3), np.uint8)):
        cv2.imwrite(str(path), picture)
        with pytest.raises(DataError, match="flow has three channels of 16 bits"):
            read_flow(path, 64)
    cv2.imwrite(str(path), np.zeros((3, 3), np.uint16))
    with pytest.raises(DataError, match="a mask has one channel of 8 bits"):
        read_mask(path)
    np.savez(tmp_path / "a.npz", other=1)
    with pytest.raises(DataError, match="has no array 'flow', only other"):
        read_flow(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", pixels=np.array([{}], object))
    with pytest.raises(DataError, match="cannot be read"):
        read_pixel_map(tmp_path / "a.npz")


@pytest.mark.parametrize("name", ["d.npy", "d.exr", "d.png", "f.npz", "f.flo", "f.png", "m.png", "p.npz"])
def test_damage_is_never_a_traceback(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    write, read, truth = {
        "d": (write_depth, read_depth, depth_of()),
        "f": (write_flow, read_flow, flow_of()),
        "m": (write_mask, read_mask, np.ones((30, 40), bool)),
        "p": (write_pixel_map, read_pixel_map, flow_of()),
    }[name[0]]
    write(path, truth)
    whole = path.read_bytes()
    read(path)
    for attempt in range(60):
        random = np.random.default_rng(attempt)
        data = bytearray(whole)
        for _ in range(random.integers(1, 4)):
            early = int(random.integers(0, min(len(data), 300)))
            at = early if random.random() < 0.5 else int(random.integers(len(data)))
            data[at : at + int(random.integers(0, 5))] = random.bytes(int(random.integers(0, 5)))
        path.write_bytes(data[: len(data) if random.random() < 0.7 else int(random.integers(len(data)))])
        try:
            assert isinstance(read(path), np.ndarray)
        except DataError as error:
            assert "\n" not in str(error)
    path.unlink()
    with pytest.raises(UsageError, match="no such file"):
        read(path)
