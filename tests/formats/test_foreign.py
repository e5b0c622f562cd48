"""Files of others, in the ways in which they come: made here of their bytes, word by word."""

from __future__ import annotations

from decimal import ROUND_HALF_UP, Decimal
from functools import partial
from pathlib import Path

import foreign
import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from recordings import all_events, assert_same, dense, events_of, recording_of, written
from scipy.io import loadmat, savemat

from vid2ev.errors import DataError
from vid2ev.formats import (
    FORMATS,
    describe_events,
    format_named,
    npy_arrays,
    open_events,
    prophesee,
    read_events,
    recognise,
)
from vid2ev.formats.event_file import EventFile
from vid2ev.formats.sequential import Unwrapped, pieces
from vid2ev.sources import open_source
from vid2ev.stream.events import Events

NMNIST = Path(__file__).parents[2] / ".." / "shared" / "data" / "events" / "nmnist_sample.bin"


def opened(tmp_path: Path, content: bytes, name: str) -> EventFile:
    """The file with that content, which is of the format of that name, whatever it is called."""
    path = tmp_path / "file"
    path.write_bytes(content)
    kind = recognise(path)
    assert kind is not None and kind.name == name
    return open_events(path)


def rows(file: EventFile) -> list[tuple[int, ...]]:
    """t, x, y, p of each event."""
    return [tuple(map(int, row)) for e in file.events() for row in zip(e.t, e.x, e.y, e.p, strict=True)]


def raw(version: str, words: list[int], bits: int, head: str = "% geometry 640x480\n% end\n", cut: int = 0) -> bytes:
    content = f"% Date 2024-01-01 10:00:00\n% evt {version}\n{head}".encode()
    return content + np.array(words, np.dtype(f"u{bits // 8}").newbyteorder("<")).tobytes()[: -cut or None]


def test_evt3_of_a_camera(tmp_path: Path) -> None:
    words = [
        *(0x0005, 0x2003, 0x6011),  # a row and an event before the time is known
        *(0x8002, 0x6010, 0x0007, 0x2809),  # ON at (9, 7), 2 * 4096 + 16 us
        *(0xA101, 0xE014, 0xF123, 0xF456, 0x7007),  # a trigger, a count of events and its continuation
        *(0x3805, 0x4801, 0x4000, 0x5080),  # ON at 5, 5 + 11 and 5 + 24 + 7
        *(0x0FFF & 0x7FF, 0x2001, 0x0007, 0x2FFF),  # a row and a column that there are not
        *(0x8FFF, 0x8000, 0x6001, 0x2002),  # the upper bits start anew
        *(0x8001, 0x8000, 0x2004),  # and go back a little, which is taken for what it is
    ]
    file = opened(tmp_path, raw("3.0", words, 16, cut=1), "evt3")
    turn = 1 << 24
    expected = [(8208, 9, 7, 1), (8208, 5, 7, 1), (8208, 16, 7, 1), (8208, 36, 7, 1), (turn + 1, 2, 7, 0)]
    assert rows(file) == expected
    assert file.size == (640, 480) and file.start_us == 0
    for part in (
        "1 events before the first time",
        "2 events outside of the 640x480",
        "1 external",
        "1 words",
        "1 bytes",
    ):
        assert sum(text.startswith(part) for text in file.warnings) == 1, part
    assert rows(file) == expected and len(file.warnings) == 5  # (again, and nothing is said twice)


def test_vectors_of_evt3_move_the_column_on_by_their_length(tmp_path: Path) -> None:
    words = [0x8002, 0x6000, 0x0007, 0x3805, 0x5001, 0x5001, 0x4001, 0x4001]  # of 8, 8, 12 and 12
    assert [x for _, x, _, _ in rows(opened(tmp_path, raw("3.0", words, 16), "evt3"))] == [5, 13, 21, 33]


def test_evt3_whose_upper_bits_go_back_by_less_than_half_and_whose_rows_are_of_exposures(tmp_path: Path) -> None:
    words = [0x8BB8, 0x6000, 0x0007, 0x2002, 0x85DC, 0x6000, 0x2003, 0x1007, 0x2004]
    file = opened(tmp_path, raw("3.0", words, 16), "evt3")
    assert sorted(rows(file)) == [(1500 << 12, 3, 7, 0), (3000 << 12, 2, 7, 0)]
    assert any(text.startswith("1 events outside of the 640x480") for text in file.warnings)


