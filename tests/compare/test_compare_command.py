"""`vid2ev compare`: any two recordings, in any formats; what cannot be compared is refused in a sentence."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from event_streams import busy, events_of, isolated

from vid2ev import convert
from vid2ev.commands.compare import compare as command
from vid2ev.compare.recordings import compare_recordings
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import FORMATS, format_named
from vid2ev.formats.event_file import Recording
from vid2ev.formats.hdf5 import write_events
from vid2ev.reformat import reformat
from vid2ev.rig.camera import Camera, Rig, Source
from vid2ev.stream.events import Events

SIZE = (32, 24)
WRITTEN = [name for name in FORMATS if format_named(name).write]
BAG = Path(__file__).parents[3] / "shared" / "data" / "events" / "evt3_vga_legs.bag"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(
    events: Events, path: str, size: tuple[int, int] = SIZE, start_us: int = 0, duration_us: int | None = None
) -> str:
    last_us = int(events.t[-1]) if len(events) else start_us
    duration_us = last_us - start_us if duration_us is None else duration_us
    write_events(Path(path), Recording(size, start_us, duration_us, len(events), lambda: iter([events])))
    return path


def moved(events: Events, shift_us: int) -> Events:
    return Events(events.t + shift_us, events.x, events.y, events.p)


def compare(*arguments: str) -> dict[str, Any]:
    result = CliRunner().invoke(command, [*arguments, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.mark.parametrize("name", WRITTEN)
def test_another_format_is_the_same_recording(name: str) -> None:
    source = write(busy(3000, SIZE), "events.h5")
    target = f"other{format_named(name).suffix}"
    reformat(source, target, name)
    found = compare(target, source)
    assert found["events"] == found["reference_events"] == found["matched"] == 3000
    assert found["distance"] == found["count_error"] == found["timing_error_abs_p95_us"] == 0
    assert found["left_out"] == found["reference_left_out"] == 0


def test_a_recording_of_a_camera_and_its_copy() -> None:
    if not BAG.exists():
        pytest.skip(f"{BAG} is not there")
    pytest.importorskip("rosbags")
    reformat(BAG, "copy.raw")
    found = compare("copy.raw", str(BAG))
    assert found["events"] > 10_000 and found["distance"] == 0 and found["matched_share"] == 1


def test_numbers_and_text_and_picture() -> None:
    events = isolated(500, size=SIZE)
    mine = write(moved(events.select(np.arange(500) % 50 != 0), 40), "mine.h5")
    theirs = write(events, "theirs.h5")
    found = compare(mine, theirs)
    share = 0.02 / 1.98
    assert found["distance"] == pytest.approx(share + (1 - share) * (1 - np.exp(-0.04)))
    assert found["timing_error_median_us"] == 40 and found["matched_share_of_reference"] == 0.98
    result = CliRunner().invoke(command, [mine, theirs, "--plot", "new/picture.png"], catch_exceptions=False)
    assert "490 events against 500" in result.stdout and "40 us late" in result.stdout
    assert Path("new/picture.png").read_bytes()[:4] == b"\x89PNG"
    assert [path.name for path in Path("new").iterdir()] == ["picture.png"]
    with pytest.raises(UsageError, match="--overwrite"):
        CliRunner().invoke(command, [mine, theirs, "--plot", "new/picture.png"], catch_exceptions=False)
    compare(mine, theirs, "--plot", "new/picture.png", "--overwrite")
    with pytest.raises(UsageError, match=r"\.png"):
        CliRunner().invoke(command, [mine, theirs, "--plot", "picture.pdf"], catch_exceptions=False)
    with pytest.raises(DataError, match=rf"{mine}/new/picture.png cannot be written: .* is a file; choose another"):
        CliRunner().invoke(command, [mine, theirs, "--plot", f"{mine}/new/picture.png"], catch_exceptions=False)


def test_nothing_in_common_is_1_or_more_and_so_it_is_said() -> None:
    """Traces of events in bursts add up: five at once against none are five squared by five."""
    nothing = write(events_of([]), "nothing.h5", duration_us=10**6)
    for name, at_once in (("far.h5", 1), ("burst.h5", 5)):
        burst = write(events_of(np.repeat([1000, 500_000], at_once)), name, duration_us=10**6)
        assert compare(burst, nothing)["distance"] == pytest.approx(at_once)
        assert "1 or more: nothing in common" in CliRunner().invoke(command, [burst, nothing]).stdout


def test_one_is_one_event_and_no_events() -> None:
    one = write(events_of([1000]), "one.h5", duration_us=10**6)
    other = write(events_of([1000, 999_999], p=[0, 1]), "other.h5", duration_us=10**6)
    for pair in ((one, other), (other, one), (one, one)):
        said = CliRunner().invoke(command, [*pair, "--statistics"], catch_exceptions=False).stdout
        assert re.search(r"\b1 event\b", said) and not re.search(r"\b1 (?![mu]?s\b)[a-z]+s\b", said), said


def test_what_both_have_is_compared() -> None:
    events = busy(20_000, SIZE, duration_us=2_000_000)
    whole = write(events, "whole.h5")
    part = write(events.select(events.t < 1_000_000), "part.h5")
    last_us = int(events.t[events.t < 1_000_000][-1])
    found = compare(part, whole)
    assert found["distance"] == 0 and found["span_us"] == [0, last_us]
    assert found["left_out"] == 0 and found["reference_left_out"] == np.count_nonzero(events.t > last_us) > 9000
    assert "left out" in CliRunner().invoke(command, [part, whole]).stdout
    late = write(events.select(events.t >= 500_000), "late.h5", start_us=500_000)
    assert compare(late, part)["distance"] == 0
    assert compare(late, part)["left_out"] > 9000 and compare(late, part)["reference_left_out"] > 4000


def test_an_event_missing_at_the_end_is_missing() -> None:
    events = busy(1000, SIZE)
    found = compare(write(events.stretch(0, 999), "less.h5"), write(events, "all.h5"))
    assert found["distance"] == pytest.approx(1 / 1999) and found["reference_left_out"] == 0
    assert compare(write(moved(events, 70), "later.h5"), "all.h5")["matched"] == 1000
    begun = write(moved(events, 70), "begun.h5", start_us=70 + int(events.t[0]))
    assert events.t[0] < 4900 and compare(begun, "all.h5")["matched"] == 1000
    empty = compare(write(Events.empty(), "empty.h5"), "all.h5")
    assert empty["matched_share_of_reference"] == 0 and empty["reference_events"] == 1000


@pytest.mark.parametrize(("apart_us", "one_end"), [(4999, True), (5000, False)])
def test_ends_less_than_a_window_apart_are_one_end(apart_us: int, one_end: bool) -> None:
    """Nothing beyond it is left out then, at the beginning or at the end; and recordings may share only an instant."""
    inner = write(events_of([20_000, 50_000]), "inner.h5", start_us=10_000)
    ends_us = 10_000 - apart_us, 50_000 + apart_us
    outer = write(events_of([ends_us[0], 20_000, ends_us[1]]), "outer.h5", start_us=ends_us[0])
    for found, name in ((compare(inner, outer), "reference_left_out"), (compare(outer, inner), "left_out")):
        assert found["span_us"] == (list(ends_us) if one_end else [10_000, 50_000])
        assert found[name] == (0 if one_end else 2)
    after = write(events_of([50_000, 90_000]), "after.h5", start_us=50_000)
    found = compare(inner, after)
    assert (found["span_us"], found["events"], found["reference_events"], found["matched"]) == ([50_000] * 2, 1, 1, 1)


def test_clocks_that_differ_are_laid_on_one_another_on_request() -> None:
    events = busy(1000, SIZE)
    here = write(events, "here.h5")
    there = write(moved(events, 10**9), "there.h5", start_us=10**9)
    with pytest.raises(UsageError, match="--align start") as raised:
        compare(here, there)
    assert "\n" not in str(raised.value)
    found = compare(here, there, "--align", "start")
    assert found["distance"] == 0 and found["reference_shifted_us"] == -(10**9) and found["events"] == 1000


@pytest.mark.parametrize("name", ["csv", "rpg"])
def test_what_says_no_beginning_is_laid_on_another_by_its_first_event(name: str) -> None:
    events = busy(1000, SIZE)
    here = write(moved(events, 500_000), "here.h5", start_us=500_000)
    late = write(moved(events, 3_500_000), "late.h5", start_us=3_000_000)
    for path, shift_us in ((here, 0), (late, -3_000_000)):
        reformat(path, f"{path}{format_named(name).suffix}", name)
        found = compare(here, f"{path}{format_named(name).suffix}", "--align", "start")
        assert found["distance"] == 0 and found["reference_shifted_us"] == shift_us and found["events"] == 1000


def test_what_could_say_its_beginning_and_does_not_is_laid_on_another_by_its_first_event() -> None:
    events = busy(1000, SIZE)
    here = write(events, "here.h5")
    later = moved(events, 20_000_000)
    columns = {name: getattr(later, name) for name in ("t", "x", "y", "p")}
    np.savez("later.npz", size=SIZE, **columns)
    np.savez("begun.npz", size=SIZE, start_us=0, **columns)  # (says one, long before its first event)
    np.savez("long.npz", size=SIZE, start_us=0, **columns | {"t": later.t + 10**12})
    for path, shift_us in (("later.npz", -20_000_000), ("begun.npz", 0), ("long.npz", -20_000_000 - 10**12)):
        found = compare(here, path, "--align", "start")
        assert found["reference_shifted_us"] == shift_us
        assert (found["distance"] == 0) == (shift_us != 0)


def test_a_last_event_at_the_beginning_of_the_clock_is_one() -> None:
    Path("early.csv").write_text("t,x,y,p\n-5,1,1,1\n0,2,2,0\n")
    found = compare("early.csv", "early.csv")
    assert (found["events"], found["reference_left_out"]) == (2, 0)
    reformat("early.csv", "early.npz")
    assert np.load("early.npz")["t"].tolist() == [-5, 0]


@pytest.mark.parametrize("align", ["clock", "start"])
@pytest.mark.parametrize("begin_us", [-(2**62) + 1, 2**62 - 10, 2_100_000_000_000_000_000])
def test_times_of_which_differences_would_be_others_are_refused(begin_us: int, align: str) -> None:
    """Pairs of events were sought beyond the memory."""
    for name, shift_us in (("a", 0), ("b", 3)):
        t = np.array([begin_us + shift_us, 2**62 - 1])
        np.savez(f"{name}.npz", t=t, x=np.zeros(2, np.uint16), y=np.zeros(2, np.uint16), p=np.ones(2, np.uint8))
    with pytest.raises(DataError, match=r"a\.npz: times beyond 63,000 years"):
        compare_recordings("a.npz", "b.npz", align=align)


def test_sensors_of_different_sizes_are_refused_but_not_a_file_that_does_not_say() -> None:
    events = busy(100, (10, 10))
    small, large = write(events, "small.h5", (10, 10)), write(events, "large.h5", (12, 10))
    with pytest.raises(UsageError, match=r"10x10 pixels, .* 12x10"):
        compare(small, large)
    reformat(large, "unsaid.csv")
    assert compare("unsaid.csv", large)["size"] == [12, 10]
    assert compare(small, "unsaid.csv")["distance"] == 0
    reformat(write(events_of([1], x=20), "far.h5"), "far.csv")
    with pytest.raises(UsageError, match="one size"):
        compare("far.csv", large)
    assert compare("far.csv", "unsaid.csv")["size"] == [21, 10]


def test_what_is_no_recording_is_refused() -> None:
    good = write(busy(10, SIZE), "good.h5")
    with pytest.raises(UsageError, match="no such file"):
        compare(good, "nothing.h5")
    Path("text.txt").write_text("nothing of the kind\n")
    with pytest.raises(DataError, match="no event file"):
        compare("text.txt", good)


@pytest.mark.parametrize("limit", [1, 300, 4000])
def test_bands_of_rows_change_nothing(limit: int) -> None:
    a, b = write(busy(3000, SIZE, seed=1), "a.h5"), write(busy(2500, SIZE, seed=2), "b.h5")
    read: list[tuple[int, int]] = []
    whole = compare_recordings(a, b)
    parts = compare_recordings(a, b, limit=limit, report=lambda recording, done: read.append((recording.count, done)))
    assert parts.as_dict() == whole.as_dict()
    np.testing.assert_array_equal(parts.comparison.squared_distance, whole.comparison.squared_distance)
    assert read[-1][0] == read[-1][1] == 5500 * {1: 24, 300: 24, 4000: 2}[limit]


def test_rigs_camera_by_camera() -> None:
    clip = "synthetic:moving-edge,size=64x48,fps=200,duration_s=0.1"
    for folder, names in (("one", ("left", "right")), ("two", ("left", "right")), ("three", ("left", "top"))):
        cameras = (*(Camera(name=name, kind="dvs") for name in names), Camera(name="aps", kind="cis"))
        seed = {"one": 1, "two": 2, "three": 1}[folder]
        rig = Rig(source=Source(fov_deg=60.0), cameras=cameras)
        convert(clip, folder, rig=rig, upsample="none", seed=seed, threads=1, preview=False)
    found = compare("one", "two", "--plot", "rig.png")["cameras"]
    assert list(found) == ["left", "right"]
    assert all(camera["distance"] > 0 and camera["reference"] == f"two/{name}" for name, camera in found.items())
    assert Path("rig_left.png").exists() and Path("rig_right.png").exists()
    text = CliRunner().invoke(command, ["one", "one"], catch_exceptions=False).stdout
    assert text.count("distance  0 at 1 ms") == 2 and "camera    right" in text
    with pytest.raises(UsageError, match="left, top"):
        compare("one", "three")
    with pytest.raises(UsageError, match="of the cameras aps, left, right; give one: one/left or one/right"):
        compare("one", "two/left")
    rig = Rig(source=Source(fov_deg=60.0), cameras=(Camera(name="aps", kind="cis"),))
    convert(clip, "frames", rig=rig, upsample="none", threads=1, preview=False)
    for rigs in (("frames", "frames"), ("frames", "one"), ("one", "frames")):
        with pytest.raises(UsageError, match=r"^frames has frame cameras alone.* give a rig with event cameras$"):
            compare(*rigs)
    shutil.rmtree("one/right")
    assert compare("two/left", "one")["distance"] == compare("two/left", "one/left")["distance"] > 0
    assert compare("one/left", "two/left")["distance"] == found["left"]["distance"]


def test_a_folder_of_recordings_is_no_rig() -> None:
    for name in ("one/a", "one/rig", "two/a", "two/rig"):
        Path(name).parent.mkdir(exist_ok=True)
        convert(
            "synthetic:moving-edge,size=24x16,duration_s=0.1", name, frame_camera=name.endswith("rig"), preview=False
        )
    with pytest.raises(UsageError, match="one"):
        CliRunner().invoke(command, ["one", "two"], catch_exceptions=False, standalone_mode=False)


def test_statistics_of_each_alone() -> None:
    one, other = write(busy(3000, SIZE, seed=1), "a.h5"), write(isolated(20, size=SIZE), "b.h5", duration_us=30 * 10**6)
    found = compare(one, other, "--statistics", "--align", "start")
    assert "statistics" not in compare(one, other, "--align", "start")
    assert found["statistics"]["events"] == found["events"]
    assert found["reference_statistics"]["events"] == found["reference_events"]
    said = CliRunner().invoke(command, [one, other, "--statistics", "--align", "start"], catch_exceptions=False)
    assert "A alone" in said.stdout and "events/pixel/s" in said.stdout


def test_rates_are_over_the_time_compared() -> None:
    """Of which the first event says nothing."""
    path = write(moved(isolated(20, size=SIZE), 80 * 10**6), "a.h5")
    found = compare(path, path, "--statistics")["statistics"]
    assert found["rate_hz"] == pytest.approx(20 / 100 / (SIZE[0] * SIZE[1]))


@pytest.mark.parametrize("late_s", [0, 80])
def test_where_no_file_says_when_it_begins_the_first_event_does(late_s: int) -> None:
    """A camera's clock may have begun long before it recorded; what a recording is like does not depend on that."""
    events = moved(isolated(20, size=SIZE), late_s * 10**6)
    for name in ("a.txt", "b.txt"):
        reformat(write(events, "said.h5"), name, "rpg")
    found = compare("a.txt", "b.txt", "--statistics")
    seconds = (int(events.t[-1]) - int(events.t[0])) / 1e6
    assert found["statistics"]["rate_hz"] == pytest.approx(20 / seconds / (SIZE[0] * SIZE[1]))
    assert found["events"] == 20


def test_before_the_first_event_of_a_file_another_may_say_that_there_was_none() -> None:
    """So it counts as time in which both were there."""
    events = moved(isolated(20, size=SIZE), 80 * 10**6)
    reformat(write(events, "said.h5"), "a.txt", "rpg")
    found = compare("a.txt", "said.h5", "--statistics")
    assert found["statistics"]["rate_hz"] == pytest.approx(20 / 100 / (SIZE[0] * SIZE[1]))
