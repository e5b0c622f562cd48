"""Messages of ROS that hold events or pictures, to and from bytes.

    Header                 (ROS 1: uint32 seq,) stamp, string frame_id
    dvs_msgs/EventArray    Header, uint32 height, uint32 width, Event[]
    dvs_msgs/Event         uint16 x, uint16 y, stamp ts, bool polarity; y = 0 is top
    sensor_msgs/Image      Header, uint32 height, uint32 width, string encoding, uint8 is_bigendian, uint32 step,
                           uint8[]
    EventPacket            Header, uint32 height, uint32 width, uint64 seq, uint64 time_base, string encoding,
                           bool is_bigendian, uint8[]

A stamp is uint32 seconds and uint32 nanoseconds.  ROS 1 puts fields one behind the other; CDR, that of ROS 2, begins
with four bytes about itself and puts each number at a multiple of its size from there.  Strings and arrays have their
length in front, and strings of CDR a 0 behind.

Sources: https://github.com/uzh-rpg/rpg_dvs_ros (dvs_msgs), https://github.com/ros-event-camera/event_camera_msgs,
https://wiki.ros.org/msg, and section 15.3 of the standard of CORBA for CDR.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from vid2ev.formats.event_file import Picture
from vid2ev.stream.events import Events

KINDS = {
    "dvs_msgs/EventArray": "array",
    "prophesee_event_msgs/EventArray": "array",
    "event_camera_msgs/EventPacket": "packet",
    "event_array_msgs/EventArray": "packet",
    "sensor_msgs/Image": "image",
}
FRAME_ID = "dvs"
LITTLE_ENDIAN = b"\0\1\0\0"
# In CDR all events but the first stand 16 bytes apart, and if the first had its numbers where they have them, it would
# begin 2 bytes earlier; only its x and y are not there.
EVENT = {
    False: np.dtype("<u2, <u2, <u4, <u4, u1"),
    True: np.dtype({"names": [f"f{k}" for k in range(5)], "formats": ["<u2", "<u2", "<u4", "<u4", "u1"],
                    "offsets": [0, 2, 6, 10, 14], "itemsize": 15}),
}  # fmt: skip
STRIDE = {False: 13, True: 16}
CHANNELS = {"mono8": (1, 8), "8UC1": (1, 8), "mono16": (1, 16), "16UC1": (1, 16), "rgb8": (3, 8), "bgr8": (3, 8),
            "8UC3": (3, 8), "rgba8": (4, 8), "bgra8": (4, 8)}  # fmt: skip


@dataclass(frozen=True, slots=True)
class EventPacket:
    """Events as a camera's driver packed them."""

    size: tuple[int, int]
    time_base: int  # [ns]; of evt3 it means nothing
    encoding: str
    content: bytes


@dataclass(frozen=True, slots=True)
class EventArray:
    """Events, and the stamp of their message."""

    size: tuple[int, int]
    stamp_us: int
    events: Events


class Fields:
    """The fields of a message, one after the other.  All raise ValueError where the message is too short."""

    def __init__(self, content: bytes, cdr: bool):
        self.content, self.cdr = content, cdr
        self.start = self.at = 4 if cdr else 0
        if cdr and (len(content) < 4 or content[:2] != LITTLE_ENDIAN[:2]):
            raise ValueError("a message that is no plain little-endian CDR")

    def number(self, kind: str) -> int:
        """A number, its kind in the letters of `struct`."""
        form = struct.Struct(f"<{kind}")
        self.at += -(self.at - self.start) % form.size if self.cdr else 0
        return form.unpack(self.take(form.size))[0]

    def take(self, length: int) -> bytes:
        """So many bytes."""
        if self.at + length > len(self.content):
            raise ValueError("a message that is too short")
        self.at += length
        return self.content[self.at - length : self.at]

    def text(self) -> str:
        """A string."""
        return self.take(self.number("I")).rstrip(b"\0").decode("utf-8", "replace")

    def header(self) -> int:
        """The header; gives its stamp [us]."""
        if not self.cdr:
            self.number("I")
        stamp_us = self.number("I") * 1_000_000 + self.number("I") // 1000
        self.text()
        return stamp_us

    def size(self) -> tuple[int, int]:
        """Height and width, as (width, height)."""
        height, width = self.number("I"), self.number("I")
        return width, height


