"""What any format writes, it reads: every event, its time on the clock of the source, and what else it keeps."""

from __future__ import annotations

import errno
import re
import shutil
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recordings import all_events, assert_same, events_of, recording_of, recordings_for, sparse, written

from vid2ev.errors import DataError, UsageError
from vid2ev.formats import (
    FORMATS,
    check_holds,
    describe_events,
    format_named,
    open_events,
    read_events,
    recognise,
    survey,
)
from vid2ev.stream.events import Events

WRITABLE = [name for name in FORMATS if format_named(name).write]
TEXT = {"rpg": "{0} {1}\n", "dat": "% Width {0}\n", "aedat4": ">{0}<", "evt2": "y {0}x{1}", "evt3": "y {0}x{1}"}
BYTES: dict[str, Callable[[int, int], bytes]] = {  # the size, by format
    **{name: lambda *size, text=text: text.format(*size).encode() for name, text in TEXT.items()},  # type: ignore[misc]
    **{name: lambda width, height: struct.pack("<II", height, width) for name in ("ros1", "ros2")},
}
CASES = [(name, case) for name in WRITABLE for case in recordings_for(format_named(name))]


@pytest.mark.parametrize(("name", "case"), CASES)
def test_all_that_is_written_is_read(tmp_path: Path, name: str, case: str) -> None:
    kind = format_named(name)
    recording = recordings_for(kind)[case]
    path = written(kind, recording, tmp_path)
    found = recognise(path)
    assert found is not None and found.name == name
    file = open_events(path)
    read = Events.concatenate(file.events())
    assert_same(read, all_events(recording))
    assert file.warnings == []
    assert file.size == (recording.size if "size" in kind.keeps else None)
    assert file.start_us == (recording.start_us if "start" in kind.keeps else 0)
    assert file.labelled == ("labels" in kind.keeps)
    if file.labelled and len(read):
        np.testing.assert_array_equal(read.label, all_events(recording).label)


@pytest.mark.parametrize("name", WRITABLE)
def test_the_format_that_is_named_instead_of_one_that_cannot_hold_it_can(name: str) -> None:
    """Whatever the size, the length and the instant, with all other formats tried as well."""
    for size in ((9, 9), (1 << 11, 9), (9, 1 << 14), (1 << 15, 9), (9, (1 << 16) - 1), (1 << 16, 9)):
        for duration_us in (0, 1 << 32, 10**14, 10**15, 10**18):
            for start_us in (-1, 0, 10**15, 1 << 51):
                try:
                    check_holds(format_named(name), size, duration_us, start_us)
                except (UsageError, DataError) as error:
                    instead = re.search(r"choose --format ([\w-]+)", str(error))
                    assert instead, error
                    check_holds(format_named(instead[1]), size, duration_us, start_us)


def narrow(path: Path, name: str, size: tuple[int, int], width: int) -> None:
    """Have a file of this size say another width."""
    if name == "npz":
        with np.load(path) as found:
            arrays = dict(found)
        np.savez(path, **arrays | {"size": np.array([width, size[1]])})
    elif name in ("hdf5", "v2e-hdf5"):
        with h5py.File(path, "r+") as file:
            file.attrs["width"] = file.attrs["width"].dtype.type(width)
    else:
        old, new = BYTES[name](*size), BYTES[name](width, size[1])
        assert old in path.read_bytes() and len(old) == len(new)
        path.write_bytes(path.read_bytes().replace(old, new))


@pytest.mark.parametrize("name", [name for name in WRITABLE if "size" in format_named(name).keeps])
def test_events_outside_of_the_sensor_are_left_out_and_counted(tmp_path: Path, name: str) -> None:
    """In all formats alike, of a sensor that says it is narrower than where its events are."""
    recording = sparse()
    path, events = written(format_named(name), recording, tmp_path), all_events(recording)
    narrow(path, name, recording.size, 100)
    inside = events.select(events.x < 100)
    assert 0 < len(inside) < len(events)
    said = f"{len(events) - len(inside)} events outside of the 100x{recording.size[1]} sensor are left out"
    file = open_events(path)
    for _ in range(2):
        assert_same(Events.concatenate(file.events()), inside)
        assert file.warnings == [said]
    assert survey(open_events(path)).count == len(inside) == describe_events(path)["events"]
    start_us, stop_us = int(events.t[100]), int(events.t[-100])
    part = list(read_events(path, start_us, stop_us, block=3))
    assert_same(Events.concatenate(part), inside.select((inside.t >= start_us) & (inside.t < stop_us)))
    assert all(0 < len(block) <= 3 for block in part)


@pytest.mark.parametrize("name", WRITABLE)
def test_the_same_events_give_the_same_bytes(tmp_path: Path, name: str) -> None:
    kind, recording = format_named(name), recordings_for(format_named(name))["dense"]
    assert written(kind, recording, tmp_path).read_bytes() == written(kind, recording, tmp_path).read_bytes()


