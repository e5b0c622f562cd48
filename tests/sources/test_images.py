"""Folders of images: order, times, depth, refusals."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.light.transfer import CURVES, code_table
from vid2ev.sources import open_source


def write(folder: Path, names: list[str], dtype=np.uint8, shape=(6, 8), stamps: str | None = None) -> list[np.ndarray]:
    """Random images under these names, returned in the order of the names."""
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype) for _ in names]
    for name, picture in zip(names, pictures, strict=True):
        assert cv2.imwrite(str(folder / name), picture)
    if stamps is not None:
        (folder / "timestamps.txt").write_text(stamps)
    return pictures


@pytest.mark.parametrize(("dtype", "bits"), [(np.uint8, 8), (np.uint16, 16)])
def test_codes_of_either_depth_are_srgb(tmp_path: Path, dtype, bits: int) -> None:
    pictures = write(tmp_path, [f"{k}.png" for k in range(3)], dtype)
    source = open_source(tmp_path, fps=100)
    frames = list(source.frames())
    assert source.size == (8, 6) and source.frames_expected == 3 and source.warnings == []
    assert [frame.t_ns for frame in frames] == [0, 10_000_000, 20_000_000]
    for frame, picture in zip(frames, pictures, strict=True):
        np.testing.assert_array_equal(frame.light, code_table("srgb", bits)[picture])
        assert frame.light.dtype == np.float32 and frame.original
    linear = next(open_source(tmp_path, fps=100, transfer="linear").frames())
    np.testing.assert_array_equal(linear.light, code_table("linear", bits)[pictures[0]])


@pytest.mark.parametrize("bits", [10, 12])
def test_codes_of_a_sensor_in_16_bits_are_light_where_their_bits_are_said(tmp_path: Path, bits: int) -> None:
    codes = np.arange(48, dtype=np.uint16).reshape(6, 8) * ((2**bits - 1) // 47)
    cv2.imwrite(str(tmp_path / "0.png"), codes)
    np.save(tmp_path / "clip.npy", codes[None])
    for path in (tmp_path, tmp_path / "clip.npy"):
        plain = open_source(path, fps=1, transfer="linear")
        assert len(plain.warnings) == 1 and f"linear:{bits}bit" in plain.warnings[0]
        source = open_source(path, fps=1, transfer=f"linear:{bits}bit")
        assert source.warnings == [] and source.describe()["bits"] == bits
        np.testing.assert_array_equal(next(source.frames()).light, code_table("linear", bits)[codes])
    moved = open_source(tmp_path / "0.png", transfer=f"gamma:2:{bits}bit", motion="pan:speed=1")
    assert moved.describe()["transfer"] == "gamma:2" and moved.describe()["bits"] == bits


def test_bits_that_codes_cannot_have_are_refused(tmp_path: Path) -> None:
    write(tmp_path, ["0.png"])
    for transfer in ("linear:10bit", "linear:0bit", "linear:17bit", "linear:manybit", "linear:0_8bit", "x:10bit"):
        with pytest.raises(UsageError, match=r"bit|transfer 'x'"):
            open_source(tmp_path, fps=1, transfer=transfer)


def test_frame_10_comes_after_frame_9(tmp_path: Path) -> None:
    names = ["frame9.png", "frame10.png", "frame100.png"]
    pictures = write(tmp_path, names)
    for frame, picture in zip(open_source(tmp_path, fps=1).frames(), pictures, strict=True):
        np.testing.assert_array_equal(frame.light, code_table("srgb", 8)[picture])


def test_colour_is_red_green_blue_and_transparency_is_ignored(tmp_path: Path) -> None:
    blue_green_red_alpha = np.zeros((1, 3, 4), np.uint8)
    blue_green_red_alpha[0, 0, 2] = blue_green_red_alpha[0, 1, 1] = blue_green_red_alpha[0, 2, 0] = 255
    cv2.imwrite(str(tmp_path / "a.png"), blue_green_red_alpha)
    (frame,) = open_source(tmp_path, fps=1).frames()
    np.testing.assert_allclose(frame.light[0], [0.2126, 0.7152, 0.0722], atol=1e-6)


def test_timestamps_are_honoured(tmp_path: Path) -> None:
    write(tmp_path, ["0.png", "1.png", "2.png"], stamps="1.5\n1.500001\n2\n")
    source = open_source(tmp_path)
    assert [frame.t_ns for frame in source.frames()] == [1_500_000_000, 1_500_001_000, 2_000_000_000]
    assert source.describe()["timestamps_unit"] == "s"
    assert [frame.t_ns for frame in open_source(tmp_path, fps=4).frames()] == [0, 250_000_000, 500_000_000]


def test_times_go_to_the_images_that_their_lines_name(tmp_path: Path) -> None:
    write(tmp_path, ["1.png", "2.png", "10.png"], stamps="rgb/1.png,0.0\nrgb/2.png,0.1\nrgb/10.png,0.2\n")
    assert [frame.t_ns for frame in open_source(tmp_path).frames()] == [0, 100_000_000, 200_000_000]
    (tmp_path / "timestamps.txt").write_text("1.png 0.0\n10.png 0.1\n2.png 0.2\n")  # (as text is sorted)
    with pytest.raises(DataError, match=r"names 10\.png where the images, in natural order, have 2\.png"):
        open_source(tmp_path)
    (tmp_path / "timestamps.txt").write_text("1.png 0.0\n10.png 0.1\n")
    with pytest.raises(DataError, match="2 times for 3 images"):
        open_source(tmp_path)


def test_times_may_be_called_as_hs_ergb_calls_them(tmp_path: Path) -> None:
    write(tmp_path, ["1.png", "2.png"])
    (tmp_path / "timestamp.txt").write_text("1000\n7666\n")
    source = open_source(tmp_path)
    assert [frame.t_ns for frame in source.frames()] == [1_000_000, 7_666_000]
    assert ["begin timestamp.txt with" in warning for warning in source.warnings] == [True]
    (tmp_path / "timestamps.txt").write_text("# us\n0\n40\n")  # our own name wins
    source = open_source(tmp_path)
    assert [frame.t_ns for frame in source.frames()] == [0, 40_000] and source.warnings == []


@pytest.mark.parametrize("step", [1000, 6667, 35_714, 999_999])
@pytest.mark.parametrize("word", ["{}.0", "{:.18e}", "{}.25"])
def test_microseconds_of_hs_ergb_may_be_written_with_decimals(tmp_path: Path, step: int, word: str) -> None:
    """As numpy.savetxt and Time Lens's own writer have them; seconds in such a file stay seconds."""
    write(tmp_path, ["1.png", "2.png", "3.png"])
    text = "".join(f"{word.format(k * step)}\n" for k in range(3))
    (tmp_path / "timestamp.txt").write_text(text)
    source = open_source(tmp_path)
    first, *others = [frame.t_ns for frame in source.frames()]
    assert [t_ns - first for t_ns in others] == [1000 * step, 2000 * step]
    assert ["taken for us" in warning for warning in source.warnings] == [True]
    (tmp_path / "timestamp.txt").write_text("0.0\n0.5\n1e0\n")
    source = open_source(tmp_path)
    assert [frame.t_ns for frame in source.frames()] == [0, 500_000_000, 10**9] and source.warnings == []
    (tmp_path / "timestamp.txt").write_text("# unit: s\n" + text)
    assert next(open_source(tmp_path).frames(1)).t_ns >= 10**9 * step
    (tmp_path / "timestamp.txt").rename(tmp_path / "timestamps.txt")
    (tmp_path / "timestamps.txt").write_text(text)  # (by this name decimals are seconds)
    assert next(open_source(tmp_path).frames(1)).t_ns >= 10**9 * step


