"""Bags of ROS 1: the container, whatever its messages are.

    #ROSBAG V2.0 LF
    record    uint32 length, header, uint32 length, data; a header is fields of uint32 length, name, "=", value
    op  3     of the bag: index_pos (0: it was never closed), conn_count, chunk_count; padded to 4096 bytes
        5     chunk: compression (none, bz2, lz4), size; its data are records 7 and 2
        7     connection: conn, topic; its data is a header again: type, md5sum, message_definition
        2     message: conn, time; its data is the message
        4, 6  where messages are in the chunk before it, and where chunks are
    At index_pos all connections stand again, and then all records 6.

A bag is read from front to back, one chunk at a time: memory does not grow with its length, and a bag whose recording
was interrupted is read up to there.  (rosbags, which keeps an entry for each message, does neither.)

Source: https://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

import bz2
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from vid2ev.terminal import counted

MAGIC = b"#ROSBAG V2.0\n"
BAG, CHUNK, CONNECTION, MESSAGE = 3, 5, 7, 2
LARGEST = 1 << 28  # bytes of a chunk
FIRST = 64  # chunks in which connections are looked for where there is no index

Header = dict[bytes, bytes]
Record = tuple[int, Header, bytes]  # op, header, data


@dataclass(frozen=True)
class Topic:
    """What messages of which type are published under."""

    name: str
    type: str
    md5: str = ""
    definition: str = ""


class BagReader:
    """A bag and its messages.  Whatever is wrong with it is an OSError or a ValueError."""

    cdr = False

    def __init__(self, path: Path):
        self.path = path
        self.warnings: list[str] = []
        self._index_at = -1
        with open(path, "rb") as file:
            self._index_at = _number(self._start(file), b"index_pos", 8)
            if self._index_at:
                if self._index_at > file.seek(0, 2):
                    raise ValueError("a bag without the index that it should have")
                file.seek(self._index_at)
                found = list(self._records(file))
            else:
                chunks = (record for record in self._records(file) if record[0] == CHUNK)
                found = [inner for _, header, data in islice(chunks, FIRST) for inner in _inside(header, data)]
        connections = [(header, data) for op, header, data in found if op == CONNECTION]
        self._names = {_number(header, b"conn", 4): _topic(header, data).name for header, data in connections}
        self.topics = list(dict.fromkeys(_topic(header, data) for header, data in connections))

    def messages(self, names: Collection[str]) -> Iterator[tuple[str, bytes]]:
        """The messages of topics, each with its topic's name, in the order in which they were recorded."""
        found = dict(self._names)
        with open(self.path, "rb") as file:
            self._start(file)
            for kind, outer, content in self._records(file):
                for op, header, data in _inside(outer, content) if kind == CHUNK else ():
                    number = _number(header, b"conn", 4)
                    if op == CONNECTION:
                        found[number] = _topic(header, data).name
                    elif op == MESSAGE and (name := found.get(number)) in names:
                        yield str(name), data

    def _start(self, file: BinaryIO) -> Header:
        """The record of the bag, after which the file stands."""
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError("no bag of version 2.0")
        op, header, _ = next(self._records(file), (0, {}, b""))
        if op != BAG:
            raise ValueError("a bag without its header")
        return header

    def _records(self, file: BinaryIO) -> Iterator[Record]:
        """The records from here on; the data of those that are no chunks or connections are passed over."""
        at = file.tell()
        left = file.seek(0, 2) - at
        file.seek(at)
        try:
            while left > 0:
                header = _fields(file.read(length := _length(file.read(4), left - 4)))
                left -= 4 + length
                length = _length(file.read(4), left - 4)
                left -= 4 + length
                op = _number(header, b"op", 1)
                data = file.read(length) if op in (CHUNK, CONNECTION) else b""
                file.seek(0 if data else length, 1)
                yield op, header, data
        except EOFError:
            if self._index_at:
                raise ValueError("a record leaves the bag") from None
            text = f"{self.path}: the recording was interrupted; read without {counted(left, 'byte')} at its end"
            self.warnings += [] if text in self.warnings else [text]


def _length(stored: bytes, most: int) -> int:
    """The length that is stored; raises EOFError if so much is not there."""
    length = int.from_bytes(stored, "little")
    if len(stored) < 4 or length > most:
        raise EOFError
    if length > LARGEST:
        raise ValueError("a record is too large")
    return length


def _fields(stored: bytes) -> Header:
    """The fields of a header."""
    found, at = {}, 0
    while at < len(stored):
        length = int.from_bytes(stored[at : at + 4], "little")
        name, is_field, value = stored[at + 4 : at + 4 + length].partition(b"=")
        if not is_field or at + 4 + length > len(stored):
            raise ValueError("a header that has no fields")
        found[name] = value
        at += 4 + length
    return found


def _number(header: Header, name: bytes, length: int) -> int:
    value = header.get(name, b"")
    if len(value) != length:
        raise ValueError(f"a record without its {name.decode()}")
    return int.from_bytes(value, "little")


def _topic(header: Header, data: bytes) -> Topic:
    inner = _fields(data)
    name, kind = header.get(b"topic", b""), inner.get(b"type", b"")
    return Topic(name.decode("utf-8", "replace"), kind.decode("utf-8", "replace"))


def _inside(header: Header, data: bytes) -> Iterator[Record]:
    """The records of a chunk."""
    content = _decompressed(header, data)
    at = 0
    while at < len(content):
        parts = []
        for _ in range(2):
            length = int.from_bytes(content[at : at + 4], "little")
            parts.append(content[at + 4 : at + 4 + length])
            at += 4 + length
        if at > len(content):
            raise ValueError("a record leaves its chunk")
        inner = _fields(parts[0])
        yield _number(inner, b"op", 1), inner, parts[1]


def _decompressed(header: Header, data: bytes) -> bytes:
    compression, size = header.get(b"compression"), _number(header, b"size", 4)
    if size > LARGEST:
        raise ValueError("a chunk is too large")
    if compression == b"bz2":
        data = bz2.BZ2Decompressor().decompress(data, size + 1)
    elif compression == b"lz4":
        import lz4.frame

        try:
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
        except (RuntimeError, EOFError) as error:
            raise ValueError("a chunk cannot be decompressed") from error
    elif compression != b"none":
        raise ValueError(f"compression {compression!r}")
    if len(data) != size:
        raise ValueError("a chunk of another size than it says")
    return data
