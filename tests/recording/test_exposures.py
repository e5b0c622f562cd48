"""Pictures of a frame sensor as files: what is in them, and that an interruption changes no byte."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.light.tags import UNSPECIFIED
from vid2ev.light.transfer import code_table
from vid2ev.recording.exposures import KINDS, ExposureFiles, read_codes, read_spans, write_codes
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sources import open_source
from vid2ev.sources.times import read_timestamps
from vid2ev.stream.exposures import Exposure

ALL = tuple(KINDS)
SPEC = CisSpec(frame_rate_hz=29.97, exposure_us=5000, line_us=12.5)


def exposures(n: int = 7, shape: tuple[int, ...] = (15, 22, 3), seed: int = 0) -> list[Exposure]:
    """Pictures that a moving wave makes, at the times of the sensor."""
    height, width = shape[:2]
    cis = Cis(SPEC.model_copy(update={"colour": len(shape) == 3}), (width, height), seed)
    x, made, k = np.arange(width), [], 0
    while len(made) < n:
        light = np.broadcast_to(0.5 + 0.4 * np.sin(x / 3 + k / 5), (height, width)).astype(np.float32)
        made += cis.step(np.stack([light, light / 2, light * 0], axis=2) if len(shape) == 3 else light, k * 5_000_000)
        k += 1
    return made[:n]


def files(folder: Path, kinds: Sequence[str] = ALL, rate_hz: float = SPEC.frame_rate_hz) -> ExposureFiles:
    return ExposureFiles(folder, kinds, SPEC.picture_codes(), SPEC.curve, rate_hz)


def written(tmp_path: Path, made: Sequence[Exposure], kinds: Sequence[str] = ALL, rate_hz: float = 29.97) -> Path:
    into, at_work = tmp_path / "whole", files(tmp_path / "work", kinds, rate_hz)
    into.mkdir()
    for exposure in made:
        at_work.add(exposure)
    at_work.finish(into)
    return into


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("shape", [(15, 22, 3), (15, 22), (1, 1, 3), (2, 4)])
def test_raw_pictures_are_the_codes_as_others_read_them(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """FFmpeg reads PNG by itself, without OpenCV."""
    made = exposures(3, shape)
    folder = written(tmp_path, made, ["raw"]) / "raw"
    assert sorted(path.name for path in folder.glob("*.png")) == ["000000.png", "000001.png", "000002.png"]
    for k, exposure in enumerate(made):
        with av.open(str(folder / f"{k:06d}.png")) as container:
            found = next(container.decode(video=0))
        coded = "rgb48" if len(shape) == 3 else "gray16"
        assert found.format.name == f"{coded}be"  # (PNG is big-endian)
        assert np.array_equal(found.to_ndarray(format=f"{coded}le"), exposure.codes)
        assert np.array_equal(read_codes(folder / f"{k:06d}.png"), exposure.codes)


@pytest.mark.parametrize("rate_hz", [30000 / 1001, 100 / 3, 999_999.9999, 1 / 3, 1e-5, 1e-6, 1e-300])
def test_the_film_has_the_rate_of_the_sensor_or_the_nearest_that_films_have(tmp_path: Path, rate_hz: float) -> None:
    """Both terms of a film's rate have 31 bits, and a picture of it lasts for a day at most."""
    path = written(tmp_path, exposures(3), ["mp4"], rate_hz) / "frames.mp4"
    with av.open(str(path)) as film:
        times_s = [float(frame.pts * frame.time_base) for frame in film.decode(video=0)]
    assert times_s == pytest.approx([k / max(rate_hz, 1e-5) for k in range(3)], rel=1e-6)


@pytest.mark.parametrize("shape", [(15, 22, 3), (15, 22)])
def test_pictures_of_eight_bits_have_the_curve(tmp_path: Path, shape: tuple[int, ...]) -> None:
    from skimage.io import imread

    made = exposures(2, shape)
    folder = written(tmp_path, made, ["png"]) / "frames"
    for k, exposure in enumerate(made):
        found = imread(folder / f"{k:06d}.png")
        assert found.dtype == np.uint8 and found.shape == exposure.codes.shape
        back = code_table("srgb", 8)[found] * 1023  # to half a step of 8 bits, which is widest at white
        assert back == pytest.approx(exposure.codes, abs=5)