def test_start_skips_without_changing_what_follows(tmp_path: Path) -> None:
    write(tmp_path, [f"{k}.png" for k in range(5)], stamps="0\n40\n40\n80\n120\n")
    source = open_source(tmp_path)
    whole, rest = list(source.frames()), list(source.frames(2))
    assert [frame.t_ns for frame in whole] == [0, 40_000_000, 80_000_000, 120_000_000]
    assert [frame.t_ns for frame in rest] == [frame.t_ns for frame in whole[2:]]
    np.testing.assert_array_equal(rest[0].light, whole[2].light)
    assert source.warnings[1:] == ["dropped 1 of 5 frames whose time is not after the frame before"]
    assert list(source.frames(9)) == []


def test_pages_that_are_not_read_are_told_of(tmp_path: Path) -> None:
    pages = [np.full((4, 5), code, np.uint8) for code in (10, 20)]
    for name in ("0.tif", "1.tif"):
        assert cv2.imwritemulti(str(tmp_path / name), pages)
    source = open_source(tmp_path, fps=30)
    assert source.warnings == ["0.tif has 2 pages; of images in a folder the first is read"]
    assert len({float(frame.light.mean()) for frame in source.frames()}) == 1
    assert not open_source(tmp_path / "0.tif", fps=30).warnings
    cv2.imwrite(str(tmp_path / "0.tif"), pages[0])
    assert not open_source(tmp_path, fps=30).warnings


def test_float_tiff_is_light(tmp_path: Path) -> None:
    light = np.linspace(0, 12, 48, dtype=np.float32).reshape(6, 8)
    cv2.imwrite(str(tmp_path / "a.tiff"), light)
    source = open_source(tmp_path, fps=1)
    np.testing.assert_array_equal(next(source.frames()).light, light)
    assert source.describe()["transfer"] == "linear"