@pytest.mark.parametrize("name", WRITABLE)
def test_windows_and_blocks(tmp_path: Path, name: str) -> None:
    recording = sparse()
    path, events = written(format_named(name), recording, tmp_path), all_events(recording)
    start, stop = int(events.t[100]), int(events.t[-100])
    blocks = list(read_events(path, start, stop, block=64))
    assert all(0 < len(block) <= 64 for block in blocks)
    assert_same(Events.concatenate(blocks), events.select((events.t >= start) & (events.t < stop)))
    for kind in (np.int64, np.uint64):
        same = read_events(path, kind(start), kind(stop), block=64)
        assert_same(Events.concatenate(same), Events.concatenate(blocks))
        assert list(read_events(path, kind(0), kind(recording.start_us))) == []
    for none in (0, -5):
        with pytest.raises(UsageError, match=f"block {none}: expected at least 1"):
            list(read_events(path, block=none))
    with pytest.raises(UsageError, match=r"start_us 10000\.0: expected a whole number"):
        list(read_events(path, 1e4))


@pytest.mark.parametrize("name", WRITABLE)
def test_what_is_read_and_written_again_is_the_same_file(tmp_path: Path, name: str) -> None:
    kind, events = format_named(name), all_events(sparse())
    first = written(kind, recording_of(events, (346, 260), int(events.t[0])), tmp_path).read_bytes()
    again = survey(open_events(tmp_path / f"events{kind.suffix}"))
    (tmp_path / "again").mkdir()
    assert written(kind, again, tmp_path / "again").read_bytes() == first


@pytest.mark.parametrize("start_us", [-1, -(10**13) - 7, 1_700_000_000_123_456_789, 7 - 2**62, 2**62 - 10**6])
@pytest.mark.parametrize("name", WRITABLE)
def test_times_may_be_counted_from_any_instant(tmp_path: Path, name: str, start_us: int) -> None:
    """Before that of 0, or in nanoseconds since 1970 that are taken for microseconds."""
    kind, events = format_named(name), events_of(start_us + np.arange(0, 9000, 3), (40, 30))
    if kind.clock_us:
        with pytest.raises(UsageError, match=f"format {name} cannot hold times from"):
            check_holds(kind, (40, 30), 9000, start_us)
        return
    path = written(kind, recording_of(events, (40, 30), start_us), tmp_path)
    file = open_events(path)
    assert_same(Events.concatenate(file.events()), events)
    assert file.start_us == (start_us if "start" in kind.keeps else 0)
    assert survey(file).start_us == (start_us if "start" in kind.keeps or start_us < 0 else events.t[0])
    middle = events.select((events.t >= events.t[99]) & (events.t < events.t[-99]))
    assert_same(Events.concatenate(read_events(path, int(events.t[99]), int(events.t[-99]))), middle)


@pytest.mark.parametrize("name", WRITABLE)
@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_events(tmp_path: Path, name: str, data: st.DataObject) -> None:
    kind = format_named(name)
    most = kind.largest or (1 << 16, 1 << 16)
    size = tuple(data.draw(st.integers(1, side)) for side in most)
    gaps = data.draw(
        st.lists(st.integers(0, 3) | st.integers(0, 10**5) | st.sampled_from([4096, 1 << 24]), max_size=40)
    )
    start, late = data.draw(st.integers(0, 1 << 50)), data.draw(st.integers(0, 5000))
    events = events_of(start + np.cumsum(gaps, dtype=np.int64), (size[0], size[1]), data.draw(st.integers(0, 99)))
    duration = sum(gaps) + late
    path = written(kind, recording_of(events, (size[0], size[1]), start, duration, block=7), tmp_path)
    file = open_events(path)
    assert_same(Events.concatenate(file.events()), events)
    assert file.warnings == []


@pytest.mark.parametrize("name", WRITABLE)
@pytest.mark.parametrize("t", [[5, 4], [-1, 0]])
def test_times_out_of_order_or_before_the_start_are_not_written(tmp_path: Path, name: str, t: list[int]) -> None:
    with pytest.raises(ValueError, match="order"):
        written(format_named(name), recording_of(events_of(np.array(t), (9, 9)), (9, 9), 0, 10), tmp_path)


@pytest.mark.parametrize("name", WRITABLE)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_full_disk_is_an_error(tmp_path: Path, name: str) -> None:
    kind = format_named(name)
    if name in ("dat", "ros2") or "hdf5" in name:  # (hdf5 and ros2 have tests of their own)
        pytest.skip("this format seeks, appends or renames")
    assert kind.write is not None and sys.platform == "linux"
    full = tmp_path / "full"  # (a link, so that whatever is done to it is not done to the device)
    full.symlink_to("/dev/full")
    with pytest.raises(OSError) as raised:
        kind.write(full, recordings_for(kind)["dense"])
    assert raised.value.errno == errno.ENOSPC


