"""events.h5: what is written is what plain h5py reads, in DSEC's layout; what is damaged is refused in one sentence."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.formats import describe_events, open_events, read_events, survey
from vid2ev.formats.event_file import BLOCK, Recording
from vid2ev.formats.hdf5 import write_events
from vid2ev.stream.events import Events

SIZE = (320, 240)


def events_at(t: np.ndarray, labelled: bool = False, seed: int = 0) -> Events:
    random = np.random.default_rng(seed)
    t = np.asarray(t, np.int64)
    x, y = (random.integers(0, side, len(t)).astype(np.uint16) for side in SIZE)
    p, label = (random.integers(0, n, len(t)).astype(np.uint8) for n in (2, 4))
    return Events(t, x, y, p, label if labelled else None)


def write(path: Path, events: Events, t_offset_us: int = 0, duration_us: int | None = None) -> None:
    last = int(events.t[-1]) - t_offset_us if len(events) else 0
    blocks = [events.select(np.arange(at, min(at + BLOCK, len(events)))) for at in range(0, max(len(events), 1), BLOCK)]
    duration_us, labelled = max(last, duration_us or 0), events.label is not None
    write_events(path, Recording(SIZE, t_offset_us, duration_us, len(events), lambda: iter(blocks), labelled))


def assert_same(one: Events, other: Events) -> None:
    for name in ("t", "x", "y", "p"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert getattr(one, name).dtype == getattr(other, name).dtype


@pytest.mark.parametrize("labelled", [False, True])
def test_plain_h5py_reads_what_was_written(tmp_path: Path, labelled: bool) -> None:
    offset_us = 3 * 3600 * 10**6  # a recording that starts three hours in
    t = np.sort(np.random.default_rng(1).integers(0, 5_000_000, BLOCK + 12_345)) + offset_us
    events = events_at(t, labelled)
    write(tmp_path / "events.h5", events, offset_us)
    with h5py.File(tmp_path / "events.h5") as file:
        assert {name: file[f"events/{name}"].dtype for name in "txyp"} == {"t": "u4", "x": "u2", "y": "u2", "p": "u1"}
        assert file["ms_to_idx"].dtype == "u8" and file["t_offset"].dtype == "i8" and file["t_offset"].shape == ()
        assert (file.attrs["width"], file.attrs["height"], file.attrs["version"]) == (*SIZE, 1)
        assert file["t_offset"][()] == offset_us
        np.testing.assert_array_equal(file["events/t"][:].astype(np.int64) + offset_us, events.t)
        for name in ("x", "y", "p"):
            np.testing.assert_array_equal(file[f"events/{name}"], getattr(events, name))
        assert ("label" in file["events"]) == labelled
        if labelled:
            np.testing.assert_array_equal(file["events/label"], events.label)
        milliseconds = np.arange(len(file["ms_to_idx"])) * 1000
        np.testing.assert_array_equal(file["ms_to_idx"], np.searchsorted(events.t - offset_us, milliseconds))
        assert file["ms_to_idx"][-1] == len(events)


gaps = st.lists(st.integers(0, 3000) | st.sampled_from([0, 1, 999, 1000, 1001, 2_500_000]), max_size=60)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    gaps=gaps, offset=st.integers(0, 2**50), rest=st.integers(0, 5000), window=st.tuples(*[st.integers(-9, 10**7)] * 2)
)
def test_any_window_of_any_times_is_found(
    tmp_path: Path, gaps: list[int], offset: int, rest: int, window: tuple[int, int]
) -> None:
    relative = np.cumsum(gaps, dtype=np.int64)
    events = events_at(relative + offset)
    duration = (int(relative[-1]) if gaps else 0) + rest
    write(tmp_path / "events.h5", events, offset, duration)
    with h5py.File(tmp_path / "events.h5") as file:
        index = file["ms_to_idx"][:]
    assert len(index) == duration // 1000 + 2  # every begun millisecond has its end, too
    np.testing.assert_array_equal(index, np.searchsorted(relative, np.arange(len(index)) * 1000))
    start, stop = (offset + at for at in window)
    inside = events.select((events.t >= start) & (events.t < stop))
    assert_same(Events.concatenate(read_events(tmp_path / "events.h5", start, stop, block=7)), inside)
    assert_same(Events.concatenate(read_events(tmp_path / "events.h5", block=7)), events)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(gaps=gaps, frame_gaps=gaps, offset=st.integers(0, 2**50), block=st.integers(1, 70))
def test_events_are_counted_frame_by_frame(
    tmp_path: Path, gaps: list[int], frame_gaps: list[int], offset: int, block: int
) -> None:
    t, frame_us = (offset + np.cumsum(column, dtype=np.int64) for column in (gaps, frame_gaps))
    events, last = events_at(t), int(max([offset, *t, *frame_us]))
    blocks = [events.select(np.arange(at, min(at + block, len(t)))) for at in range(0, len(t), block)]
    recording = Recording(SIZE, offset, last - offset, len(t), lambda: iter(blocks), frame_us=frame_us)
    write_events(tmp_path / "events.h5", recording)
    with h5py.File(tmp_path / "events.h5") as file:
        np.testing.assert_array_equal(file["frames/t"][:] + offset, frame_us)
        np.testing.assert_array_equal(file["frames/to_idx"], [np.count_nonzero(t <= at) for at in frame_us])
    again = survey(open_events(tmp_path / "events.h5"))
    assert again.frame_us is not None and again.duration_us == (last - offset if len(t) or len(frame_us) else 0)
    np.testing.assert_array_equal(again.frame_us, frame_us)


@pytest.mark.parametrize(("last", "kind"), [(2**32 - 1, "u4"), (2**32, "u8"), (2**33, "u8")])
def test_times_beyond_71_minutes_are_wide(tmp_path: Path, last: int, kind: str) -> None:
    events = events_at(np.array([0, 5, last]))
    write(tmp_path / "events.h5", events)
    with h5py.File(tmp_path / "events.h5") as file:
        assert file["events/t"].dtype == kind
        assert file["ms_to_idx"][-2:].tolist() == [2, 3]
    assert_same(Events.concatenate(read_events(tmp_path / "events.h5")), events)
    assert_same(Events.concatenate(read_events(tmp_path / "events.h5", last, last + 1)), events.select(np.array([2])))


def test_the_same_events_give_the_same_bytes(tmp_path: Path) -> None:
    events = events_at(np.sort(np.random.default_rng(2).integers(0, 10**6, 200_000)), labelled=True)
    write(tmp_path / "one.h5", events)
    time.sleep(1.1)  # files with times of writing would differ in a second
    write(tmp_path / "other.h5", events)
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "other.h5").read_bytes()


@pytest.mark.parametrize("t", [[5, 4], [-1, 0]])
def test_times_out_of_order_or_before_the_start_are_not_written(tmp_path: Path, t: list[int]) -> None:
    with pytest.raises(ValueError, match="order"):
        write(tmp_path / "events.h5", events_at(np.array(t)), duration_us=10)


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"size": (100, 240)}, "outside of 100x240 pixels"),
        ({"size": (320, 7)}, "outside of 320x7 pixels"),
        ({"duration_us": 998}, "outside of the recording"),
        ({"count": 1001}, "1000 events, 1001 announced"),
    ],
)
def test_what_is_not_as_the_recording_says_is_not_written(tmp_path: Path, said: dict[str, Any], expected: str) -> None:
    """A file with those attributes would be refused, or read wrong, later."""
    events = events_at(np.arange(1000))
    recording = Recording(SIZE, 0, 999, 1000, lambda: iter([events]))
    with pytest.raises(ValueError, match=expected):
        write_events(tmp_path / "events.h5", replace(recording, **said))
    write_events(tmp_path / "events.h5", recording)


def test_the_description_counts(tmp_path: Path) -> None:
    events = events_at(np.array([7, 7, 1999]), labelled=True)
    write(tmp_path / "events.h5", events)
    found = describe_events(tmp_path / "events.h5")
    assert (found["events"], found["on"], found["off"]) == (3, int(events.p.sum()), 3 - int(events.p.sum()))
    assert (found["first_us"], found["last_us"], found["size"], found["labels"]) == (7, 1999, list(SIZE), True)
    assert describe_events(tmp_path)["events"] == 3  # the folder will do


def test_files_of_others_without_size_and_index_are_read(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        for name, values in {"t": [10, 20, 2000], "x": [1, 2, 3], "y": [4, 5, 6], "p": [0, 1, 1]}.items():
            file[f"events/{name}"] = np.array(values, np.int32)
    (events,) = read_events(tmp_path / "other.h5", 20)
    assert events.t.tolist() == [20, 2000] and events.y.tolist() == [5, 6]
    assert describe_events(tmp_path / "other.h5")["size"] is None


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    t=st.lists(st.integers(0, 5000), max_size=40),
    window=st.tuples(*[st.none() | st.integers(-9, 5009)] * 2),
    version=st.sampled_from([None, "2", 2, [1, 1]]),
)
def test_any_window_of_times_of_others_in_whatever_order_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, t: list[int], window: tuple[int | None, int | None], version: Any
) -> None:
    """Times can be looked up only where they are in order, and an index may say anything."""
    monkeypatch.setattr("vid2ev.formats.hdf5.BLOCK", 4)
    times, places = np.array(t, np.uint32), np.arange(len(t), dtype=np.uint16)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        for name, values in {"t": times, "x": places, "y": places, "p": places % 2}.items():
            file[f"events/{name}"] = values
        file["ms_to_idx"] = np.searchsorted(times, np.arange(6) * 1000)
        file.attrs.update({} if version is None else {"version": version})
    start, stop = (-(1 << 40) if window[0] is None else window[0]), (1 << 40 if window[1] is None else window[1])
    found = Events.concatenate(read_events(tmp_path / "other.h5", *window, block=3))
    np.testing.assert_array_equal(found.x, places[(times >= start) & (times < stop)])


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    places=st.lists(st.integers(0, 100), min_size=1, max_size=9),
    said=st.sampled_from([0, 1, 50, 99, 100, 101, 1 << 40, (1 << 63) - 1, (1 << 64) - 1]),
    window=st.tuples(*[st.integers(-9, 10**5)] * 2),
)
def test_a_damaged_index_finds_no_other_window(
    tmp_path: Path, places: list[int], said: int, window: tuple[int, int]
) -> None:
    """What it says may be any number; of the largest reading did not end."""
    events = events_at(np.arange(100) * 1000)
    write(tmp_path / "events.h5", events, 0, 99_000)
    with h5py.File(tmp_path / "events.h5", "r+") as file:
        for place in places:
            file["ms_to_idx"][place] = said
    inside = events.select((events.t >= window[0]) & (events.t < window[1]))
    try:
        assert_same(Events.concatenate(read_events(tmp_path / "events.h5", *window)), inside)
    except DataError as error:
        assert "its ms_to_idx is not of its times" in str(error)


@pytest.mark.parametrize(
    "packing",
    [
        {"compression": "gzip", "shuffle": True, "fletcher32": True},
        {"compression": "lzf"},
        hdf5plugin.BZip2(),
        hdf5plugin.Bitshuffle(cname="lz4"),
        hdf5plugin.Blosc(cname="zstd"),
        hdf5plugin.LZ4(),
        hdf5plugin.Zstd(),
    ],
    ids=lambda packing: str(packing.get("compression", type(packing).__name__)),
)
def test_files_that_others_packed_are_read(tmp_path: Path, packing: Any) -> None:
    t = np.arange(5000)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        for name, values in {"t": 10 * t, "x": t % 320, "y": t % 240, "p": t % 2}.items():
            file.create_dataset(f"events/{name}", data=values.astype(np.uint16), chunks=(1000,), **packing)
    assert sum(events.x.astype(int).sum() for events in read_events(tmp_path / "other.h5")) == (t % 320).sum()


def refused(path: Path) -> str:
    with pytest.raises(Vid2evError) as raised:
        list(read_events(path))
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)
    return str(raised.value)


def test_what_is_no_event_file_is_refused(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path / "missing.h5")
    assert "no such file" in refused(tmp_path)
    (tmp_path / "text.h5").write_text("t x y p\n")
    assert "no event file" in refused(tmp_path / "text.h5")
    (tmp_path / "empty.h5").touch()
    assert "no event file" in refused(tmp_path / "empty.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["events/t"] = np.arange(3)
    assert "DSEC" in refused(tmp_path / "other.h5")
    with h5py.File(tmp_path / "uneven.h5", "w") as file:
        for name, count in zip("txyp", (3, 3, 3, 2), strict=True):
            file[f"events/{name}"] = np.arange(count)
    assert "differ in length" in refused(tmp_path / "uneven.h5")


BESIDE: dict[str, Any] = {
    "frames/t of two axes": ("frames/t", np.ones((2, 2), np.int64)),
    "frames/t that are no times": ("frames/t", np.array([1.0, np.nan])),
    "frames/t that go back": ("frames/t", np.array([5, 3, 7])),
    "frames/t beyond all": ("frames/t", np.array([0, 2**63], np.uint64)),
    "several t_offset": ("t_offset", np.array([1, 2])),
    "no t_offset in its place": ("t_offset", np.empty(0, np.int64)),
    "a t_offset that is no whole number": ("t_offset", 1.5),
    "fewer labels": ("events/label", np.zeros(2, np.uint8)),
    "labels of two axes": ("events/label", np.zeros((3, 3), np.uint8)),
    "labels that are no numbers": ("events/label", np.array([b"on", b"off", b"on"])),
}


@pytest.mark.parametrize("what", BESIDE)
def test_what_is_beside_the_events_is_sound_or_refused(tmp_path: Path, what: str) -> None:
    """Whoever reads the events later relies on it."""
    with h5py.File(tmp_path / "other.h5", "w") as file:
        for name in "txyp":
            file[f"events/{name}"] = np.arange(3)
        name, values = BESIDE[what]
        file[name] = values
    refused(tmp_path / "other.h5")


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 0.999])
def test_a_file_cut_short_is_refused(tmp_path: Path, share: float) -> None:
    write(tmp_path / "events.h5", events_at(np.sort(np.random.default_rng(3).integers(0, 10**6, 200_000))))
    whole = (tmp_path / "events.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: int(share * len(whole))])
    refused(tmp_path / "cut.h5")


def test_a_file_with_broken_chunks_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "events.h5", events_at(np.sort(np.random.default_rng(3).integers(0, 10**6, 200_000))))
    with h5py.File(tmp_path / "events.h5") as file:
        chunk = file["events/x"].id.get_chunk_info(1)
    content = bytearray((tmp_path / "events.h5").read_bytes())
    content[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    (tmp_path / "broken.h5").write_bytes(content)
    refused(tmp_path / "broken.h5")


@pytest.mark.parametrize(
    ("was", "now"), [(b"\7\0blosc", b"\0\0blosc"), (b"\x01\x7d\x08\0", b"\x11\x7d\x08\0")], ids=["numbers", "filter"]
)
def test_what_may_not_be_unpacked_is_refused(tmp_path: Path, was: bytes, now: bytes) -> None:
    """Blosc's filter reads numbers that are not there; SZ's (32017) takes lengths from the file: both crashed."""
    write(tmp_path / "events.h5", events_at(np.arange(1000)))
    content = (tmp_path / "events.h5").read_bytes()
    assert was in content
    (tmp_path / "events.h5").write_bytes(content.replace(was, now, 1))
    assert "filter 32" in refused(tmp_path / "events.h5")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_a_full_disk_is_an_error_and_not_a_crash(tmp_path: Path) -> None:
    program = """