def test_timestamps_are_the_first_row_and_the_last(tmp_path: Path) -> None:
    made = exposures(5)
    into = written(tmp_path, made, ["raw", "png"])
    for name in ("raw", "frames"):
        header, *lines = (into / name / "timestamps.txt").read_text().splitlines()
        assert header == "# start_us end_us"
        assert [tuple(map(int, line.split())) for line in lines] == [
            (each.start_ns // 1000, each.end_ns // 1000) for each in made
        ]
    assert lines[1] == "33366 38541"


def test_both_folders_open_as_sources(tmp_path: Path) -> None:
    made = exposures(5)
    into = written(tmp_path, made)
    for name, transfer, apart in (("raw", f"linear:{SPEC.bits}bit", 0.01), ("frames", "auto", 5)):
        source = open_source(into / name, transfer=transfer, colour="rgb")
        frames = list(source.frames())
        assert source.warnings == [] and [frame.t_ns for frame in frames] == [
            each.start_ns // 1000 * 1000 for each in made
        ]
        for frame, exposure in zip(frames, made, strict=True):
            assert frame.light * SPEC.top == pytest.approx(exposure.codes, abs=apart)


@pytest.mark.parametrize(
    ("text", "first_us"),
    [
        ("# start_us end_us\n5 9\n15 19\n", 5),
        ("# start_us, end_us\n5, 9\n15, 19\n", 5),
        ("# start_ns end_ns\n5000 9\n15000 19\n", 5),
        ("# us\n5 9\n15 19\n", 9),  # without names the last column counts, as in `index time`
        ("# start_us end_ns\n# us\n5 9\n15 19\n", 9),
    ],
)
def test_which_column_of_the_times_counts(tmp_path: Path, text: str, first_us: int) -> None:
    (tmp_path / "timestamps.txt").write_text(text)
    stamps, _ = read_timestamps(tmp_path / "timestamps.txt")
    assert stamps[0] == Fraction(first_us, 10**6)


@pytest.mark.parametrize("text", ["0\n33333\n66666\n99999\n", "1 2 3\n4 5 6\n", "0 1\n2 3\n4\n", "0 1\n2 three\n"])
def test_lines_that_are_no_two_times_are_no_spans(tmp_path: Path, text: str) -> None:
    (tmp_path / "timestamps.txt").write_text(text)
    with pytest.raises(DataError, match="expected two times in us on every line"):
        read_spans(tmp_path / "timestamps.txt")


@pytest.mark.parametrize("kinds", [["mp4"], ["raw", "mp4"], ["png", "mp4"]])
@pytest.mark.parametrize("shape", [(33, 46, 3), (32, 46)])
def test_the_film_plays_the_pictures_in_real_time(tmp_path: Path, kinds: list[str], shape: tuple[int, ...]) -> None:
    made = exposures(8, shape)
    into = written(tmp_path, made, kinds)
    assert sorted(path.name for path in into.iterdir()) == sorted(KINDS[kind] for kind in kinds)
    with av.open(str(into / "frames.mp4")) as container:
        pictures = list(container.decode(video=0))
    assert [Fraction(p.pts) * p.time_base for p in pictures] == [k / Fraction("29.97") for k in range(8)]
    table = SPEC.picture_codes().astype(float)
    for picture, exposure in zip(pictures, made, strict=True):
        seen = picture.to_ndarray(format="rgb24")[: shape[0], : shape[1]]
        want = table[exposure.codes if len(shape) == 3 else exposure.codes[..., None].repeat(3, axis=2)]
        assert np.abs(seen.mean(axis=(0, 1)) - want.mean(axis=(0, 1))).max() < 6
        luma = [0.2126, 0.7152, 0.0722]
        assert np.corrcoef((seen @ luma).ravel(), (want @ luma).ravel())[0, 1] > 0.95


@pytest.mark.parametrize(("gamma", "code"), [("srgb", 13), (1.0, 8), (2.2, 4), (1.7, UNSPECIFIED)])
def test_a_film_names_the_curve_of_its_codes_and_no_other(tmp_path: Path, gamma: float | str, code: int) -> None:
    spec = SPEC.model_copy(update={"gamma": gamma})
    at_work = ExposureFiles(tmp_path / "work", ["mp4"], spec.picture_codes(), spec.curve, 30.0)
    at_work.add(exposures(1)[0])
    at_work.finish(tmp_path)
    with av.open(str(tmp_path / "frames.mp4")) as container:
        assert {picture.color_trc for picture in container.decode(video=0)} == {code}


@pytest.mark.parametrize("known", [0, 1, 4, 7])
def test_an_interrupted_run_goes_on_to_the_same_bytes(tmp_path: Path, known: int) -> None:
    """Killed after 7 pictures, one of them half-written, with `known` in the last checkpoint."""
    made = exposures(9)
    want = contents(written(tmp_path / "straight", made)) if (tmp_path / "straight").mkdir() is None else {}
    first = files(tmp_path / "work")
    for exposure in made[:7]:
        first.add(exposure)
    first.sync()
    for name in ("raw", "frames"):
        if known < 7:
            (tmp_path / "work" / name / "000006.png").write_bytes(b"half")
            with open(tmp_path / "work" / name / "timestamps.txt", "a") as times:
                times.write("2002")
        (tmp_path / "work" / name / "timestamps.txt.new").write_bytes(b"")
    into = tmp_path / "whole"
    into.mkdir()
    second = files(tmp_path / "work")
    second.keep(known)
    for exposure in made[known:]:
        second.add(exposure)
    second.finish(into)
    assert contents(into) == want and len(want) == 2 * 10 + 1


def test_finishing_may_be_repeated(tmp_path: Path) -> None:
    made, into = exposures(4), tmp_path / "whole"
    into.mkdir()
    at_work = files(tmp_path / "work")
    for exposure in made:
        at_work.add(exposure)
    at_work.finish(into)
    want = contents(into)
    (into / "frames.mp4").write_bytes(b"half a film")
    shutil.copy(tmp_path / "work" / "raw" / "000003.png", tmp_path / "work" / "raw" / "000004.png")
    shutil.rmtree(into / "raw")
    again = files(tmp_path / "work")
    again.keep(4)
    assert again.finish(into) == ["raw", "frames", "frames.mp4"] and contents(into) == want


def test_what_is_finished_does_not_grow_with_what_it_was_made_of(tmp_path: Path) -> None:
    folder = written(tmp_path, exposures(3), ["png"])
    growing = [path for path in tmp_path.rglob("timestamps.txt") if folder not in path.parents]
    assert growing
    for path in growing:
        with open(path, "a", encoding="ascii") as file:
            file.write("7")
    assert read_spans(folder / KINDS["png"] / "timestamps.txt").shape == (3, 2)


def test_without_links_files_are_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_links(source: str, target: str) -> None:
        raise OSError("no links here")

    want = contents(written(tmp_path, exposures(3), ["raw"]))
    monkeypatch.setattr(os, "link", no_links)
    (tmp_path / "other").mkdir()
    assert contents(written(tmp_path / "other", exposures(3), ["raw"])) == want


def test_no_exposure_gives_folders_without_pictures_and_no_film(tmp_path: Path) -> None:
    into = tmp_path / "whole"
    into.mkdir()
    assert files(tmp_path / "work").finish(into) == ["raw", "frames"]
    assert sorted(contents(into)) == ["frames/timestamps.txt", "raw/timestamps.txt"]


def test_fewer_pictures_than_a_checkpoint_knows_of_are_refused(tmp_path: Path) -> None:
    at_work = files(tmp_path)
    for exposure in exposures(3):
        at_work.add(exposure)
    (tmp_path / "raw" / "000001.png").unlink()
    with pytest.raises(DataError, match="holds 2 pictures with times, expected 3"):
        files(tmp_path).keep(3)


def test_fewer_times_than_a_checkpoint_knows_of_are_refused(tmp_path: Path) -> None:
    at_work = files(tmp_path)
    for exposure in exposures(3):
        at_work.add(exposure)
    times = tmp_path / "raw" / "timestamps.txt"
    times.write_text("".join(times.read_text().splitlines(keepends=True)[:2]))
    with pytest.raises(DataError, match="holds 1 picture with times, expected 3"):
        files(tmp_path).keep(3)


@pytest.mark.parametrize("kinds", [[], ["tiff"], ["raw", "gif"]])
def test_other_kinds_are_refused(tmp_path: Path, kinds: list[str]) -> None:
    with pytest.raises(UsageError, match="expected some of raw, png, mp4"):
        files(tmp_path, kinds)


def test_a_picture_that_is_damaged_is_refused(tmp_path: Path) -> None:
    write_codes(tmp_path / "a.png", np.zeros((4, 4), np.uint16))
    assert cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED).dtype == np.uint16
    (tmp_path / "a.png").write_bytes(b"no picture")
    with pytest.raises(DataError, match=r"a\.png"):
        read_codes(tmp_path / "a.png")