def event_array(content: bytes, cdr: bool) -> EventArray:
    """The message of dvs_msgs/EventArray.  Raises ValueError."""
    fields = Fields(content, cdr)
    stamp_us, size, count = fields.header(), fields.size(), fields.number("I")
    if not count:
        return EventArray(size, stamp_us, Events.empty())
    length = STRIDE[cdr] * count - 3 * cdr
    if length > len(content) - fields.at:
        raise ValueError("a message that is too short")
    stored = np.ndarray(count, EVENT[cdr], content, fields.at - 2 * cdr, STRIDE[cdr])
    x, y = (stored[name].astype(np.uint16) for name in ("f0", "f1"))
    if cdr:
        x[0], y[0] = struct.unpack_from("<HH", content, fields.at)
    t = stored["f2"] * np.int64(1_000_000) + stored["f3"] // 1000
    return EventArray(size, stamp_us, Events(t, x, y, (stored["f4"] != 0).view(np.uint8)))


def event_packet(content: bytes, cdr: bool) -> EventPacket:
    """The message of event_camera_msgs/EventPacket.  Raises ValueError."""
    fields = Fields(content, cdr)
    fields.header()
    size = fields.size()
    fields.number("Q")
    time_base, encoding, big = fields.number("Q"), fields.text(), fields.number("B")
    if big:
        raise ValueError("a big-endian packet")
    return EventPacket(size, time_base, encoding, fields.take(fields.number("I")))


def image(content: bytes, cdr: bool) -> Picture:
    """The message of sensor_msgs/Image, of more than 8 bits cut to 8.  Raises ValueError, KeyError for an encoding that
    is not read."""
    fields = Fields(content, cdr)
    stamp_us = fields.header()
    (width, height), encoding, big, step = fields.size(), fields.text(), fields.number("B"), fields.number("I")
    pixels = fields.take(fields.number("I"))
    channels, bits = CHANNELS[encoding]
    length = width * channels * bits // 8
    if not (length and height) or step < length or step * height != len(pixels):
        raise ValueError(f"an image of {width}x{height} pixels in {encoding}")
    rows = np.frombuffer(pixels, np.uint8).reshape(height, step)[:, :length]
    # The upper byte of each pixel, of those that have two.
    rows = rows if bits == 8 else rows[:, 0 if big else 1 :: 2]
    if channels == 1:
        return Picture(stamp_us, rows)
    planes = rows.reshape(height, width, channels)
    return Picture(stamp_us, planes[..., :3] if encoding.startswith("rgb") else planes[..., 2::-1])


class Message:
    """A message that is being put together."""

    def __init__(self, cdr: bool):
        self.content, self.cdr = bytearray(), cdr

    def number(self, kind: str, value: int) -> None:
        form = struct.Struct(f"<{kind}")
        self.content += bytes(-len(self.content) % form.size if self.cdr else 0) + form.pack(value)

    def text(self, value: str) -> None:
        stored = value.encode() + (b"\0" if self.cdr else b"")
        self.number("I", len(stored))
        self.content += stored

    def header(self, number: int, stamp_us: int) -> None:
        if not self.cdr:
            self.number("I", number)
        self.number("I", stamp_us // 1_000_000)
        self.number("I", stamp_us % 1_000_000 * 1000)
        self.text(FRAME_ID)

    def whole(self, *ends: Any) -> bytes:
        """The message with what stands at its end."""
        return b"".join([LITTLE_ENDIAN if self.cdr else b"", self.content, *ends])


def event_array_bytes(array: EventArray, number: int, cdr: bool) -> bytes:
    """A message of dvs_msgs/EventArray; `number` is its number on the topic."""
    message, events, (width, height) = Message(cdr), array.events, array.size
    message.header(number, array.stamp_us)
    for value in (height, width, len(events)):
        message.number("I", value)
    if not len(events):
        return message.whole()
    content = np.zeros(STRIDE[cdr] * len(events) - cdr, np.uint8)
    stored = np.ndarray(len(events), EVENT[cdr], content, 0, STRIDE[cdr])
    seconds = events.t // 1_000_000
    values = (events.x, events.y, seconds, (events.t - seconds * 1_000_000) * 1000, events.p)
    for name, column in zip(EVENT[cdr].names or (), values, strict=True):
        stored[name] = column
    if not cdr:
        return message.whole(content)
    content[2:6] = content[:4].copy()
    return message.whole(content[2:])


def image_bytes(picture: Picture, number: int, cdr: bool) -> bytes:
    """A message of sensor_msgs/Image, mono8 or rgb8."""
    message, pixels = Message(cdr), np.ascontiguousarray(picture.pixels)
    height, width = pixels.shape[:2]
    message.header(number, picture.t_us)
    message.number("I", height)
    message.number("I", width)
    message.text("mono8" if pixels.ndim == 2 else "rgb8")
    message.number("B", 0)
    message.number("I", pixels.size // max(height, 1))
    message.number("I", pixels.size)
    return message.whole(pixels)