def test_other_files_in_the_folder_do_not_matter(tmp_path: Path) -> None:
    write(tmp_path, ["0.png"])
    (tmp_path / "notes.md").write_text("not an image")
    (tmp_path / "of_others.png").mkdir()
    assert open_source(tmp_path, fps=1).frames_expected == 1


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (["b.mp4", "a.mkv", "notes.md"], r"the videos or folders of images in it, such as .*/a\.mkv$"),
        (["b/0.png", "c/notes.md"], r"the videos or folders of images in it, such as .*/b$"),
        (["b/manifest.json", "a/manifest.json", "README.md"], r"the recordings in it, such as .*/a$"),
        (["b/c/manifest.json", "notes.md"], r"expected \.png, "),
        (["b/2/0.png", "a/c/3/0.png", "a/1.txt"], r"the folders of clips in it, such as .*/b$"),
        (["close/seq/images_corrected/0.png", "README.md"], r"the folders of clips in it, such as .*/close/seq$"),
        (["close/test/seq/images_corrected/0.png"], r"the folders of clips in it, such as .*/close/test/seq$"),
    ],
)
def test_a_folder_of_sources_or_recordings_says_which_could_be_given(
    tmp_path: Path, made: list[str], said: str
) -> None:
    for name in made:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    with pytest.raises(DataError, match=f"no images in this folder; {'give one of ' * (said[:3] == 'the')}{said}"):
        open_source(tmp_path, fps=30)


def test_a_folder_of_event_files_is_one_of_event_files(tmp_path: Path) -> None:
    for name in ("000000.npz", "000001.npz"):
        np.savez(tmp_path / name, t=[1], x=[1], y=[1], p=[1])
    with pytest.raises(DataError, match=r"give one of the event files in it, such as .*/000000\.npz$"):
        open_source(tmp_path)


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no images in this folder; expected \.png, "):
        open_source(tmp_path, fps=30)
    write(tmp_path, ["0.png", "1.png"])
    with pytest.raises(UsageError, match="--fps"):
        open_source(tmp_path)
    (tmp_path / "timestamps.txt").write_text("0\n33\n66\n")
    with pytest.raises(DataError, match=r"3 times for 2 images; .*, or give --fps"):
        open_source(tmp_path)


def test_a_transfer_that_is_none_names_all_that_are(tmp_path: Path) -> None:
    write(tmp_path, ["0.png"], np.uint16)
    with pytest.raises(UsageError, match=r"'Linear' \(did you mean linear\?\): expected auto, ") as refused:
        open_source(tmp_path, fps=1, transfer="Linear")
    for name in ("auto", *CURVES, "gamma:2.2", "linear:10bit"):
        assert name in str(refused.value)
        open_source(tmp_path, fps=1, transfer=name)


def test_an_image_of_another_size_is_named(tmp_path: Path) -> None:
    write(tmp_path, ["0.png", "1.png"])
    write(tmp_path, ["2.png"], shape=(6, 9))
    with pytest.raises(DataError, match=r"2\.png: 9x6 pixels, expected 8x6"):
        list(open_source(tmp_path, fps=1).frames())


@pytest.mark.parametrize("content", [b"", b"not a png at all", None])
def test_a_broken_image_is_named(tmp_path: Path, content: bytes | None) -> None:
    write(tmp_path, ["0.png", "1.png"], shape=(64, 64))
    whole = (tmp_path / "1.png").read_bytes()
    (tmp_path / "1.png").write_bytes(whole[: len(whole) // 2] if content is None else content)
    with pytest.raises(DataError, match=r"1\.png"):
        list(open_source(tmp_path, fps=1).frames())


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["a_1.png", "a_2.png", "a_4.png"], "none between a_2.png and a_4.png; with --fps"),
        (["a010.png", "a020.png", "a040.png", "a060.png", "a070.png"], "a040.png, nor in 1 other gap; with --fps"),
        (["1.png", "2.png", "4.png", "6.png", "9.png"], "between 2.png and 4.png, nor in 2 other gaps;"),
        (["a_1.png", "a_3.png"], ""),  # every second one
        (["a_10.png", "a_20.png", "a_30.png"], ""),
        (["a_1.png", "b_2.png", "b_4.png"], ""),  # names that tell more than a number
        (["a_1.png", "a_01.png", "a_4.png"], ""),
        (["one.png", "two.png"], ""),
        (["7.png"], ""),
    ],
)
def test_numbers_that_are_missing_are_remarked_on_where_no_times_are_given(
    tmp_path: Path, names: list[str], said: str
) -> None:
    write(tmp_path, names)
    source = open_source(tmp_path, fps=10)
    assert [frame.t_ns for frame in source.frames()] == [k * 10**8 for k in range(len(names))]
    assert len(source.warnings) == bool(said) and all(said in warning for warning in source.warnings)
    (tmp_path / "timestamps.txt").write_text("".join(f"{k}.5\n" for k in range(len(names))))
    assert open_source(tmp_path).warnings == []