def test_dat_goes_on_in_further_files(tmp_path: Path) -> None:
    kind = format_named("dat")
    recording = recordings_for(kind)["long"]
    path, events = written(kind, recording, tmp_path), all_events(recording)
    parts = sorted(tmp_path.iterdir())
    assert [part.name for part in parts] == ["events.dat", *(f"events_{k}.dat" for k in range(1, 6))]
    said = describe_events(path)
    assert said["events"] == len(events) and said["bytes"] == sum(part.stat().st_size for part in parts)
    alone = Events.concatenate(read_events(tmp_path / "events_2.dat"))
    assert_same(alone, events.select(events.t >> 32 == 2))
    assert open_events(tmp_path / "events_2.dat").start_us == 2 << 32
    (tmp_path / "events_4.dat").unlink()
    file = open_events(path)
    assert_same(Events.concatenate(file.events()), events.select(events.t >> 32 != 4))
    assert len(file.warnings) == 1 and file.warnings[0].startswith("1 further files of the recording are not there")


@pytest.mark.parametrize("foreign", ["short", "longer"])
def test_dat_does_not_go_on_in_a_file_of_another_recording(tmp_path: Path, foreign: str) -> None:
    """Which has the name of its second part, but says of itself that it is 1/1, or 2/3."""
    kind, turns = format_named("dat"), {"long": 1, "short": 0, "longer": 2}
    for name, last_turn in turns.items():
        t = np.array([0, 5, (last_turn << 32) + 9])
        (tmp_path / name).mkdir()
        written(kind, recording_of(events_of(t, (100, 100)), (100, 100)), tmp_path / name)
    path = tmp_path / "long" / "events.dat"
    other = "events.dat" if foreign == "short" else "events_1.dat"
    shutil.copy(tmp_path / foreign / other, path.with_name("events_1.dat"))
    file = open_events(path)
    assert Events.concatenate(file.events()).t.tolist() == [0, 5]
    assert [text.split(" are not there")[0] for text in file.warnings] == ["1 further files of the recording"]


@pytest.mark.parametrize("differs", ["size", "start", "events", "length"])
def test_dat_does_not_go_on_in_the_same_part_of_another_recording(tmp_path: Path, differs: str) -> None:
    """Both have two parts, and the second of one is in the place of the other's."""
    kind = format_named("dat")
    for name, changed in (("one", ""), ("other", differs)):
        t = np.array([0, 5, 7, (1 << 32) + 9 + (changed == "length")])[changed == "events" :]
        start_us = 1000 * (changed == "start")
        size = (100, 100 + (changed == "size"))
        (tmp_path / name).mkdir()
        written(kind, recording_of(events_of(t + start_us, size), size, start_us), tmp_path / name)
    path = tmp_path / "one" / "events.dat"
    assert len(Events.concatenate(open_events(path).events())) == 4
    shutil.copy(tmp_path / "other" / "events_1.dat", path.with_name("events_1.dat"))
    file = open_events(path)
    assert Events.concatenate(file.events()).t.tolist() == [0, 5, 7]
    assert [text.split(" are not there")[0] for text in file.warnings] == ["1 further files of the recording"]


def test_dat_without_a_line_about_all_of_it_goes_on(tmp_path: Path) -> None:
    """As earlier versions wrote it."""
    path = written(
        format_named("dat"), recording_of(events_of(np.array([0, 5, (1 << 32) + 9]), (100, 100)), (100, 100)), tmp_path
    )
    for part in sorted(tmp_path.iterdir()):
        head, line, rest = part.read_bytes().partition(b"% recording 3 events in 4294967305 us\n")
        assert line
        part.write_bytes(head + rest)
    file = open_events(path)
    assert len(Events.concatenate(file.events())) == 3 and not file.warnings


def test_dat_holds_no_more_files_than_it_is_read_from(tmp_path: Path) -> None:
    kind = format_named("dat")
    assert kind.longest_us is not None
    with pytest.raises(UsageError, match=r"format dat cannot hold .* s; choose --format hdf5"):
        check_holds(kind, (9, 9), kind.longest_us + 1)
    check_holds(kind, (9, 9), kind.longest_us)
    recording = recording_of(events_of(np.array([0, kind.longest_us]), (9, 9)), (9, 9))
    assert_same(Events.concatenate(read_events(written(kind, recording, tmp_path))), all_events(recording))


@pytest.mark.parametrize("after_us", [-1, 0, 1])
@pytest.mark.parametrize("turns", [1, 2])
def test_dat_ends_at_the_end_of_a_file_and_just_beyond(tmp_path: Path, turns: int, after_us: int) -> None:
    """The last event of a recording at, and beside, the instant at which another file begins."""
    kind, last_us = format_named("dat"), (turns << 32) + after_us
    recording = recording_of(events_of(np.array([0, 5, last_us]), (100, 100)), (100, 100))
    assert_same(Events.concatenate(read_events(written(kind, recording, tmp_path))), all_events(recording))
    assert len(list(tmp_path.iterdir())) == (last_us >> 32) + 1
