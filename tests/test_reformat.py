"""reformat: every event of one format stands in the other, and a failure leaves what was there."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner, Result

from vid2ev import Events, UsageError, convert, read_events
from vid2ev.commands import main
from vid2ev.formats import FORMATS, describe_events, format_named, open_events, survey
from vid2ev.formats.event_file import Picture, Recording
from vid2ev.reformat import format_of_suffix, reformat, writable

SIZE = (320, 240)
START_US = 5_000_000


@pytest.fixture
def recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two seconds of events with labels, in the current folder."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    t = START_US + np.sort(rng.integers(0, 2_000_000, 5000))
    x, y = (rng.integers(0, side, 5000).astype(np.uint16) for side in SIZE)
    p, label = (rng.integers(0, n, 5000).astype(np.uint8) for n in (2, 4))
    events = Events(t, x, y, p, label)
    write = format_named("hdf5").write
    assert write is not None
    write(Path("whole.h5"), Recording(SIZE, START_US, 2_000_000, 5000, lambda: iter([events]), labelled=True))
    return Path("whole.h5")


def columns(path: Path) -> list[list[int]]:
    events = Events.concatenate(read_events(path))
    return [column.tolist() for column in (events.t, events.x, events.y, events.p)]


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["reformat", *arguments])


@pytest.mark.parametrize("name", [name for name in writable() if name not in ("ros1", "ros2")])
def test_there_and_back(recording: Path, name: str) -> None:
    there = Path(f"there{format_named(name).suffix}")
    made = reformat(recording, there, name)
    assert (made["format"], made["events"], made["size"]) == (name, 5000, list(SIZE))
    assert made["bytes"] == there.stat().st_size
    back = Path("back.h5")
    reformat(there, back)
    t, *rest = columns(recording)
    shift = 0 if "start" in format_named(name).keeps else columns(back)[0][0] - t[0]
    assert columns(back) == [[at + shift for at in t], *rest]
    assert {path.name for path in Path().iterdir()} == {"whole.h5", there.name, "back.h5"}
    lost = [] if "labels" in format_named(name).keeps else ["labels"]
    assert [text for text in made["warnings"] if "left out" in text] == [
        f"{name} does not hold {what}; they are left out" for what in lost
    ]


@pytest.mark.parametrize("name", [name for name in writable() if format_named(name).open])
def test_what_a_format_does_not_hold_is_said(recording: Path, name: str) -> None:
    """Whatever is lost of size, labels and the times of frames, and nothing else."""
    frame_us = START_US + np.arange(0, 2_000_001, 500_000)
    write = format_named("hdf5").write
    assert write is not None
    write(Path("timed.h5"), replace(survey(open_events(recording)), frame_us=frame_us))
    there = Path(f"there{format_named(name).suffix}")
    warnings = " ".join(reformat("timed.h5", there, name)["warnings"])
    file = open_events(there)
    assert ("labels" in warnings) == (not file.labelled)
    assert ("frame times" in warnings) == (getattr(file, "frame_us", None) is None)
    assert ("hold the size, 320x240" in warnings) == (file.size is None)


@pytest.mark.parametrize("name", ["aedat4", "evt3", "csv"])
def test_times_of_frames_that_stand_beside_a_recordings_file_come_along(tmp_path: Path, name: str) -> None:
    """As if it had been converted into HDF5 at once; of a part those of its time."""
    options = {"upsample": "none", "preview": False, "threads": 1}
    clip = "synthetic:moving-edge,size=32x24,fps=50,duration_s=0.2"
    for kind in ("hdf5", name):
        convert(clip, tmp_path / kind, formats=[kind], **options)
    reformat(tmp_path / name, tmp_path / "again.h5")
    one, other = (open_events(path) for path in (tmp_path / "hdf5", tmp_path / "again.h5"))
    np.testing.assert_array_equal(one.frame_us, other.frame_us)  # type: ignore[attr-defined]
    with h5py.File(tmp_path / "hdf5" / "events.h5") as file, h5py.File(tmp_path / "again.h5") as again:
        np.testing.assert_array_equal(file["frames/to_idx"], again["frames/to_idx"])
    reformat(tmp_path / name, tmp_path / "part.h5", start_s=0.05, stop_s=0.15)
    part = open_events(tmp_path / "part.h5").frame_us  # type: ignore[attr-defined]
    assert part.tolist() == [60_000, 80_000, 100_000, 120_000, 140_000]


def test_the_suffix_says_the_format() -> None:
    for name in writable():
        kind = format_of_suffix(Path(f"any{format_named(name).suffix.upper()}"))
        assert kind.suffix == format_named(name).suffix
    assert format_of_suffix(Path("a.h5")).name == "hdf5" and format_of_suffix(Path("a.raw")).name == "evt3"
    with pytest.raises(UsageError, match="suffix of no format"):
        format_of_suffix(Path("a.mp4"))


def test_a_part(recording: Path) -> None:
    assert run(str(recording), "part.csv", "--start", "0.5", "--stop", "1.5").exit_code == 0
    t = np.array(columns(recording)[0])
    kept = t[(t >= START_US + 500_000) & (t <= START_US + 1_500_000)]
    assert columns(Path("part.csv"))[0] == kept.tolist()


def test_a_part_has_the_frames_of_its_time_and_ends_with_it(recording: Path) -> None:
    frame_us = START_US + np.arange(0, 2_500_001, 250_000)
    pictures = [Picture(int(t_us), np.full((240, 320), k, np.uint8)) for k, t_us in enumerate(frame_us)]
    whole = survey(open_events(recording))
    for name in ("hdf5", "aedat4"):
        write = format_named(name).write
        assert write is not None
        frames = (lambda: iter(pictures)) if name == "aedat4" else None
        write(Path(f"framed-{name}"), replace(whole, frames=frames, frame_us=frame_us, labelled=False))
        part = Path(f"part{format_named(name).suffix}")
        made = reformat(f"framed-{name}", part, start_s=0.5, stop_s=1.2)
        assert 1_190_000 - 500_000 < made["duration_us"] <= 700_000
        assert made["start_us"] == START_US + 500_000
    known = open_events("part.h5").frame_us  # type: ignore[attr-defined]
    there = [(picture.t_us, int(picture.pixels[0, 0])) for picture in open_events("part.aedat4").frames()]
    assert known.tolist() == frame_us[2:5].tolist() == [t_us for t_us, _ in there]
    assert [level for _, level in there] == [2, 3, 4]


@pytest.mark.parametrize("name", ["aedat4", "ros1", "ros2"])
def test_a_part_has_all_frames_of_its_time_in_whatever_order(recording: Path, name: str) -> None:
    order = np.array([0, 4, 1, 9, 2, 3, 7, 5, 6, 8, 100])
    pictures = [Picture(START_US + 200_000 * int(k), np.full((3, 4), k, np.uint8)) for k in order]
    kind, whole = format_named(name), survey(open_events(recording))
    assert kind.write is not None
    kind.write(Path("framed"), replace(whole, frames=lambda: iter(pictures), labelled=False))
    part = Path(f"part{kind.suffix}")
    reformat("framed", part, name, start_s=0.2, stop_s=1.2)
    found = [int(picture.pixels[0, 0]) for picture in open_events(part).frames()]
    assert sorted(found) == [1, 2, 3, 4, 5, 6]


def test_times_since_1970_are_no_recording_of_half_a_century(recording: Path) -> None:
    Path("epoch.csv").write_text("t,x,y,p\n1600000000000000,1,2,1\n1600000000500000,3,4,0\n")
    made = reformat("epoch.csv", "epoch.h5")
    assert (made["start_us"], made["duration_us"]) == (1_600_000_000_000_000, 500_000)
    assert columns(Path("epoch.h5"))[0] == [1_600_000_000_000_000, 1_600_000_000_500_000]
    assert columns(recording)[0] and reformat("epoch.csv", "epoch.raw")["bytes"] < 10_000


def test_a_part_from_the_beginning_has_events_that_came_late_there(tmp_path: Path) -> None:
    begin_us = 1_700_000_000_000_000
    lines = [f"{begin_us + after},{after},1,1" for after in (5, 3, 8, 9, 20)]
    (tmp_path / "late.csv").write_text("\n".join(["t,x,y,p", *lines, ""]))
    reformat(tmp_path / "late.csv", tmp_path / "part.npz", stop_s=12e-6)
    assert Events.concatenate(read_events(tmp_path / "part.npz")).x.tolist() == [3, 5, 8, 9]


def test_json_and_a_summary(recording: Path) -> None:
    found = json.loads(run(str(recording), "one.npz", "--json").stdout)
    assert found["events"] == 5000 and found["files"] == ["one.npz"]
    assert "5,000" in run(str(recording), "two.npz").stdout


def test_dat_splits_at_its_wrap_and_is_one_recording_again(recording: Path) -> None:
    t = np.array([0, 2**32 - 1, 2**32, 2**33 + 5])
    x = np.arange(4, dtype=np.uint16)
    events = Events(t, x, x, (x & 1).astype(np.uint8))
    write = format_named("hdf5").write
    assert write is not None
    write(Path("long.h5"), Recording((4, 4), 0, int(t[-1]), 4, lambda: iter([events])))
    made = reformat("long.h5", "long.dat")
    assert made["files"] == ["long.dat", "long_1.dat", "long_2.dat"]
    assert columns(Path("long.dat"))[0] == t.tolist()
    with pytest.raises(UsageError, match="exists"):
        reformat("long.h5", "long_1.dat")
    shutil.copy("long_1.dat", "long_3.dat")  # (which is of no such recording)
    reformat(recording, "long.dat", overwrite=True)
    assert {path.name for path in Path().glob("long*")} == {"long.h5", "long.dat", "long_3.dat"}
    assert describe_events("long.dat")["events"] == 5000 and not describe_events("long.dat")["warnings"]


@pytest.mark.parametrize("part", [{"start_s": math.nan}, {"stop_s": math.inf}, {"start_s": -1e300}], ids=str)
def test_instants_that_are_none_are_refused(recording: Path, part: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="expected seconds after the beginning"):
        reformat(recording, "out.h5", **part)
    assert not Path("out.h5").exists()


@pytest.mark.parametrize(
    ("arguments", "exit_code", "sentence"),
    [
        (["missing.raw", "out.h5"], 2, "no such file"),
        (["whole.h5", "out.xyz"], 2, "suffix"),
        (["whole.h5", "out.es", "--format", "es"], 2, "only read"),
        (["whole.h5", "out.es", "--format", "evt9"], 2, "expected one of"),
        (["whole.h5", "whole.h5"], 2, "--overwrite"),
        (["whole.h5", "out.h5", "--start", "3", "--stop", "2"], 2, "after the start"),
        (["noise.raw", "out.h5"], 1, "no event file"),
        (["whole.h5", "whole.h5/out.h5"], 1, "cannot be written"),
        (["whole.h5", ".", "--format", "npz"], 2, ". is a folder; give a file in it, such as events.npz"),
        (["whole.h5", "/", "--format", "npz", "--overwrite"], 2, "/ is a folder"),
        (["wide.h5", "out.raw"], 2, "cannot hold 4000x3 pixels, at most 2048x2048; choose --format hdf5"),
        (["long.h5", "out.h5", "--format", "v2e-hdf5"], 2, "hold 8589.934592 s, at most 4294.967295 s"),
        (["edge.npz", "out.h5"], 2, "65536x2 pixels, at most 65535x65535; choose --format npz"),
        (["edge.npz", "out.aedat4"], 2, "choose --format npz"),
        (["far.csv", "out.h5"], 1, "11,574 days as hdf5 would take"),
        (["far.csv", "out.raw", "--format", "evt3"], 1, "choose --format aedat4"),
    ],
    ids=str,
)
def test_what_cannot_be_is_one_sentence(recording: Path, arguments: list[str], exit_code: int, sentence: str) -> None:
    Path("noise.raw").write_bytes(np.random.default_rng(0).bytes(5000))
    Path("far.csv").write_text("t,x,y,p\n0,1,1,1\n1000000000000000,2,2,0\n")
    one = np.zeros(2, np.uint16)
    write = format_named("hdf5").write
    assert write is not None
    for name, size, t in (("wide.h5", (4000, 3), 0), ("long.h5", (1, 1), 2**33)):
        events = Events(np.array([0, t]), one, one, one.astype(np.uint8))
        write(Path(name), Recording(size, 0, t, 2, lambda events=events: iter([events])))
    np.savez("edge.npz", t=[0], x=[65535], y=[1], p=[1])
    before = {path.name for path in Path().iterdir()}
    result = run(*arguments)
    assert result.exit_code == exit_code and sentence in result.stderr, result.output
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
    assert {path.name for path in Path().iterdir()} == before


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are no pipes that have names")
def test_links_and_pipes_are_not_replaced(recording: Path) -> None:
    """Nor devices, such as /dev/null, which are there for all."""
    os.mkfifo("pipe")
    Path("link").symlink_to(recording)
    Path("nowhere").symlink_to("missing")
    for name, said in (("pipe", "no file but a pipe"), ("link", "is a link"), ("nowhere", "is a link")):
        before = Path(name).lstat().st_ino
        with pytest.raises(UsageError, match=said):
            reformat(recording, name, "csv", overwrite=True)
        assert Path(name).lstat().st_ino == before


def test_who_asks_twice_to_end_leaves_nothing(
    recording: Path, monkeypatch: pytest.MonkeyPatch, asks_again: Callable[[], None]
) -> None:
    """The second time while it is cleared up."""

    def interrupted(path: Path, recording: Recording) -> None:
        path.write_bytes(b"half")
        asks_again()
        raise KeyboardInterrupt

    kind = format_named("csv")
    monkeypatch.setattr("vid2ev.reformat.format_named", lambda name: replace(kind, write=interrupted))
    with pytest.raises(KeyboardInterrupt):
        reformat(recording, "out.csv", "csv")
    assert [path.name for path in Path().iterdir()] == ["whole.h5"]


def test_a_full_disk_leaves_what_was_there(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reformat(recording, "out.csv")
    before = Path("out.csv").read_bytes()

    def full(path: Path, recording: Recording) -> None:
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    kind = format_named("csv")
    monkeypatch.setattr("vid2ev.reformat.format_named", lambda name: type(kind)(**{**vars(kind), "write": full}))
    result = run(str(recording), "out.csv", "--format", "csv", "--overwrite")
    assert result.exit_code == 1 and "No space left" in result.stderr
    assert Path("out.csv").read_bytes() == before and {path.name for path in Path().iterdir()} == {
        "whole.h5",
        "out.csv",
    }


def test_two_do_not_write_to_one_place_at_a_time(recording: Path) -> None:
    said: list[Result] = []

    def meanwhile(_: object, __: object) -> None:
        if not said:
            said.append(run(str(recording), "out.csv", "--start", "1", "--overwrite"))
            assert run(str(recording), "other.csv").exit_code == 0

    assert reformat(recording, "out.csv", report=meanwhile)["events"] == 5000
    assert columns(Path("out.csv")) == columns(recording)
    assert said[0].exit_code == 2 and said[0].stderr.startswith("error: another vid2ev is writing .out.csv.new")
    assert {path.name for path in Path().iterdir()} == {"whole.h5", "out.csv", "other.csv"}


def test_what_a_killed_one_left_is_not_in_the_way(recording: Path) -> None:
    Path(".out.csv.new/made").mkdir(parents=True)
    for name in ("made/out.csv", "made/further.csv", "lock"):
        Path(".out.csv.new", name).write_text("half")
    reformat(recording, "out.csv")
    assert columns(Path("out.csv")) == columns(recording)
    assert {path.name for path in Path().iterdir()} == {"whole.h5", "out.csv"}


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names are text")
def test_names_that_are_no_text_are_printed_as_they_are(recording: Path) -> None:
    target = b"\xff.npz"
    command = [sys.executable, "-m", "vid2ev", "reformat", "--overwrite", recording, target]
    strict = os.environ | {"PYTHONIOENCODING": "utf-8:strict"}  # (as where people's language is set)
    done = subprocess.run(command, capture_output=True, env=strict, check=True)
    assert target in done.stdout and Path(os.fsdecode(target)).exists()


def test_every_format_that_is_read_can_be_named() -> None:
    assert all(format_named(name).open for name in FORMATS)
    assert open_events.__doc__


def test_the_summary_counts_from_the_first_event(tmp_path: Path) -> None:
    """Also of a clock that began long before, which the file does not say."""
    source = tmp_path / "late.csv"
    source.write_text("t,x,y,p\n7000000,1,1,1\n9000000,2,2,0\n")
    result = run(str(source), str(tmp_path / "late.h5"))
    assert "2 in 2 s" in result.output, result.output
    source.write_text("t,x,y,p\n7000000,1,1,1\n1234567897654321,2,2,0\n")
    result = run(str(source), str(tmp_path / "late.aedat4"))
    assert "2 in 1234567891 s" in result.output, result.output