def test_words_of_evt3_may_come_in_any_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = [0x8002, 0x6FF0, 0x0007, 0x2809, 0x3805, 0x4801, 0x4000, 0x5080, 0x8003, 0x280A, 0x6001, 0x200B, 0x4003]
    whole = rows(opened(tmp_path, raw("3.0", words, 16), "evt3"))
    assert whole[4] == (3 << 12, 10, 7, 1) and len(whole) == 8
    for length in range(1, len(words)):
        monkeypatch.setattr(prophesee, "pieces", partial(pieces, size=2 * length))
        assert rows(open_events(tmp_path / "file")) == whole


def test_evt2_of_a_camera(tmp_path: Path) -> None:
    def event(p: int, low: int, x: int, y: int) -> int:
        return p << 28 | low << 22 | x << 11 | y

    words = [event(1, 3, 4, 5), 0x80000002, event(1, 3, 4, 5), 0xA0000101, 0xE0000000, 0xF0000000]
    words += [event(0, 63, 639, 479), event(0, 0, 640, 0), 0x8FFFFFFF, 0x80000000, event(0, 1, 0, 0)]
    file = opened(tmp_path, raw("2.0", words, 32, "% geometry 640x480\n", cut=0), "evt2")
    assert rows(file) == [(131, 4, 5, 1), (191, 639, 479, 0), ((1 << 34) + 1, 0, 0, 0)]
    assert len(file.warnings) == 4


def test_evt2_whose_upper_bits_go_back_by_less_than_half(tmp_path: Path) -> None:
    words = [0x8BB80000, 1 << 28 | 5 << 11 | 7, 0x85DC0000, 0x8FFFFFFF, 0x80000000, 6 << 11 | 7]
    vectors = [word << 32 | 1 for word in words]
    for content in (raw("2.0", words, 32), raw("2.1", vectors, 64)):
        assert rows(opened(tmp_path, content, "evt2")) == [(0xBB80000 << 6, 5, 7, 1), (1 << 34, 6, 7, 0)]


def test_evt21_before_the_first_time_and_beyond_the_edge(tmp_path: Path) -> None:
    def pixels(x: int, y: int) -> int:
        return 1 << 60 | x << 43 | y << 32 | 0x8000_0001

    words = [pixels(32, 7), 8 << 60, pixels(608, 7), pixels(612, 7), pixels(32, 480)]
    file = opened(tmp_path, raw("2.1", words, 64), "evt2")
    assert rows(file) == [(0, 608, 7, 1), (0, 639, 7, 1), (0, 612, 7, 1)]
    assert [text[:27] for text in file.warnings] == ["2 events before the first t", "3 events outside of the 640"]


@pytest.mark.parametrize(
    ("lines", "legacy"),
    [
        ("format EVT21;height=480;width=640", False),
        ("format EVT21;endianness=legacy;height=480;width=640", True),
        ("endianness legacy\n% format EVT21;height=480;width=640", True),
        ("endianness legacy\n% format EVT21;height=480;width=640;endianness=little", False),
        ("evt 2.1\n% geometry 640x480\n% system_ID 49\n% integrator_name Prophesee", True),  # 0x31, EVK3 of IMX636
        ("evt 2.1\n% geometry 640x480\n% system_ID 64\n% integrator_name Prophesee", False),  # 0x40, EVK3 of GenX320
        ("evt 2.1\n% geometry 640x480\n% system_ID 49\n% integrator_name Somebody", False),
    ],
)
def test_evt21(tmp_path: Path, lines: str, legacy: bool) -> None:
    """The halves of a word as OpenEB takes them (psee_raw_file_header.cpp, `check_header`)."""
    words = [0x8000_0001_0000_0000, 0x1 << 60 | 5 << 54 | 32 << 43 | 7 << 32 | 0x8000_0005]
    words = [word >> 32 | (word & 0xFFFFFFFF) << 32 for word in words] if legacy else words
    file = opened(tmp_path, raw("2.1", words, 64, f"% {lines}\n% end\n"), "evt2")
    assert rows(file) == [(69, 32, 7, 1), (69, 34, 7, 1), (69, 63, 7, 1)]
    assert file.size == (640, 480)


def test_a_header_may_end_where_the_words_look_like_another_line(tmp_path: Path) -> None:
    content = b"% evt 2.0\n% geometry 1280x720\n" + np.array([0x80002025, 0x00000A25], "<u4").tobytes()
    assert rows(opened(tmp_path, content, "evt2")) == [(0x2025 << 6, 1, 0x225, 0)]
    assert describe_events(tmp_path / "file")["stored"]["header"] == {"evt": "2.0", "geometry": "1280x720"}


