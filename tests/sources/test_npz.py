"""Stacks in .npz archives."""

from __future__ import annotations

import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.formats.npy_arrays import array_header
from vid2ev.sources import open_source

STACK = np.random.default_rng(0).uniform(0, 3, (5, 4, 6)).astype(np.float32)


def saved(folder: Path, packed: bool = False, **arrays: object) -> Path:
    (np.savez_compressed if packed else np.savez)(folder / "clip.npz", **arrays)
    return folder / "clip.npz"


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, ">f4"])
def test_frames_one_after_the_other(tmp_path: Path, packed: bool, dtype) -> None:
    stack = STACK.astype(dtype)
    source = open_source(saved(tmp_path, packed, frames=stack), fps=10)
    assert source.size == (6, 4) and source.frames_expected == 5 and source.rewindable
    assert source.duration_expected_s == pytest.approx(0.4)
    for start in (0, 3):
        frames = list(source.frames(start))
        np.testing.assert_array_equal([frame.light for frame in frames], stack[start:].astype(np.float32))
        assert [frame.t_ns for frame in frames] == [k * 100_000_000 for k in range(start, 5)]


def test_codes_and_colour(tmp_path: Path) -> None:
    stack = np.random.default_rng(0).integers(0, 256, (2, 3, 4, 3)).astype(np.uint8)
    path = saved(tmp_path, video=stack, fps=np.array(25))
    with pytest.raises(UsageError, match="--transfer"):
        open_source(path)
    source = open_source(path, transfer="linear", colour="rgb")
    np.testing.assert_array_equal([f.light for f in source.frames()], (stack / 255.0).astype(np.float32))
    assert [f.t_ns for f in source.frames()] == [0, 40_000_000]


@pytest.mark.parametrize(("name", "times", "expected_ns"), [
    ("t_us", [10, 20, 35, 36, 40], [10_000, 20_000, 35_000, 36_000, 40_000]),
    ("timestamps_ns", [0, 1, 2, 3, 4], [0, 1, 2, 3, 4]),
    ("t_ms", [0.5, 1, 2, 3, 4], [500_000, 1_000_000, 2_000_000, 3_000_000, 4_000_000]),
    ("t", [0.0, 0.5, 1.0, 1.5, 2.0], [k * 500_000_000 for k in range(5)]),
    ("timestamps", [0, 1000, 2000, 3000, 4000], [k * 1_000_000 for k in range(5)]),
])  # fmt: skip
def test_times_in_the_archive(tmp_path: Path, name: str, times: list, expected_ns: list[int]) -> None:
    path = saved(tmp_path, frames=STACK, **{name: np.array(times)})
    assert [frame.t_ns for frame in open_source(path).frames()] == expected_ns
    assert [frame.t_ns for frame in open_source(path, fps=1).frames()][1] == 10**9


def test_which_array(tmp_path: Path) -> None:
    other = np.zeros((2, 3, 3), np.float32)
    assert open_source(saved(tmp_path, arr_0=STACK, other=other), fps=1).frames_expected == 5
    assert open_source(saved(tmp_path, depth=STACK, gain=np.ones(3)), fps=1).frames_expected == 5
    np.savez(tmp_path / "clip.npz", STACK)
    assert open_source(tmp_path / "clip.npz", fps=1).frames_expected == 5
    with pytest.raises(DataError, match=r"holds depth \[5, 4, 6\], other \[2, 3, 3\]; expected one"):
        open_source(saved(tmp_path, depth=STACK, other=other), fps=1)
    with pytest.raises(DataError, match="holds x"):
        open_source(saved(tmp_path, x=np.arange(9), y=np.arange(9)), fps=1)


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--fps"):
        open_source(saved(tmp_path, frames=STACK))
    with pytest.raises(DataError, match="3 times for 5 frames; expected one each, or give --fps"):
        open_source(saved(tmp_path, frames=STACK, t=np.zeros(3)))
    with pytest.raises(DataError, match="ascontiguousarray"):
        open_source(saved(tmp_path, frames=np.asfortranarray(STACK)), fps=1)
    with pytest.raises(DataError, match=r"array of type int32"):
        open_source(saved(tmp_path, frames=STACK.astype(np.int32)), fps=1)
    with pytest.raises(DataError, match="'t' is"):
        open_source(saved(tmp_path, frames=STACK, t=np.array(list("abcde"))))
    with pytest.raises(UsageError, match="fps -1"):
        open_source(saved(tmp_path, frames=STACK, fps=-1.0))


def test_a_shape_that_no_array_has_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "clip.npz", "w") as archive:
        archive.writestr("frames.npy", array_header((-5, 4, 6), np.float32) + bytes(480))
    with pytest.raises(DataError, match="array of shape"):
        open_source(tmp_path / "clip.npz", fps=1)


def test_no_code_is_run_from_an_archive(tmp_path: Path) -> None:
    path = tmp_path / "clip.npz"
    np.savez(path, frames=np.array([[[{"an": "object"}]]], dtype=object), t=np.array([{}], dtype=object))
    with pytest.raises(DataError):
        open_source(path)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.97])
def test_a_cut_off_archive_is_refused(tmp_path: Path, share: float) -> None:
    path = saved(tmp_path, True, frames=np.random.default_rng(0).uniform(size=(9, 30, 30)))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(DataError, match=r"clip\.npz"):
        open_source(path, fps=1)


def test_damage_within_is_told(tmp_path: Path) -> None:
    path = saved(tmp_path, True, frames=np.random.default_rng(0).uniform(size=(9, 30, 30)))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(DataError, match=r"clip\.npz: cannot be read beyond frame"):
        list(open_source(path, fps=1).frames())


def test_another_archive_is_no_video(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("notes.txt", "nothing")
    with pytest.raises(DataError, match=r"a\.zip: not a video"):
        open_source(tmp_path / "a.zip")


def test_memory_does_not_grow_with_the_length(tmp_path: Path) -> None:
    path = saved(tmp_path, True, frames=np.zeros((400, 100, 100), np.float32))
    source = open_source(path, fps=100)
    tracemalloc.start()
    for frame in source.frames():
        del frame
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000  # of 16 MB


def test_a_guess_at_the_unit_names_what_ends_it(tmp_path: Path) -> None:
    path, frames, times = tmp_path / "clip.npz", np.zeros((3, 2, 2), np.float32), np.array([1000, 2000, 4000])
    np.savez(path, frames=frames, timestamps=times)
    assert ["end the name of the times in clip.npz with _s, _ms" in said for said in open_source(path).warnings] == [
        True
    ]
    np.savez(path, frames=frames, timestamps_ms=times)
    source = open_source(path)
    assert not source.warnings and [frame.t_ns for frame in source.frames()] == [10**9, 2 * 10**9, 4 * 10**9]
