"""Bags of ROS 2: events as dvs_msgs/msg/EventArray on /dvs/events, frames as sensor_msgs/msg/Image on /dvs/image_raw.

A bag of ROS 2 is a folder: metadata.yaml, and files of SQLite (.db3) or MCAP (.mcap).  What is read is the folder, its
metadata.yaml, or one of its files alone.  What is written is one file of MCAP, the format of ROS 2 since 2023: it is
whole without a folder, and says itself what its messages are.  As `ros2 bag record` does, it is not compressed;
Zstandard would make it a third of its 16 bytes per event, and writing take three times as long.

rosbags has the containers; `ros_messages.py` has the messages, `ros_events.py` says what is in which message.  The time
of a message is that of its last event.

Source: https://mcap.dev/spec and https://github.com/ros2/rosbag2
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import Format, Picture, Recording
from vid2ev.formats.ros2_bombs import bound_decompression, check_bag
from vid2ev.formats.ros_events import CLOCK_US, EVENTS_TOPIC, IMAGES_TOPIC, RosEvents, outgoing
from vid2ev.formats.ros_messages import event_array_bytes, image_bytes
from vid2ev.formats.rosbag import Topic

SQLITE, MCAP, METADATA = b"SQLite format 3\0", b"\x89MCAP0\r\n", b"rosbag2_bagfile_information:"
EVENT_ARRAY, IMAGE = "dvs_msgs/msg/EventArray", "sensor_msgs/msg/Image"
DEFINITIONS = {
    "dvs_msgs/msg/Event": "uint16 x\nuint16 y\nbuiltin_interfaces/Time ts\nbool polarity\n",
    EVENT_ARRAY: "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n",
}
MISSING = "bags of ROS 2 need rosbags; install it with: pip install 'vid2ev[formats]'"


class Ros2Bag:
    """A bag and its messages.  Whatever is wrong with it is an OSError or a ValueError."""

    cdr = True

    def __init__(self, path: Path):
        self.path = path
        self.warnings: list[str] = []
        with closing(self._opened()) as reader:
            kinds = [(str(connection.topic), str(connection.msgtype)) for connection in reader.connections]
        self.topics = [Topic(name, kind.replace("/msg/", "/")) for name, kind in dict.fromkeys(kinds)]

    def messages(self, names: Collection[str]) -> Iterator[tuple[str, bytes]]:
        """The messages of topics, each with its topic's name, in the order in which they were recorded."""
        with closing(self._opened()) as reader:
            wanted = [connection for connection in reader.connections if connection.topic in names]
            messages = reader.messages(wanted) if wanted else iter(())
            while True:
                try:
                    connection, _, content = next(messages)
                except StopIteration:
                    return
                except DataError:
                    raise
                except Exception as error:  # (what rosbags stumbles over in a damaged file can be anything)
                    raise ValueError("a message cannot be read") from error
                if not isinstance(content, bytes | bytearray | memoryview):  # (SQLite holds what was put there)
                    raise ValueError(f"a message is {type(content).__name__}, not bytes")
                yield connection.topic, bytes(content)

    def _opened(self) -> Any:
        """The reader of the file, open; its name does not count."""
        try:
            from rosbags.rosbag2.reader import DirectoryReader
            from rosbags.rosbag2.storage_mcap import McapReader
        except ImportError as error:
            raise DataError(f"{self.path} cannot be read: {MISSING}") from error
        with open(self.path, "rb") as file:
            head = file.read(len(METADATA))
        try:
            reader: Any
            bound_decompression()
            if head.startswith(METADATA):
                check_bag(self.path)
                reader = DirectoryReader(self.path.parent)
                reader.STORAGE_PLUGINS = {**reader.STORAGE_PLUGINS, "sqlite3": _base}
            else:
                reader = McapReader(self.path) if head.startswith(MCAP) else _base(self.path)
            reader.open()
        except DataError:
            raise
        except Exception as error:
            raise ValueError("no bag that rosbags can read") from error
        return reader


def _base(path: Path) -> Any:
    """The reader of a base of SQLite.  (rosbags makes a URI of its name, in which a # or ? ends it.)"""
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    return Sqlite3Reader(Path(quote(os.fsencode(path))))


def open_events(path: Path) -> RosEvents:
    """The events of a bag.  Raises DataError, also where rosbags is not installed."""
    return RosEvents(path, Ros2Bag)


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it, UsageError for times that ROS does not have,
    and where rosbags is not installed."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise UsageError(f"{path} cannot be written: {MISSING}") from error
    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in DEFINITIONS.items():
        types.register(get_types_from_msg(definition, name))
    # A link or a device is written into, any other file that is there is replaced.
    plain = not path.is_symlink() and (path.is_file() or not path.exists())
    with TemporaryDirectory(dir=path.parent if plain else None) as folder:
        bag = Writer(Path(folder) / path.stem, version=9, storage_plugin=StoragePlugin.MCAP)
        with bag:
            events = bag.add_connection(EVENTS_TOPIC, EVENT_ARRAY, typestore=types)
            images = bag.add_connection(IMAGES_TOPIC, IMAGE, typestore=types) if recording.frames else None
            for part in outgoing(recording):
                if not isinstance(part, Picture):
                    t_us = int(part.events.t[-1]) if len(part.events) else part.stamp_us
                    bag.write(events, t_us * 1000, event_array_bytes(part, 0, cdr=True))
                elif images:
                    bag.write(images, part.t_us * 1000, image_bytes(part, 0, cdr=True))
        made = Path(folder) / path.stem / f"{path.stem}.mcap"
        made.replace(path) if plain else shutil.copyfile(made, path)


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith((MCAP, METADATA)) or (head.startswith(SQLITE) and b"CREATE TABLE messages" in head)


FORMAT = Format(
    "ros2",
    "bag of ROS 2 (MCAP), dvs_msgs",
    ".mcap",
    recognises=_recognises,
    open=open_events,
    write=write_events,
    largest=(1 << 16, 1 << 16),
    clock_us=CLOCK_US,
    keeps=frozenset({"frames", "size", "start"}),
)