def test_evt3_sends_time_in_silence_and_vectors_where_they_are_shorter(tmp_path: Path) -> None:
    events = events_of(np.array([0, 20_000_000]), (640, 480))
    path = written(format_named("evt3"), recording_of(events, (640, 480), 0, 21_000_000), tmp_path)
    words = np.frombuffer(path.read_bytes().partition(b"% end\n")[2], "<u2")
    high = words[words >> 12 == 8] & 0xFFF
    np.testing.assert_array_equal(high, np.arange(21_000_000 // 4096 + 1) & 0xFFF)
    recording = dense()
    words = np.frombuffer(
        written(format_named("evt3"), recording, tmp_path).read_bytes().partition(b"% end\n")[2], "<u2"
    )
    kinds = words >> 12
    base = np.flatnonzero(kinds == 3)
    assert len(base) > 1000 and len(words) < recording.count
    for after, kind in enumerate((4, 4, 5), 1):  # the only pattern that Prophesee's decoder takes
        assert np.all(kinds[base + after] == kind)
    assert np.all((words[base] & 0x7FF) + 32 <= recording.size[0])


def test_groups_of_evt3_do_not_reach_over_the_edge(tmp_path: Path) -> None:
    x = np.tile(np.arange(280, 346, dtype=np.uint16), 3)
    t, y, p = np.repeat([0, 5, 9], 66), np.full(len(x), 7, np.uint16), np.ones(len(x), np.uint8)
    path = written(format_named("evt3"), recording_of(Events(t, x, y, p), (346, 260), 0, 100), tmp_path)
    words = np.frombuffer(path.read_bytes().partition(b"% end\n")[2], "<u2")
    base = words[words >> 12 == 3] & 0x7FF
    assert set(base) == {256, 288} and rows(open_events(path)) == list(zip(t, x, y, p, strict=True))


def test_evt2_sends_time_in_silence(tmp_path: Path) -> None:
    events = events_of(np.array([0, 20_000_000]), (640, 480))
    path = written(format_named("evt2"), recording_of(events, (640, 480), 0, 21_000_000), tmp_path)
    words = np.frombuffer(path.read_bytes().partition(b"% end\n")[2], "<u4")
    high = (words[words >> 28 == 8] & 0xFFFFFFF).astype(np.int64) * 64
    assert high[0] == 0 and np.diff(high).max() <= 4096 and high[-1] > 21_000_000 - 64


@pytest.mark.parametrize("name", [name for name in FORMATS if format_named(name).write])
def test_files_grow_in_silence_by_no_more_than_their_format_says(tmp_path: Path, name: str) -> None:
    kind, sizes = format_named(name), list[int]()
    for seconds in (10, 110):
        none = recording_of(events_of(np.array([], np.int64), (640, 480)), (640, 480), 0, seconds * 10**6)
        sizes.append(written(kind, none, tmp_path).stat().st_size)
    assert 0 <= sizes[1] - sizes[0] <= 100 * kind.idle_bytes + 50  # (half a byte a second is rounded off)


def test_times_of_dat_start_anew_and_may_go_back(tmp_path: Path) -> None:
    records = np.array([[5, 1 << 28], [3, 2], [2**32 - 1, 3 << 14], [0, 4]], "<u4")
    content = b"% Data file containing CD events\n% Version 2\n% Width 304\n% Height 240\n\x0c\x08" + records.tobytes()
    file = opened(tmp_path, content + b"abc", "dat")
    assert rows(file) == [(5, 0, 0, 1), (3, 2, 0, 0), (2**32 - 1, 0, 3, 0), (2**32, 4, 0, 0)]
    assert file.warnings == ["3 bytes at the end, where the file is cut within an event, are left out"]


@pytest.mark.parametrize("first_s", [0.0, 0.25])
def test_seconds_are_seconds_though_the_first_ones_are_whole(tmp_path: Path, first_s: float) -> None:
    t_s = np.concatenate([np.full(npy_arrays.PART, first_s), [0.5, 1.0]])
    none = np.zeros(len(t_s), np.uint8)
    np.savez(tmp_path / "seconds.npz", t=t_s, x=none, y=none, p=none)
    t_us = Events.concatenate(read_events(tmp_path / "seconds.npz")).t
    assert t_us[0] == 1e6 * first_s and t_us[-2:].tolist() == [500_000, 1_000_000]


@pytest.mark.parametrize("kind", [1, 2])
def test_event_stream(tmp_path: Path, kind: int) -> None:
    gaps = np.random.default_rng(0).choice([0, 1, 62, 63, 64, 126, 127, 128, 5000], 500)
    events = events_of(np.cumsum(gaps), (304, 240))
    content = foreign.es(events, (304, 240), kind)
    assert_same(Events.concatenate(opened(tmp_path, content, "es").events()), events)
    outside = np.array([304, 0], "<u2").tobytes()
    file = opened(tmp_path, content + b"\x00" + outside + b"\x01\x00", "es")
    assert_same(Events.concatenate(file.events()), events)
    assert len(file.warnings) == 2
    for wrong in (b"Event Stream\x02\x00\x00\x04\x05\x00\x05\x00", b"Event Stream\x01\x00\x00\x01", content[:15]):
        with pytest.raises(DataError, match="expected"):
            opened(tmp_path, wrong, "es")


@pytest.mark.parametrize(
    ("size", "chip"),
    [((240, 180), "eu.seebetter.ini.chips.davis.DAVIS240C"), ((346, 260), "...Davis346blue"), ((346, 260), "")],
)
def test_aedat2_of_a_davis(tmp_path: Path, size: tuple[int, int], chip: str) -> None:
    events = events_of(np.arange(3000) * 7, size)
    address = foreign.davis_address(events, size)
    special = np.concatenate([address, [1 << 31 | 5, 1 << 10 | 2]])
    file = opened(tmp_path, foreign.aedat2(special, np.append(events.t, [30_000, 30_000]), chip), "aedat2")
    assert_same(Events.concatenate(file.events()), events)
    assert file.size == size
    assert len(file.warnings) == (1 if chip else 2)


def test_aedat2_of_a_dvs128_and_beyond_the_end_of_its_clock(tmp_path: Path) -> None:
    events = events_of(2**31 - 1000 + np.arange(2000), (128, 128))
    for chip in ("ch.unizh.ini.jaer.chip.retina.DVS128", ""):
        file = opened(tmp_path, foreign.aedat2(foreign.dvs128_address(events), events.t, chip), "aedat2")
        assert_same(Events.concatenate(file.events()), events)
        assert file.size == (128, 128)
    with pytest.raises(DataError, match="unknown camera"):
        opened(tmp_path, foreign.aedat2(foreign.dvs128_address(events), events.t, "Cochlea"), "aedat2")


def test_aedat2_of_v2e(tmp_path: Path) -> None:
    events = events_of(np.arange(3000) * 7, (640, 480))
    file = opened(tmp_path, foreign.aedat2(foreign.dvs640_address(events), events.t), "aedat2")
    assert_same(Events.concatenate(file.events()), events)
    assert file.size == (640, 480) and len(file.warnings) == 1


SETTINGS, LAST = 9000 * "# one setting of many\r\n" + f"# {'long' * 3000}\r\n", "#End Of ASCII Header\r\n"


@pytest.mark.parametrize(("more", "last"), [(SETTINGS, ""), (SETTINGS, LAST), ("# User name: José\r\n", LAST)])
def test_aedat2_has_as_many_lines_as_a_camera_has_settings_and_in_any_letters(
    tmp_path: Path, more: str, last: str
) -> None:
    events = events_of(np.arange(3000) * 7, (346, 260))
    content = foreign.aedat2(foreign.davis_address(events, (346, 260)), events.t)
    begin = len(foreign.AEDAT2_HEAD)
    lines = f"{more}# AEChip: eu.seebetter.ini.chips.davis.Davis346blue\r\n{last}".encode("latin-1")
    file = opened(tmp_path, content[:begin] + lines + content[begin:], "aedat2")
    assert_same(Events.concatenate(file.events()), events)
    assert file.size == (346, 260) and file.warnings == []
    assert len(file.describe()["header"]) == (foreign.AEDAT2_HEAD.encode("latin-1") + lines).count(b"\n")


@pytest.mark.parametrize("pieces", [1, 7, 400])
def test_a_clock_of_32_bits_is_followed_from_piece_to_piece(pieces: int) -> None:
    t, clock = np.cumsum(np.random.default_rng(0).integers(0, 1 << 31, 400)), Unwrapped()
    read = [clock(part) for part in np.array_split((t & 0xFFFFFFFF).astype(np.uint32), pieces)]
    np.testing.assert_array_equal(np.concatenate(read), t)


def test_events_that_are_late_where_a_clock_wraps_do_not_wrap_it_again() -> None:
    turn, clock = 1 << 32, Unwrapped()
    read = [
        clock(np.array(part, np.uint32)) for part in ([1, turn - 1], [1, turn - 1], [2, 3, turn - 9, 4], [turn - 2])
    ]
    assert np.concatenate(read).tolist() == [
        *(1, turn - 1, turn + 1, turn - 1),  # (silence of 71 minutes before the first turn; late after it)
        *(turn + 2, turn + 3, turn - 9, turn + 4, turn - 2),
    ]


def test_nmnist(tmp_path: Path) -> None:
    events, later = events_of(np.arange(400_000) * 20, (34, 34)), bytes([0, 240, 0, 0, 0])
    content = foreign.nmnist(events)
    assert_same(Events.concatenate(opened(tmp_path, content, "nmnist").events()), events)
    content = content[:2500] + later + content[2500:-2500] + later + content[-2500:]  # 8.192 ms more, each time
    read = Events.concatenate(opened(tmp_path, content, "nmnist").events())
    turns = (np.arange(len(events)) >= 500).astype(int) + (np.arange(len(events)) >= len(events) - 500)
    np.testing.assert_array_equal(read.t, events.t + 8192 * turns)


def test_zeros_are_no_nmnist(tmp_path: Path) -> None:
    (tmp_path / "zeros.bin").write_bytes(bytes(100_000))
    assert recognise(tmp_path / "zeros.bin") is None


@pytest.mark.skipif(not NMNIST.exists(), reason=f"{NMNIST.name} is not there")
def test_nmnist_of_a_camera() -> None:
    found = describe_events(NMNIST)
    assert (found["format"], found["size"], found["events"]) == ("nmnist", [34, 34], NMNIST.stat().st_size // 5)
    assert found["times_going_back"] == 0 and found["warnings"] == [] and 290_000 < found["last_us"] < 330_000


def columns(events: Events) -> dict[str, np.ndarray]:
    return {"t": events.t, "x": events.x, "y": events.y, "p": events.p}


def test_arrays_of_others(tmp_path: Path) -> None:
    events = events_of(np.arange(1, 2000) * 1001, (640, 480))
    table = np.stack(list(columns(events).values()), axis=1)
    structured = np.rec.fromarrays([events.x, events.y, events.p, events.t], names="x,y,polarity,timestamp")
    path = tmp_path / "others.npz"
    np.savez(path, ts=events.t, xs=events.x.astype(float), ys=events.y, ps=events.p.astype(np.int8) * 2 - 1)
    files = {"names": path.read_bytes()}
    by_column = {"events": np.asfortranarray(table)}
    for name, content in {
        "events": {"events": table},
        "by column": by_column,
        "fields": {"data": events.x, "events": structured},
    }.items():
        np.savez_compressed(path, **content)
        files[name] = path.read_bytes()
    arrays = {"npy": table, "structured npy": structured, "floats": table.astype(float), "column npy": table.T.copy().T}
    for name, array in arrays.items():
        np.save(tmp_path / "others.npy", array)
        files[name] = (tmp_path / "others.npy").read_bytes()
    for name, content in files.items():
        file = opened(tmp_path, content, "npz")
        assert_same(Events.concatenate(file.events()), events)
        assert file.warnings == [] and file.size is None, name
    np.savez(path, **columns(events) | {"t": events.t / 1e6})
    file = opened(tmp_path, path.read_bytes(), "npz")
    assert_same(Events.concatenate(file.events()), events)
    assert "seconds" in file.warnings[0]


def test_arrays_that_are_no_events(tmp_path: Path) -> None:
    for array in (np.zeros((9, 8, 8), np.uint8), np.zeros((9, 5)), np.zeros(4), np.array([{}], object)):
        np.save(tmp_path / "stack.npy", array, allow_pickle=True)
        assert recognise(tmp_path / "stack.npy") is None
    np.savez(tmp_path / "uneven.npz", t=np.arange(3), x=np.arange(3), y=np.arange(3), p=np.arange(2))
    with pytest.raises(DataError, match="differ in length"):
        list(read_events(tmp_path / "uneven.npz"))
    np.savez(tmp_path / "wide.npz", t=np.arange(3), x=np.arange(3) - 1, y=np.arange(3), p=np.arange(3))
    with pytest.raises(DataError, match="65535"):
        list(read_events(tmp_path / "wide.npz"))


@pytest.mark.parametrize("kind", ["rows", "columns", "seconds", "v2e"])
def test_a_table_in_another_order_says_which_one_is_read(tmp_path: Path, kind: str) -> None:
    events = events_of(np.arange(1, 200) * 1001, (640, 480))
    t = events.t / 1e6 if kind == "seconds" else events.t
    table = np.stack([events.x, events.y, t, events.p], axis=1)
    path = tmp_path / ("a.h5" if kind == "v2e" else "a.npy")
    if kind == "v2e":
        with h5py.File(path, "w") as file:
            file["events"] = table
    else:
        np.save(path, np.asfortranarray(table) if kind == "columns" else table)
    with pytest.raises(DataError, match="; save it with the columns t, x, y, p, in this order"):
        list(read_events(path))


@pytest.mark.parametrize("order", ["xytp", "xypt", "ytxp"])
def test_a_table_in_another_order_is_known_by_the_column_that_never_goes_back(tmp_path: Path, order: str) -> None:
    """Where all times could be those of rows."""
    events = events_of(np.arange(1, 200) * 101, (640, 480))
    table = np.stack([getattr(events, name) for name in order], axis=1).astype(np.int64)
    np.save(tmp_path / "a.npy", table)
    np.savetxt(tmp_path / "a.txt", table, "%d")
    for name in ("a.npy", "a.txt") if order.endswith("p") else ("a.npy",):
        with pytest.raises(DataError, match=r"never goes back, .*; save it with the columns t, x, y, p, in this order"):
            list(read_events(tmp_path / name))


@pytest.mark.parametrize("kind", ["sideways", "late"])
def test_a_table_in_order_is_read_wherever_its_events_go(tmp_path: Path, kind: str) -> None:
    """Along a row, or with some that come late."""
    events = events_of(np.arange(1, 200) * 101, (640, 480))
    t = events.t.copy()
    t[50::50] -= 300
    table = np.stack([t if kind == "late" else events.t, np.arange(199), events.y, events.p], axis=1)
    np.save(tmp_path / "a.npy", table)
    np.savetxt(tmp_path / "a.txt", table, "%d")
    for name in ("a.npy", "a.txt"):
        assert len(Events.concatenate(read_events(tmp_path / name))) == 199


def test_numpy_and_h5py_read_what_is_written(tmp_path: Path) -> None:
    recording = dense()
    events = all_events(recording)
    with np.load(written(format_named("npz"), recording, tmp_path)) as arrays:
        assert set(arrays) == {"t", "x", "y", "p", "label", "size", "start_us"}
        for name, column in columns(events).items():
            np.testing.assert_array_equal(arrays[name], column)
        assert arrays["size"].tolist() == list(recording.size) and arrays["start_us"] == 0
    with h5py.File(written(format_named("v2e-hdf5"), recording, tmp_path)) as file:
        assert file["events"].dtype == "u4"
        np.testing.assert_array_equal(file["events"], np.stack(list(columns(events).values()), axis=1))


def test_hdf5_of_v2e(tmp_path: Path) -> None:
    table = np.array([[10, 1, 2, 1], [20, 3, 4, 0]], np.uint32)
    with h5py.File(tmp_path / "v2e.h5", "w") as file:
        file.create_dataset("events", data=table, compression="gzip", chunks=True, maxshape=(None, 4))
    file = opened(tmp_path, (tmp_path / "v2e.h5").read_bytes(), "v2e-hdf5")
    assert rows(file) == [tuple(row) for row in table.tolist()]
    assert file.size is None and file.start_us == 0


@pytest.mark.parametrize("table", [
    np.zeros(3, [(name, "i8") for name in "txyp"]), np.zeros((3, 3), np.uint32), np.zeros((3, 4)),
], ids=["fields", "three columns", "fractions"])  # fmt: skip
def test_hdf5_with_a_table_of_another_kind_says_how_it_becomes_one(tmp_path: Path, table: np.ndarray) -> None:
    with h5py.File(tmp_path / "mine.h5", "w") as file:
        file["events"] = table
    with pytest.raises(DataError, match=r"mine\.h5 has events that .*h5py\.File, .*savez\('mine\.npz', t=t, x=x"):
        next(read_events(tmp_path / "mine.h5"))


def test_hdf5_that_says_it_holds_more_than_it_does(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "table.h5", "w") as file:
        file.create_dataset("events", (10**12, 4), np.uint32, chunks=(1000, 4))
    with h5py.File(tmp_path / "columns.h5", "w") as file:
        for name in "txyp":
            file.create_dataset(f"events/{name}", (10**12,), np.uint32, chunks=(1000,))
    for name in ("table.h5", "columns.h5"):
        with pytest.raises(DataError, match="missing"):
            next(read_events(tmp_path / name))


CSV = {
    "other order": b"x,y,p,t\n1,2,1,10\n3,4,0,20\n",
    "other names": b"timestamp, x, y, polarity\r\n10, 1, 2, 1\r\n20, 3, 4, -1\r\n",
    "more columns": b"t,frame,x,y,p\n10,a,1,2,1\n\n20,,3,4,0\n",
    "Metavision": b"%geometry:640,480\n1,2,1,10\n3,4,0,20\n",
    "faery": b"t,x@640,y@480,on\r\n10,1,2,1\r\n20,3,4,0",
}
RPG = {
    "with size": b"640 480\n0.000010 1 2 1\n0.000020 3 4 0\n",
    "nanoseconds": b"# t x y p\n0.000009700 1 2 1\n0.000020499 3 4 -1\n",
    "numpy": b"1.000000000000000000e-05 1.000e+00 2.0e0 1.00e+00\n2.0e-05 3.0 4.0 0.0\n",
    "microseconds": b"10 1 2 1\n20 3 4 0",
}


@pytest.mark.parametrize(("name", "text"), [*(("csv", text) for text in CSV), *(("rpg", text) for text in RPG)])
def test_text_of_others(tmp_path: Path, name: str, text: str) -> None:
    file = opened(tmp_path, (CSV if name == "csv" else RPG)[text], name)
    assert rows(file) == [(10, 1, 2, 1), (20, 3, 4, 0)]
    assert file.size == ((640, 480) if text in ("Metavision", "faery", "with size") else None)
    assert bool(file.warnings) == (text == "microseconds")


@pytest.mark.parametrize("head", [b"t,x,y,p\n-20,1,2,1\n", b"%geometry:640,480\n1,2,1,-20\n"])
def test_text_may_begin_before_the_instant_that_it_counts_from(tmp_path: Path, head: bytes) -> None:
    assert rows(opened(tmp_path, head, "csv")) == [(-20, 1, 2, 1)]


@pytest.mark.parametrize(
    ("before", "line"),
    [
        ("", "{t},{x},{y},{p}\n"),
        ("", "{x},{y},{p},{t}\r\n"),
        ("\ufeff", " {t}, {x}, {y}, {p}"),
        ("", "{t}e0,{x}.0,{y},{p},0\n"),
        ("# timestamp [ns], x, y, polarity\n", "{t},{x},{y},{p}\n"),
    ],
)
def test_numbers_between_commas_without_names_are_told_to_name_them(tmp_path: Path, before: str, line: str) -> None:
    """Nobody knows which column is which; with such a line they are read."""
    path = tmp_path / "events.csv"
    path.write_text(before + line.format(t=10, x=1, y=2, p=1))
    for read in (describe_events, open_events):
        with pytest.raises(DataError, match="has no line that names its columns; put one before the others"):
            read(path)
    path.write_text(line.replace("{t}", "t").replace("{x}", "x").replace("{y}", "y").replace("{p}", "p").strip() + "\n")
    if "e0" not in line:
        path.write_text(path.read_text() + line.format(t=10, x=1, y=2, p=1))
        assert rows(open_events(path)) == [(10, 1, 2, 1)]


def test_text_that_is_wrong_is_refused_with_its_line(tmp_path: Path) -> None:
    for line in (
        b"1,2,3",
        b"1.5,2,3,1",
        b"1,65536,3,1",
        b"1,-1,3,1",
        b"1,2,3,on",
        b"1-2,3,4,1",
        b"9" * 30 + b"e9,2,3,1",
    ):
        with pytest.raises(DataError, match="line 3: "):
            rows(opened(tmp_path, b"t,x,y,p\n0,0,0,1\n" + line + b"\n5,5,5,1\n", "csv"))
    file = opened(tmp_path, b"t,x,y,p\n0,0,0,1\n1,2", "csv")
    assert rows(file) == [(0, 0, 0, 1)] and len(file.warnings) == 1
    with pytest.raises(DataError, match="no event"):
        rows(opened(tmp_path, b"t,x,y,p\n" + b"7" * 200_000, "csv"))


def test_seconds_since_1970_lose_nothing(tmp_path: Path) -> None:
    text = b"1468941032.229165635 128 154 1\n1468941032.229165 0 0 0\n"
    assert [row[0] for row in rows(opened(tmp_path, text, "rpg"))] == [1468941032229166, 1468941032229165]


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    digits=st.integers(0, 10**18) | st.integers(0, 2 * 10**18),
    decimals=st.integers(0, 30),
    negative=st.booleans(),
    exponent=st.none() | st.integers(-12, 12),
)
@example(digits=1_700_000_000_123_456_789, decimals=0, negative=False, exponent=None)  # of a clock that has nanoseconds
@example(digits=1_700_000_000_123_456_789, decimals=6, negative=False, exponent=None)
@example(digits=5 * 10**18, decimals=25, negative=False, exponent=None)
@example(digits=5 * 10**18 - 1, decimals=25, negative=True, exponent=None)
def test_times_of_text_are_the_nearest_microseconds(
    tmp_path: Path, digits: int, decimals: int, negative: bool, exponent: int | None
) -> None:
    """As `decimal` rounds them; a time that is too late for that is refused."""
    padded = str(digits).rjust(decimals + 1, "0")
    seconds = f"{padded[: len(padded) - decimals]}.{padded[len(padded) - decimals :]}"
    seconds = f"{'-' * negative}{seconds}{'' if exponent is None else f'e{exponent}'}"
    expected = int((Decimal(seconds) * 10**6).to_integral_value(ROUND_HALF_UP))
    file = opened(tmp_path, f"{seconds} 1 2 1\n".encode(), "rpg")
    if abs(expected) < 1 << 61:
        assert rows(file) == [(expected, 1, 2, 1)]
    elif abs(expected) >= 1 << 63:
        with pytest.raises(DataError, match="line 1: "):
            rows(file)


@pytest.mark.parametrize("name", ["csv", "rpg"])
def test_times_of_any_length_come_back_from_text(tmp_path: Path, name: str) -> None:
    """Of clocks that have nanoseconds, too, which are taken for microseconds."""
    edges = np.array([1, 10**6, 10**15, 10**17, 2**58, 10**18, 1_700_000_000_123_456_789, 2**62])
    t = np.sort((edges[:, None] + np.arange(-2, 3)).ravel())
    path = written(format_named(name), recording_of(events_of(t, (50, 40)), (50, 40), int(t[0])), tmp_path)
    assert [row[0] for row in rows(open_events(path))] == t.tolist()


@pytest.mark.parametrize("names", ["davis/left/{}", "prophesee/left/{}", "{}", "events/{}s"])  # MVSEC, M3ED, EDS, HQF
def test_hdf5_of_other_names_says_how_its_events_become_some_that_are_read(tmp_path: Path, names: str) -> None:
    path, events = tmp_path / "data.hdf5", events_of(np.arange(0, 3000, 7), (12, 9))
    with h5py.File(path, "w") as file:
        for name, column in columns(events).items():
            file[names.format(name)] = column
    for read in (describe_events, open_events):
        with pytest.raises(DataError, match=r"h5py\.File, .*savez\('data\.npz', t=t, x=x, y=y, p=p\)"):
            read(path)
    with h5py.File(path) as file:
        np.savez(tmp_path / "data.npz", **{name: np.array(file[names.format(name)]) for name in "txyp"})
    assert_same(Events.concatenate(read_events(tmp_path / "data.npz")), events)


@pytest.mark.parametrize("version", ["5.0", "7.3"])
def test_a_file_of_matlab_says_how_its_events_become_some_that_are_read(tmp_path: Path, version: str) -> None:
    path, events = tmp_path / "recorded.mat", events_of(np.arange(0, 3000, 7), (12, 9))
    table = np.stack([events.t, events.x, events.y, events.p], 1).astype(np.int64)
    if version == "5.0":
        savemat(path, {"events": table})
        found = loadmat(path)["events"]
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["events"] = table.T  # (columns first, as MATLAB counts)
        path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + path.read_bytes()[512:])
        with h5py.File(path) as file:
            found = np.array(file["events"]).T
    for read in (describe_events, open_source):
        with pytest.raises(DataError, match=r"MATLAB.*savez\('recorded\.npz', t=t, x=x, y=y, p=p\)") as refused:
            read(path)
        said = str(refused.value)
        assert ("scipy.io.loadmat" in said, "h5py.File" in said) == (version == "5.0", version == "7.3")
        assert ("interpolate" in said) == (version == "5.0")
    t, x, y, p = found.T
    np.savez(tmp_path / "recorded.npz", t=t, x=x, y=y, p=p)
    assert_same(Events.concatenate(read_events(tmp_path / "recorded.npz")), events)
