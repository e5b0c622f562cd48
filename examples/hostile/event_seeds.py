"""Small event files of every format that is read, written by vid2ev or made of their bytes."""

from __future__ import annotations

import sqlite3
import struct
from pathlib import Path

import numpy as np

from vid2ev.formats import FORMATS, format_named
from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events

SIZE = (34, 34)
COUNT = 120
AEDAT2 = b"#!AER-DAT2.0\r\n# This is a raw AE data file - do not edit\r\n# AEChip: DAVIS240C\r\n"
READABLE = [name for name in FORMATS if format_named(name).open]


def events() -> Events:
    """Events anywhere on a small sensor, some at one instant, some long after each other."""
    random = np.random.default_rng(5)
    t = np.cumsum(random.choice([0, 0, 1, 70, 5000], COUNT))
    x, y = (random.integers(0, side, COUNT).astype(np.uint16) for side in SIZE)
    return Events(t, x, y, *(random.integers(0, most, COUNT).astype(np.uint8) for most in (2, 4)))


def seeds(name: str, folder: Path) -> list[Path]:
    """The files of a format."""
    kind, path = format_named(name), folder / f"events{format_named(name).suffix}"
    if kind.write:
        held = events()
        frame_us = np.arange(0, int(held.t[-1]), 20_000)
        labelled = "labels" in kind.keeps
        kind.write(path, Recording(SIZE, 0, int(held.t[-1]), COUNT, lambda: iter([held]), labelled, None, frame_us))
    else:
        path.write_bytes({"es": _es, "aedat2": _aedat2, "aedat3": _aedat3, "nmnist": _nmnist}[name](events()))
    if name == "ros2":
        return [path, *_bag(path, folder / "bag")]
    return [path]


def _es(held: Events) -> bytes:
    """Event Stream 2, DVS: a byte of time and polarity, column, row from below."""
    content = bytearray(b"Event Stream" + bytes([2, 0, 0, 1]) + np.array(SIZE, "<u2").tobytes())
    now = 0
    for t, x, y, p in zip(held.t.tolist(), held.x.tolist(), held.y.tolist(), held.p.tolist(), strict=True):
        content += b"\xff" * ((t - now) // 127) + bytes([(t - now) % 127 << 1 | p])
        content += np.array([x, SIZE[1] - 1 - y], "<u2").tobytes()
        now = t
    return bytes(content)


def _aedat2(held: Events) -> bytes:
    """An address of a DAVIS and a time, both big-endian."""
    address = (179 - held.y.astype(np.int64)) << 22 | (239 - held.x.astype(np.int64)) << 12 | held.p << 11
    return AEDAT2 + np.stack([address, held.t], axis=1).astype(">u4").tobytes()


def _aedat3(held: Events) -> bytes:
    """Two packets of polarity events around one with a frame."""
    head = b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS346B\r\n#!END-HEADER\r\n"
    words = [held.x.astype(np.uint32) << 17 | held.y.astype(np.uint32) << 2 | held.p.astype(np.uint32) << 1 | 1, held.t]
    stored = np.stack(words, axis=1).astype("<u4").tobytes()
    frame = struct.pack("<I8i", 3, 10, 19, 12, 16, 4, 3, 0, 0) + bytes(24)
    half = len(stored) // 2
    packets = [(1, 8, stored[:half]), (2, len(frame), frame), (1, 8, stored[half:])]
    return head + b"".join(
        struct.pack("<hhiiiiii", kind, 1, size, 4, 0, *[len(content) // size] * 3) + content
        for kind, size, content in packets
    )


def _nmnist(held: Events) -> bytes:
    """40 bits for each event."""
    word = held.x.astype(np.uint64) << 32 | held.y.astype(np.uint64) << 24 | held.p.astype(np.uint64) << 23
    return (word | held.t.astype(np.uint64)).astype(">u8").view(np.uint8).reshape(-1, 8)[:, 3:].tobytes()


def _bag(mcap: Path, folder: Path) -> list[Path]:
    """The same messages in a folder: metadata.yaml and a file of SQLite."""
    from rosbags.rosbag2.storage_mcap import McapReader

    folder.mkdir()
    reader = McapReader(mcap)
    reader.open()
    with sqlite3.connect(folder / "bag.db3") as base:
        base.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL,"
            " data BLOB NOT NULL)"
        )
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,"
            "serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL)"
        )
        found = [(time, bytes(data)) for _, time, data in reader.messages(reader.connections)]
        base.execute("INSERT INTO topics VALUES (1, '/dvs/events', 'dvs_msgs/msg/EventArray', 'cdr', '')")
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)", found)
    reader.close()
    metadata = folder / "metadata.yaml"
    metadata.write_text(METADATA.format(count=len(found)))
    return [metadata, folder / "bag.db3"]


METADATA = """\
rosbag2_bagfile_information:
  version: 5
  storage_identifier: sqlite3
  duration: {{nanoseconds: 300000000}}
  starting_time: {{nanoseconds_since_epoch: 0}}
  message_count: {count}
  topics_with_message_count:
    - topic_metadata:
        name: /dvs/events
        type: dvs_msgs/msg/EventArray
        serialization_format: cdr
        offered_qos_profiles: ''
      message_count: {count}
  compression_format: ''
  compression_mode: ''
  relative_file_paths:
    - bag.db3
  files:
    - path: bag.db3
      starting_time: {{nanoseconds_since_epoch: 0}}
      duration: {{nanoseconds: 300000000}}
      message_count: {count}
"""
