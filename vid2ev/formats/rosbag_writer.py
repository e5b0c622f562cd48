"""The writer of bags of ROS 1; `rosbag.py` has the layout.  What is kept until the end is a few bytes per chunk."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import BinaryIO

from vid2ev.formats.rosbag import BAG, CHUNK, CONNECTION, MAGIC, MESSAGE, Topic

INDEX, CHUNK_INFO = 4, 6
HEADER_SIZE = 4096  # bytes of the bag's own record
CHUNK_SIZE = 768 << 10  # bytes of messages after which a chunk is written, as `rosbag record` does
U32 = struct.Struct("<I")


class BagWriter:
    """A bag that is being written to a file; `finish` makes it whole."""

    def __init__(self, file: BinaryIO, topics: Sequence[Topic]):
        self._file = file
        self._topics = topics
        self._chunk = bytearray()
        self._places: dict[int, list[tuple[bytes, int]]] = {}  # of each connection's messages in the chunk
        self._infos: list[bytes] = []
        self._file.write(MAGIC + self._bag_record(0))

    def write(self, topic: Topic, t_ns: int, message: bytes) -> None:
        """Add a message; times never go back."""
        number, time = self._topics.index(topic), struct.pack("<II", *divmod(t_ns, 10**9))
        if not self._chunk and not self._infos:
            self._chunk += b"".join(map(self._connection, range(len(self._topics))))
        self._places.setdefault(number, []).append((time, len(self._chunk)))
        self._chunk += _record(MESSAGE, {"conn": U32.pack(number), "time": time}, message)
        if len(self._chunk) > CHUNK_SIZE:
            self._write_chunk()

    def finish(self) -> None:
        """Write what is left, the index, and where it is."""
        if self._chunk:
            self._write_chunk()
        index_at = self._file.tell()
        for number in range(len(self._topics)):
            self._file.write(self._connection(number))
        self._file.writelines(self._infos)
        self._file.seek(len(MAGIC))
        self._file.write(self._bag_record(index_at))

    def _write_chunk(self) -> None:
        chunk_at, times = (
            self._file.tell(),
            [struct.unpack("<II", time) for at in self._places.values() for time, _ in at],
        )
        self._file.write(_record(CHUNK, {"compression": b"none", "size": U32.pack(len(self._chunk))}, self._chunk))
        for number, places in self._places.items():
            header = {"ver": U32.pack(1), "conn": U32.pack(number), "count": U32.pack(len(places))}
            self._file.write(_record(INDEX, header, b"".join(time + U32.pack(at) for time, at in places)))
        counts = b"".join(struct.pack("<II", number, len(places)) for number, places in self._places.items())
        header = {
            "ver": U32.pack(1),
            "chunk_pos": struct.pack("<Q", chunk_at),
            "start_time": struct.pack("<II", *min(times)),
            "end_time": struct.pack("<II", *max(times)),
            "count": U32.pack(len(self._places)),
        }
        self._infos.append(_record(CHUNK_INFO, header, counts))
        self._chunk, self._places = bytearray(), {}

    def _connection(self, number: int) -> bytes:
        topic = self._topics[number]
        inner = {"topic": topic.name, "type": topic.type, "md5sum": topic.md5, "message_definition": topic.definition}
        data = _header({name: value.encode() for name, value in inner.items()})
        return _record(CONNECTION, {"conn": U32.pack(number), "topic": topic.name.encode()}, data)

    def _bag_record(self, index_at: int) -> bytes:
        header = {
            "index_pos": struct.pack("<Q", index_at),
            "conn_count": U32.pack(len(self._topics) if index_at else 0),
            "chunk_count": U32.pack(len(self._infos)),
        }
        return _record(BAG, header, b" " * (HEADER_SIZE - len(_record(BAG, header, b""))))


def _header(fields: dict[str, bytes]) -> bytes:
    stored = (name.encode() + b"=" + value for name, value in fields.items())
    return b"".join(U32.pack(len(field)) + field for field in stored)


def _record(op: int, header: dict[str, bytes], data: bytes | bytearray) -> bytes:
    stored = _header({"op": bytes([op]), **header})
    return b"".join([U32.pack(len(stored)), stored, U32.pack(len(data)), data])