import resource, sys
from pathlib import Path
import numpy as np
from vid2ev.formats.event_file import Recording
from vid2ev.formats.hdf5 import write_events
from vid2ev.stream.events import Events
random = np.random.default_rng(0)
n = 1 << 18
t = np.sort(random.integers(0, 10**7, n))
x = random.integers(0, 300, n).astype(np.uint16)
events = Events(t, x, x, (x & 1).astype(np.uint8))
for limit in (0, 1, 100, 2048, 5000, 100_000, 1_000_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        write_events(Path(sys.argv[1]), Recording((300, 300), 0, 10**7, n, lambda: iter([events])))
    except OSError as error:
        print(error.errno)
"""
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path / "full.h5")], capture_output=True, text=True)
    assert (done.returncode, done.stderr, done.stdout.split()) == (0, "", ["27"] * 7)  # EFBIG, as ENOSPC would be


def test_of_a_recording_the_folder_with_events_is_named(tmp_path: Path) -> None:
    for camera in ("cis", "dvs"):
        (tmp_path / camera).mkdir()
        (tmp_path / camera / "manifest.json").write_text("{}")
    (tmp_path / "dvs" / "events.h5").touch()
    with pytest.raises(UsageError, match=r"of the cameras cis, dvs; give one: .*dvs$"):
        open_events(tmp_path)
    (tmp_path / "dvs" / "events.h5").unlink()
    with pytest.raises(UsageError, match=r"frames of cis, dvs and no events; give a recording of an event camera$"):
        open_events(tmp_path)
