"""HS-ERGB and BS-ERGB as they are found on disks, quirk by quirk, with files made here."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from interp.data.clip import write_clip
from interp.data.layouts import open_sequence, opened_in, sequences_in, windows
from interp.data.layouts.ergb import LAYOUTS
from interp.data.layouts.sequence import Placed
from interp.data.layouts.writing import write_sequence
from interp.data.picture_codes import codes_in
from interp.data.recorded import clip_of, left_out, recorded
from interp.data.samples import check_fits
from interp.data.settings import ClipSettings
from vid2ev import DataError, UsageError
from vid2ev.recording.exposures import write_codes

SIZE = (40, 24)
STEP_US = 10_000


def events_of(count: int, start_us: int, stop_us: int, seed: int = 0) -> Placed:
    """Events in (start_us, stop_us], in order, on whole pixels."""
    draw = np.random.default_rng(seed)
    t = np.sort(draw.integers(start_us + 1, stop_us + 1, count))
    x, y = (draw.integers(0, side, count).astype(np.float32) for side in SIZE)
    return Placed(t.astype(np.int64), x, y, draw.integers(0, 2, count).astype(np.uint8))


def written(
    folder: Path,
    layout: str = "hsergb",
    images: int = 6,
    *,
    times: str | None = None,
    first: int = 0,
    scale: float = 32,
) -> list[Placed]:
    """A sequence with 200 events between pictures; returns those, by gaps."""
    names = LAYOUTS[layout]
    (folder / names.images).mkdir(parents=True)
    (folder / names.events).mkdir()
    for k in range(images):
        write_codes(folder / names.images / f"{first + k:06d}.png", np.full((*SIZE[::-1], 3), 10 * k + 5, np.uint8))
    lines = "".join(f"{STEP_US * (k + 1)}.0\n" for k in range(images)) if times is None else times
    (folder / names.images / "timestamp.txt").write_text(lines)
    gaps = [events_of(200, STEP_US * (k + 1), STEP_US * (k + 2), k) for k in range(images - 1)]
    for k, gap in enumerate(gaps):
        save(folder, layout, first + k + (not names.events_after), gap, scale)
    return gaps


def save(folder: Path, layout: str, number: int, gap: Placed, scale: float = 32, kind: Any = np.uint16) -> None:
    names = LAYOUTS[layout]
    x, y = ((scale * each).astype(kind) for each in (gap.x, gap.y))
    columns = dict(zip(names.columns, [x, y, gap.t, gap.p], strict=True))
    np.savez(folder / names.events / f"{number:06d}.npz", **columns)


def same(one: Placed, other: Placed) -> None:
    for name in "txyp":
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("layout", ["hsergb", "bsergb"])
def test_frames_and_events_are_found_by_their_times(tmp_path: Path, layout: str) -> None:
    gaps = written(tmp_path / "seq", layout)
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.name == "seq" and sequence.size == SIZE
    np.testing.assert_array_equal(sequence.times_us, STEP_US * np.arange(1, 7))
    assert (sequence.frame(3) == 35).all()
    for k, gap in enumerate(gaps):
        same(sequence.events(STEP_US * (k + 1), STEP_US * (k + 2)), gap)


@pytest.mark.parametrize("layout", ["hsergb", "bsergb"])
@pytest.mark.parametrize("shift", [-1, 0, 1, 2591])
def test_numbers_of_event_files_only_say_the_order(tmp_path: Path, layout: str, shift: int) -> None:
    # (in a third of the HS-ERGB sequences they are one off, in one they begin near 2592)
    gaps = written(tmp_path / "seq", layout, first=5)
    folder = tmp_path / "seq" / LAYOUTS[layout].events
    paths = sorted(folder.iterdir(), reverse=shift > 0)
    for path in paths:
        path.rename(path.with_name(f"{int(path.stem) + shift:06d}.npz"))
    same(open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US), gaps[0])


@pytest.mark.parametrize(
    ("scale", "kind"), [(32, np.uint16), (32, np.float64), (1, np.float32), (1, np.int16), (1, np.uint8)]
)
def test_coordinates_are_scaled_as_they_look(tmp_path: Path, scale: int, kind: Any) -> None:
    gaps = written(tmp_path / "seq")
    for k, gap in enumerate(gaps):
        save(tmp_path / "seq", "hsergb", k + 1, gap, scale, kind)
    same(open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US), gaps[0])


def test_a_file_with_few_events_has_the_scale_of_its_sequence(tmp_path: Path) -> None:
    # By itself its largest coordinate, 32, would be a pixel; it is one thirty-second of that.
    gaps = written(tmp_path / "seq")
    one = Placed(
        np.array([STEP_US + 5]), np.array([1.0], np.float32), np.array([1.0], np.float32), np.array([1], np.uint8)
    )
    save(tmp_path / "seq", "hsergb", 1, one)
    same(open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US), one)
    assert len(gaps) == 5


def test_places_between_pixels_stay(tmp_path: Path) -> None:
    written(tmp_path / "seq")
    between = Placed(
        np.array([STEP_US + 5]), np.array([3.25], np.float32), np.array([7.75], np.float32), np.array([0], np.uint8)
    )
    save(tmp_path / "seq", "hsergb", 1, between)
    got = open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US)
    assert (got.x[0], got.y[0]) == (3.25, 7.75)
    inside, beyond = got.within(SIZE)
    assert (inside.x[0], inside.y[0], beyond) == (3, 8, 0)


def test_what_lies_beyond_the_picture_is_dropped_and_counted_never_clipped(tmp_path: Path) -> None:
    written(tmp_path / "seq", "bsergb")
    x = np.array([65536 - 40, 65535, 16, 32 * 39 + 15, 32 * 39 + 16, 32 * 41], np.uint16)  # -1.25, -0.03, .5, 39.47 ...
    n = len(x)
    arrays = {
        "x": x,
        "y": np.full(n, 64, np.uint16),
        "timestamp": STEP_US + 1 + np.arange(n),
        "polarity": np.ones(n, bool),
    }
    np.savez(tmp_path / "seq" / "events" / "000000.npz", **arrays)
    got = open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US)
    np.testing.assert_allclose(got.x, [-1.25, -1 / 32, 0.5, 39 + 15 / 32, 39.5, 41 - 2048], atol=0)
    inside, beyond = got.within(SIZE)
    np.testing.assert_array_equal(inside.x, [0, 1, 39])
    assert beyond == 3


@pytest.mark.parametrize(
    "polarity", [np.array([0, 1]), np.array([-1, 1]), np.array([False, True]), np.array([0.0, 1.0])]
)
def test_polarities_of_all_kinds_are_off_and_on(tmp_path: Path, polarity: np.ndarray) -> None:
    written(tmp_path / "seq")
    arrays = {"x": np.array([32, 64]), "y": np.array([32, 64]), "t": np.array([1, 2]) + STEP_US, "p": polarity}
    np.savez(tmp_path / "seq" / "events_aligned" / "000001.npz", **arrays)
    np.testing.assert_array_equal(open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US).p, [0, 1])


def test_empty_and_instant_files_are_no_trouble(tmp_path: Path) -> None:
    gaps = written(tmp_path / "seq")
    none = np.empty(0)
    np.savez(tmp_path / "seq" / "events_aligned" / "000000.npz", x=none, y=none, t=none, p=none)
    instant = gaps[2]._replace(t=np.full(200, 3 * STEP_US + 7, np.int64))
    save(tmp_path / "seq", "hsergb", 3, instant)
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.remarks == ["1 of 6 event files is empty"]
    same(sequence.events(3 * STEP_US, 4 * STEP_US), instant)
    same(sequence.events(STEP_US, 2 * STEP_US), gaps[0])
    assert len(sequence.events(3 * STEP_US, 3 * STEP_US + 6).t) == 0


def test_events_out_of_order_are_put_in_order(tmp_path: Path) -> None:
    gaps = written(tmp_path / "seq")
    save(tmp_path / "seq", "hsergb", 1, Placed(*(column[::-1] for column in gaps[0])))
    got = open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US)
    np.testing.assert_array_equal(got.t, gaps[0].t)


@pytest.mark.parametrize(("images", "times", "count"), [(6, 4, 4), (4, 6, 4), (1, 3, 1)])
def test_as_many_pictures_as_times_belong_together(tmp_path: Path, images: int, times: int, count: int) -> None:
    written(tmp_path / "seq", images=images, times="".join(f"{STEP_US * (k + 1)}\n" for k in range(times)))
    sequence = open_sequence(tmp_path / "seq")
    assert len(sequence.times_us) == count
    said = f"{images} picture{'s' * (images > 1)} and {times} times: pairs are made of the first {count}"
    assert sequence.remarks[0] == said


@pytest.mark.parametrize("head", ["0\n0\n", f"0\n0\n{9 * STEP_US}\n", f"{9 * STEP_US}\n", "0\nwrong\n0\n"])
def test_times_above_those_that_increase_are_of_no_picture(tmp_path: Path, head: str) -> None:
    written(tmp_path / "seq", times=head + "".join(f"{STEP_US * (k + 1)}\n" for k in range(6)))
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.times_us.tolist() == [STEP_US * (k + 1) for k in range(6)]
    assert any("times: pairs are made of the last 6" in remark for remark in sequence.remarks)


@pytest.mark.parametrize("layout", ["hsergb", "bsergb"])
def test_a_sequence_whose_events_are_missing_is_named(tmp_path: Path, layout: str) -> None:
    written(tmp_path / "all" / "good", layout)
    written(tmp_path / "all" / "bare", layout)
    shutil.rmtree(tmp_path / "all" / "bare" / LAYOUTS[layout].events)
    found, unusable = opened_in(tmp_path / "all")
    assert [sequence.name for sequence in found] == ["good"]
    ((name, why),) = unusable.items()
    assert Path(name).name == "bare" and f"no folder {LAYOUTS[layout].events}; expected the events" in why
    with pytest.raises(DataError, match="no folder"):
        open_sequence(tmp_path / "all" / "bare")


@pytest.mark.parametrize("head", ["", "# exposure\n"])
def test_a_picture_that_is_missing_takes_its_time_along(tmp_path: Path, head: str) -> None:
    written(tmp_path / "seq", first=3, times=head + "".join(f"{STEP_US * (k + 1)}\n" for k in range(6)))
    (tmp_path / "seq" / "images_corrected" / "000005.png").unlink()
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.times_us.tolist() == [STEP_US * (k + 1) for k in (0, 1, 3, 4, 5)]
    assert [int(sequence.frame(k)[0, 0, 0]) for k in range(5)] == [5, 15, 35, 45, 55]
    assert "1 of 6 pictures is missing: its time is left out" in sequence.remarks
    (tmp_path / "seq" / "images_corrected" / "000006.png").unlink()
    assert "2 of 6 pictures are missing: their times are left out" in open_sequence(tmp_path / "seq").remarks


def test_a_picture_of_another_size_is_named(tmp_path: Path) -> None:
    written(tmp_path / "seq")
    write_codes(tmp_path / "seq" / "images_corrected" / "000002.png", np.zeros((8, 12, 3), np.uint8))
    with pytest.raises(DataError, match=r"000002\.png: 12x8 pixels, expected 40x24"):
        clip_of(open_sequence(tmp_path / "seq"), 1, 4)


@pytest.mark.parametrize("white", [100, 255, 1000, 1023, 65535])
def test_white_of_a_picture_is_what_its_header_says(tmp_path: Path, white: int) -> None:
    """In codes of 8 bits, 255."""
    kind = ">u2" if white > 255 else "u1"
    values = np.array([0, white // 2, white])
    (tmp_path / "0.pgm").write_bytes(b"P5\n3 1\n%d\n" % white + values.astype(kind).tobytes())
    found = codes_in(tmp_path / "0.pgm")
    assert found is not None
    np.testing.assert_array_equal(found[0], np.repeat(np.rint(values * 255.0 / white)[:, None], 3, axis=1))


def test_lines_that_are_no_times_are_counted(tmp_path: Path) -> None:
    lines = "# exposure\nnan\nhead of file\n" + "".join(f"{STEP_US * (k + 1)} {STEP_US}\n\n" for k in range(6))
    written(tmp_path / "seq", "bsergb", times=lines)
    sequence = open_sequence(tmp_path / "seq")
    np.testing.assert_array_equal(sequence.times_us, STEP_US * np.arange(1, 7))
    assert sequence.remarks == ["3 of the 9 lines of timestamp.txt say no time"]


def test_the_mark_that_windows_puts_before_a_text_is_no_part_of_the_first_time(tmp_path: Path) -> None:
    lines = "".join(f"{STEP_US * (k + 1)}\r\n" for k in range(6))
    written(tmp_path / "seq", times=f"\ufeff{lines}")
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.times_us.tolist() == (STEP_US * np.arange(1, 7)).tolist()
    assert not any("no time" in remark for remark in sequence.remarks)


def test_a_picture_whose_line_is_no_time_is_left_out_and_others_keep_theirs(tmp_path: Path) -> None:
    lines = [f"{STEP_US * (k + 1)}\n" for k in range(6)]
    written(tmp_path / "seq", times="".join(lines))
    whole = open_sequence(tmp_path / "seq")
    written(tmp_path / "torn", times="".join([*lines[:2], "30000O\n", *lines[3:]]))
    torn = open_sequence(tmp_path / "torn")
    assert torn.times_us.tolist() == [t for t in whole.times_us.tolist() if t != 3 * STEP_US]
    np.testing.assert_array_equal(torn.frame(2), whole.frame(3))
    assert torn.remarks == ["1 of the 6 lines of timestamp.txt say no time"]


def test_windows_in_which_something_is_missing_are_counted(tmp_path: Path) -> None:
    times = [1, 2, 3, 3, 5, 6, 7, 8, 9, 10, 11, 12]
    written(tmp_path / "seq", images=12, times="".join(f"{STEP_US * t}\n" for t in times))
    for number in (9, 10, 11):  # (in 11 of 15 sequences of HS-ERGB the events end before the frames)
        (tmp_path / "seq" / "events_aligned" / f"{number:06d}.npz").unlink()
    found = windows(open_sequence(tmp_path / "seq"), 2)
    np.testing.assert_array_equal(found.first, [0, 3, 4, 5, 6])
    assert found.unusable == {"times of the frames do not increase": 2, "the events end before the last frame": 3}


def test_a_damaged_file_costs_its_own_stretch_and_is_named(tmp_path: Path) -> None:
    gaps = written(tmp_path / "seq")
    (tmp_path / "seq" / "events_aligned" / "000003.npz").write_bytes(b"PK\x03\x04 torn")
    sequence = open_sequence(tmp_path / "seq")
    assert "000003.npz is no file of events" in sequence.remarks[0]
    found = windows(sequence, 1)
    # (it may have begun before the picture at its begin, and ended after the one at its end)
    np.testing.assert_array_equal(found.first, [0, 4])
    assert found.unusable == {"a file of events is missing or cannot be read": 3}
    same(sequence.events(STEP_US, 2 * STEP_US), gaps[0])
    with pytest.raises(DataError, match="cannot be read"):
        sequence.events(3 * STEP_US, 4 * STEP_US)


@pytest.mark.parametrize("layout", ["hsergb", "bsergb"])
def test_a_missing_file_costs_its_own_stretch_and_is_named(tmp_path: Path, layout: str) -> None:
    gaps = written(tmp_path / "seq", layout, 8)
    files = sorted((tmp_path / "seq" / LAYOUTS[layout].events).iterdir())
    files[3].unlink()
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.remarks == [f"1 event file is missing before {files[4].name}"]
    found = windows(sequence, 1)
    np.testing.assert_array_equal(found.first, [0, 1, 5, 6])
    assert found.unusable == {"a file of events is missing or cannot be read": 3}
    same(sequence.events(STEP_US, 2 * STEP_US), gaps[0])


def test_numbers_that_are_left_out_where_no_events_are_mean_nothing(tmp_path: Path) -> None:
    gaps = written(tmp_path / "seq", images=8)
    for k, path in reversed([*enumerate(sorted((tmp_path / "seq" / "events_aligned").iterdir()), 1)]):
        path.rename(path.with_name(f"{5 * k:06d}.npz"))
    sequence = open_sequence(tmp_path / "seq")
    assert sequence.remarks == [] and len(windows(sequence, 1).first) == 7
    same(sequence.events(STEP_US, 2 * STEP_US), gaps[0])


def test_a_pipe_in_place_of_times_is_none(tmp_path: Path) -> None:
    written(tmp_path / "seq")
    (tmp_path / "seq" / "images_corrected" / "timestamp.txt").unlink()
    os.mkfifo(tmp_path / "seq" / "images_corrected" / "timestamp.txt")
    with pytest.raises(DataError, match=r"no timestamp\.txt"):
        open_sequence(tmp_path / "seq")


@pytest.mark.parametrize("columns", [{"x": 3, "y": 3, "t": 2, "p": 3}, {"x": 2, "y": 2, "p": 2}])
def test_columns_that_cannot_be_are_named(tmp_path: Path, columns: dict[str, int]) -> None:
    written(tmp_path / "seq")
    np.savez(tmp_path / "seq" / "events_aligned" / "000001.npz", **{name: np.zeros(n) for name, n in columns.items()})
    assert "000001.npz is no file of events" in open_sequence(tmp_path / "seq").remarks[0]


@pytest.mark.parametrize("layout", ["hsergb", "bsergb"])
@pytest.mark.parametrize("source", ["hsergb", "bsergb"])
def test_what_is_written_reads_back(tmp_path: Path, source: str, layout: str) -> None:
    gaps = written(tmp_path / "a", source)
    sequence = open_sequence(tmp_path / "a")
    write_sequence(sequence, tmp_path / "b", layout)
    again = open_sequence(tmp_path / "b")
    np.testing.assert_array_equal(again.times_us, sequence.times_us)
    for k, gap in enumerate(gaps):
        np.testing.assert_array_equal(again.frame(k), sequence.frame(k))
        same(again.events(STEP_US * (k + 1), STEP_US * (k + 2)), gap)
    files = sorted((tmp_path / "b" / LAYOUTS[layout].events).iterdir())
    assert len(files) == (6 if layout == "hsergb" else 5)
    with np.load(files[-1]) as arrays:
        assert set(arrays) == set(LAYOUTS[layout].columns)
        assert arrays["x"].dtype == (np.float32 if layout == "hsergb" else np.uint16)
        assert len(arrays["x"]) == 200  # (the last file is of the last gap in both)


def test_clips_of_a_sequence_count_its_events(tmp_path: Path) -> None:
    gaps = written(tmp_path / "root" / "close" / "test" / "seq", images=10)
    folders, unusable = sequences_in(tmp_path / "root")
    assert [folder.name for folder in folders] == ["seq"] and not unusable
    sequence = open_sequence(folders[0])
    clip = clip_of(sequence, 1, 4)
    assert clip.truth.shape == (5, 24, 40, 3) and clip.gap_us == 4 * STEP_US
    assert [int(frame[0, 0, 0]) for frame in clip.truth] == [15, 25, 35, 45, 55]
    np.testing.assert_array_equal(clip.keys, clip.truth[[0, -1]])
    assert clip.off_on.sum(dtype=int) == 4 * 200
    assert clip.off_on[1].sum(dtype=int) == sum(int(gap.p.sum()) for gap in gaps[1:5])
    part = clip_of(sequence, 1, 4, part=(8, 4, 16, 16))
    np.testing.assert_array_equal(part.off_on, clip.off_on[:, :, 4:20, 8:24])


def test_events_that_were_written_again_are_read_again(tmp_path: Path) -> None:
    """Also by the process that has read what was there before."""
    written(tmp_path / "seq")
    open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US)
    other = events_of(50, STEP_US, 2 * STEP_US, 99)
    save(tmp_path / "seq", "hsergb", 1, other)
    same(open_sequence(tmp_path / "seq").events(STEP_US, 2 * STEP_US), other)


def test_recorded_clips_are_drawn_from_all_that_can_be_used(tmp_path: Path) -> None:
    written(tmp_path / "short", images=3)
    written(tmp_path / "long", "bsergb", images=12)
    (tmp_path / "broken" / "images").mkdir(parents=True)
    (tmp_path / "broken" / "events").mkdir()
    folders, unusable = sequences_in(tmp_path)
    assert [folder.name for folder in folders] == ["long", "short"] and "no timestamp.txt" in next(
        iter(unusable.values())
    )
    settings = ClipSettings(size=(16, 16), recordings=1, scenes=0, photographs=0, recording_folders=(str(tmp_path),))
    clips = [recorded(settings, 0, number, 8) for number in range(6)]
    assert {clip.about["name"] for clip in clips} == {"long"}
    assert {clip.about["first"] for clip in clips} <= {0, 1, 2, 3} and all(
        clip.truth.shape == (9, 16, 16, 3) for clip in clips
    )
    with pytest.raises(UsageError, match="no window of 33 frames"):
        recorded(settings, 0, 0, 32)


def test_sequences_are_opened_once_however_many_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"{k:02d}" for k in range(40)]
    for name in names:
        written(tmp_path / name, images=9)
    opened = list[str]()

    def noted(folder: str) -> Any:
        opened.append(Path(folder).name)
        return open_sequence(folder)

    monkeypatch.setattr("interp.data.recorded.open_sequence", noted)
    settings = ClipSettings(size=(16, 16), recordings=1, scenes=0, photographs=0, recording_folders=(str(tmp_path),))
    assert len({recorded(settings, 0, number, 8).about["name"] for number in range(80)}) > 32
    assert opened == names


def test_samples_end_where_pixels_of_coarser_events_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # (else the part of a pixel that is cut off is missing, and the others are stretched over all of the sample)
    for name in ("fine", "coarse", "uneven"):
        written(tmp_path / name, images=12)
    sizes = {"fine": SIZE, "coarse": (SIZE[0] // 8, SIZE[1] // 8), "uneven": (17, 11)}

    def opened(folder: str) -> Any:
        sequence = open_sequence(folder)
        sequence.event_size, sequence.apart = sizes[sequence.name], False
        return sequence

    monkeypatch.setattr("interp.data.recorded._opened", opened)
    settings = ClipSettings(size=(24, 24), recordings=1, scenes=0, photographs=0, recording_folders=(str(tmp_path),))
    check_fits(settings, 16)
    with pytest.raises(UsageError, match="20 pixels with event cameras coarser by 1, 8: expected a multiple of 8"):
        check_fits(settings, 20)
    assert not left_out(settings, 8)  # (pixels that lie askew are carried, and can be cut anywhere)


@pytest.mark.parametrize("lost", [1, 4, 7])
def test_no_clip_is_cut_where_frames_are_not_even_in_time(tmp_path: Path, lost: int) -> None:
    # (clips take them to be so; one that is lost at the edge of a window leaves the others even)
    late = [STEP_US * (k + 1 + (k >= lost)) for k in range(12)]
    written(tmp_path / "seq", images=12, times="".join(f"{t}\n" for t in late))
    save(tmp_path / "seq", "hsergb", 12, events_of(50, 13 * STEP_US, 14 * STEP_US))
    sequence = open_sequence(tmp_path / "seq")
    even = [first for first in range(8) if not first < lost <= first + 4]
    assert windows(sequence, 4, even=True).first.tolist() == even
    assert windows(sequence, 4, even=True).unusable == {
        "the frames are not even in time, as where some are lost": 8 - len(even)
    }
    assert windows(sequence, 4).first.tolist() == [*range(8)]  # (who knows the frames' own times takes all)
    settings = ClipSettings(
        size=(16, 16), multiples=(4,), recordings=1, scenes=0, photographs=0, recording_folders=(str(tmp_path),)
    )
    assert {recorded(settings, 0, number, 4).about["first"] for number in range(20)} <= {*even}


def test_frames_that_are_even_but_for_jitter_give_clips(tmp_path: Path) -> None:
    jitter = np.random.default_rng(0).integers(-STEP_US // 10, STEP_US // 10, 12)
    written(tmp_path / "seq", images=12, times="".join(f"{STEP_US * (k + 1) + jitter[k]}\n" for k in range(12)))
    assert "not even" not in " ".join(windows(open_sequence(tmp_path / "seq"), 4, even=True).unusable)


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no recordings in it"):
        sequences_in(tmp_path)
    with pytest.raises(UsageError, match="gone: no such folder"):
        sequences_in(tmp_path / "gone")
    with pytest.raises(UsageError, match="is no recording"):
        open_sequence(tmp_path)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_why_a_disk_does_not_take_a_clip_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path / "seq", images=10)
    clip = clip_of(open_sequence(tmp_path / "seq"), 1, 4)
    monkeypatch.setattr(secrets, "token_hex", lambda _: "its")
    (tmp_path / "0.npy.its.new").symlink_to("/dev/full")
    with pytest.raises(OSError) as raised:
        write_clip(tmp_path / "0.npy", clip)
    assert raised.value.errno == errno.ENOSPC
    assert [path.name for path in tmp_path.iterdir()] == ["seq"]
