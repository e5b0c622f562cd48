"""AEDAT 3.1: files built here by the letter of the specification are read, with their frames."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from container_recordings import events_at, times_us
from recordings import assert_same

from vid2ev.errors import DataError
from vid2ev.formats import describe_events, format_named, open_events, read_events
from vid2ev.stream.events import Events

TIMES = times_us()
WRITTEN = "2017-03-01 10:11:12 (TZ+0100)"
HEAD = f"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: {{}}\r\n#-Source 0: DVS128\r\n#Start-Time: {WRITTEN}\r\n"


def header(camera: str = "DAVIS346B") -> bytes:
    return HEAD.format(camera).encode() + b"#!END-HEADER\r\n"


def packet(kind: int, size: int, overflows: int, events: Iterable[bytes], source: int = 1) -> bytes:
    content = list(events)
    assert all(len(event) == size for event in content)
    return struct.pack(
        "<hhiiiiii", kind, source, size, 4, overflows, len(content), len(content), len(content)
    ) + b"".join(content)


def polarity(t: int, x: int, y: int, p: int, valid: int = 1) -> bytes:
    return struct.pack("<Ii", x << 17 | y << 2 | p << 1 | valid, t)


def file_of(events: Events, size: int = 700) -> bytes:
    """Packets of at most so many events, none across an overflow of the time."""
    parts = [header()]
    for overflows in np.unique(events.t >> 31):
        inside = events.select(events.t >> 31 == overflows)
        low = zip(
            (inside.t & 0x7FFFFFFF).tolist(), inside.x.tolist(), inside.y.tolist(), inside.p.tolist(), strict=True
        )
        stored = [polarity(*event) for event in low]
        parts += [packet(1, 8, int(overflows), stored[at : at + size]) for at in range(0, len(stored), size)]
    return b"".join(parts)


@pytest.mark.parametrize("name", TIMES)
def test_polarity_events_are_read(tmp_path: Path, name: str) -> None:
    events = events_at(TIMES[name][:20_000])
    (tmp_path / "events").write_bytes(file_of(events))
    found = open_events(tmp_path / "events")
    assert_same(Events.concatenate(found.events()), events)
    assert (found.size, found.start_us, found.has_frames, found.warnings) == ((346, 260), 0, False, [])
    assert found.describe() == {"camera": "DAVIS346B", "written": WRITTEN}


def test_a_packet_known_byte_by_byte(tmp_path: Path) -> None:
    stored = bytes.fromhex(
        "0100 0000 08000000 04000000 01000000 02000000 02000000 02000000"  # polarity, one overflow, two events
        "1300 0600 05000000"  # x 3, y 4, ON, valid; t 5
        "fdff ffff ffffff7f"  # x and y 32767, OFF, valid; the last instant
    )
    (tmp_path / "events").write_bytes(header("Unknown") + stored)
    (events,) = read_events(tmp_path / "events")
    assert events.t.tolist() == [2**31 + 5, 2**32 - 1]
    assert (events.x.tolist(), events.y.tolist(), events.p.tolist()) == ([3, 32767], [4, 32767], [1, 0])
    assert open_events(tmp_path / "events").size is None


def test_other_packets_and_invalid_events_are_passed_over(tmp_path: Path) -> None:
    special, imu = packet(0, 8, 0, [bytes(8)] * 3), packet(3, 36, 0, [bytes(36)])
    kept = packet(1, 8, 0, [polarity(1, 2, 3, 1), polarity(2, 9, 9, 1, valid=0), polarity(4, 5, 6, 0)])
    (tmp_path / "events").write_bytes(header() + special + kept + imu + packet(1, 8, 0, []))
    (events,) = read_events(tmp_path / "events")
    assert (events.t.tolist(), events.x.tolist(), events.p.tolist()) == ([1, 4], [2, 5], [1, 0])


def frame(t: int, pixels: np.ndarray, room: int, valid: int = 1) -> bytes:
    height, width, channels = pixels.shape
    head = struct.pack("<I8i", channels << 1 | valid, t, t + 29, t + 2, t + 6, width, height, 0, 0)
    return (head + pixels.astype("<u2").tobytes()).ljust(36 + 2 * room, b"\0")


def test_frames_are_pictures(tmp_path: Path) -> None:
    gray, colour = (np.random.default_rng(0).integers(0, 1 << 16, (3, 4, channels)) for channels in (1, 3))
    packets = packet(2, 36 + 72, 1, [frame(10, gray, 36), frame(20, gray, 36, valid=0), frame(30, colour, 36)])
    (tmp_path / "events").write_bytes(header() + packets + packet(1, 8, 1, [polarity(5, 1, 2, 1)]))
    found = open_events(tmp_path / "events")
    one, other = found.frames()
    assert found.has_frames and (one.t_us, other.t_us) == (2**31 + 14, 2**31 + 34)
    np.testing.assert_array_equal(one.pixels, gray[..., 0] >> 8)
    np.testing.assert_array_equal(other.pixels, colour >> 8)
    assert describe_events(tmp_path / "events")["events"] == 1


def test_of_two_cameras_the_first_is_read_with_a_warning(tmp_path: Path) -> None:
    lines = header().replace(b"#Source 1:", b"#Source 0: DVS128\r\n#Source 1:").replace(b"#-Source 0: DVS128\r\n", b"")
    packets = [packet(1, 8, 0, [polarity(t, t, 0, 1)], source) for t, source in ((1, 1), (2, 0), (3, 1), (4, 0))]
    (tmp_path / "events").write_bytes(lines + b"".join(packets))
    found = open_events(tmp_path / "events")
    assert Events.concatenate(found.events()).t.tolist() == [2, 4]
    assert found.size == (128, 128) and "2 cameras" in found.warnings[0]


def refused(path: Path) -> str:
    with pytest.raises(DataError) as raised:
        file = open_events(path)
        list(file.events())
        list(file.frames())
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)
    return str(raised.value)


HUGE = struct.pack("<hhiiiiii", 1, 1, 8, 4, 0, 1 << 28, 1 << 28, 1 << 28)


@pytest.mark.parametrize(
    "content",
    [
        HUGE,
        packet(1, 8, 0, [bytes(8)] * 5)[:-1],
        packet(1, 8, 0, [bytes(8)])[:20],
        packet(1, 16, 0, [bytes(16)]),
        packet(1, 8, 0, [struct.pack("<Ii", 1, -1)]),
        packet(-0x8000 | 1, 8, 0, [bytes(8)]),
        packet(2, 20, 0, [b"\x03" + bytes(19)]),
        packet(2, 40, 0, [frame(1, np.zeros((3, 4, 1)), 0)[:40]]),
        packet(2, 36, 0, [frame(1, np.zeros((0, 0, 1)), 0)]),
        struct.pack("<hhiiiiii", 1, 1, 0, 4, 0, 9, 9, 9),
        struct.pack("<hhiiiiii", 1, 1, 8, 4, 0, 9, -9, 9),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "events").write_bytes(header() + packet(1, 8, 0, [polarity(1, 2, 3, 1)]) + content)
    assert "damaged" in refused(tmp_path / "events")


def test_headers_that_do_not_end_and_compressed_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "events").write_bytes(header()[:-10] + b"#" * 100_000)
    assert "damaged" in refused(tmp_path / "events")
    (tmp_path / "packed").write_bytes(header().replace(b"RAW", b"SerializedTS"))
    assert "SerializedTS" in refused(tmp_path / "packed")
    assert format_named("aedat3").write is None
