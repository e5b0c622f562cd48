"""Stacks in .npy files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.light.transfer import code_table
from vid2ev.sources import open_source


def saved(folder: Path, array: np.ndarray) -> Path:
    np.save(folder / "clip.npy", array)
    return folder / "clip.npy"


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_floating_point_is_linear_light(tmp_path: Path, dtype) -> None:
    stack = np.random.default_rng(0).uniform(0, 3, (4, 5, 6)).astype(dtype)
    stack[1, 2, 3] = np.nan
    source = open_source(saved(tmp_path, stack), fps=1000)
    assert source.size == (6, 5) and source.frames_expected == 4
    for k, frame in enumerate(source.frames()):
        np.testing.assert_array_equal(frame.light, stack[k].astype(np.float32))
        assert frame.light.dtype == np.float32 and frame.t_ns == k * 1_000_000


@pytest.mark.parametrize(("dtype", "bits"), [(np.uint8, 8), (np.uint16, 16), (">u2", 16)])
def test_integers_need_to_be_told_what_they_mean(tmp_path: Path, dtype, bits: int) -> None:
    stack = np.random.default_rng(0).integers(0, 2**bits, (3, 5, 6)).astype(dtype)
    path = saved(tmp_path, stack)
    with pytest.raises(UsageError, match="--transfer"):
        open_source(path, fps=30)
    frame = next(open_source(path, fps=30, transfer="srgb").frames(2))
    np.testing.assert_array_equal(frame.light, code_table("srgb", bits)[stack[2]])


@pytest.mark.parametrize("dtype", [np.uint8, "<u2", ">u2"])
def test_colour(tmp_path: Path, dtype) -> None:
    stack = np.zeros((1, 1, 3, 3), dtype)
    stack[0, 0] = np.diag([np.iinfo(dtype).max] * 3)
    (frame,) = open_source(saved(tmp_path, stack), fps=1, transfer="linear").frames()
    np.testing.assert_allclose(frame.light[0], [0.2126, 0.7152, 0.0722], atol=1e-6)


def test_any_memory_order_and_byte_order(tmp_path: Path) -> None:
    stack = np.random.default_rng(0).uniform(0, 1, (3, 4, 5))
    for array in (np.asfortranarray(stack), stack.astype(">f8")):
        frames = list(open_source(saved(tmp_path, array), fps=1).frames())
        np.testing.assert_array_equal([frame.light for frame in frames], stack.astype(np.float32))


@pytest.mark.parametrize("suffix", [".npy", ".txt"])
def test_times_beside_the_file(tmp_path: Path, suffix: str) -> None:
    path = saved(tmp_path, np.zeros((3, 2, 2), np.float32))
    with pytest.raises(UsageError, match=r"clip_timestamps\.npy"):
        open_source(path)
    stamps = np.array([1000, 2000, 4000])
    if suffix == ".npy":
        np.save(tmp_path / "clip_timestamps.npy", stamps)
    else:
        np.savetxt(tmp_path / "clip_timestamps.txt", stamps, fmt="%d")
    source = open_source(path)
    assert [frame.t_ns for frame in source.frames()] == [1_000_000, 2_000_000, 4_000_000]
    assert source.describe()["timestamps_unit"] == "us (by spacing)"
    remedy = (
        "write clip_timestamps.npy as seconds in floating" if suffix == ".npy" else "begin clip_timestamps.txt with"
    )
    assert [remedy in warning for warning in source.warnings] == [True]
    if suffix == ".npy":
        np.save(tmp_path / "clip_timestamps.npy", stamps / 1e3)
        said = open_source(path)
        assert said.describe()["timestamps_unit"] == "s" and not said.warnings
        assert [frame.t_ns for frame in said.frames()] == [10**9, 2 * 10**9, 4 * 10**9]
    np.save(tmp_path / "clip_timestamps.npy", 2 * stamps)
    others = open_source(path).describe()
    assert others != source.describe() and others.keys() == source.describe().keys()
    assert "are taken for us" in source.warnings[0]
    np.save(path, np.zeros((4, 2, 2), np.float32))
    with pytest.raises(DataError, match="3 times"):
        open_source(path)


@pytest.mark.parametrize(
    "array",
    [np.zeros((4, 4)), np.zeros((0, 4, 4)), np.zeros((2, 4, 4, 4)), np.zeros((2, 2, 2), np.int32), np.zeros(3, "U4")],
)
def test_other_arrays_are_refused(tmp_path: Path, array: np.ndarray) -> None:
    with pytest.raises(DataError, match="array of"):
        open_source(saved(tmp_path, array), fps=1)


@pytest.mark.parametrize("shape", [(0, 5, 6), (3, 0, 6), (3, 5, 6, 1), (5, 6)])
def test_what_is_wrong_with_a_shape_is_said(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(DataError, match=r"expected \[N, H, W\] or \[N, H, W, 3\], each at least 1; bring"):
        open_source(saved(tmp_path, np.zeros(shape, np.float32)), fps=30)


@pytest.mark.parametrize("shape", [(2, 1, 65536), (2, 65536, 1)], ids=str)
def test_pictures_larger_than_any_lens_is_described_for_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    np.save(tmp_path / "wide.npy", np.ones(shape, np.float32))
    with pytest.raises(DataError, match="at most 65535 along each side"):
        open_source(tmp_path / "wide.npy", fps=30, crop="1x1")
    np.save(tmp_path / "fits.npy", np.ones([min(side, 65535) for side in shape], np.float32))
    assert max(open_source(tmp_path / "fits.npy", fps=30).size) == 65535


@pytest.mark.parametrize("content", [b"", b"not numpy", b"\x93NUMPY\x01\x00", None])
def test_broken_files_are_refused(tmp_path: Path, content: bytes | None) -> None:
    path = saved(tmp_path, np.zeros((9, 9, 9)))
    path.write_bytes(path.read_bytes()[:3000] if content is None else content)
    with pytest.raises(DataError, match=r"clip\.npy"):
        open_source(path, fps=1)


@pytest.mark.parametrize("shape", [(2**32, 2**32, 2), (2**62, 4, 4), (2**63, 4, 4), (10**30, 4, 4)], ids=str)
def test_a_shape_that_no_file_can_hold_is_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with open(tmp_path / "clip.npy", "wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f4", "fortran_order": False, "shape": shape})
        file.write(bytes(400))
    with pytest.raises(DataError, match=r"clip\.npy: not a \.npy array"):
        open_source(tmp_path / "clip.npy", fps=1)


def test_no_code_is_run_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "clip.npy"
    np.save(path, np.array([[[{"an": "object"}]]], dtype=object), allow_pickle=True)
    with pytest.raises(DataError):
        open_source(path, fps=1)
