"""The events of a bag of ROS, of whichever version: what is in which message, and at what time.

Of topics with events the first is read.  Times of `dvs_msgs/EventArray` are absolute.  In an `EventPacket` they are
those of the sensor, as its encoding says:

    evt3         words of EVT3 (`evt3_words.py`); time_base means nothing, times count from the words' first wrap
    libcaer_cmp  words from time_base [ns] on (`libcaer_words.py`)
    libcaer      uint32: [1] p, [2:17] y, [17:32] x; int32 t [us] from time_base [ns]
    mono         uint64: [0:32] t [ns] from time_base, [32:48] x, [48:63] y, [63] p

What is written is an EventArray for each 10 ms with events.  The stamp of the first is the instant from which the
recording counts; that of the others is their first event.  Cameras stamp as they like: a stamp after the first event,
or more than a day before it, is not taken for that instant, but the first event is.

Sources: https://github.com/uzh-rpg/rpg_dvs_ros, https://github.com/ros-event-camera/event_camera_codecs,
https://github.com/ros-event-camera/libcaer_driver
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vid2ev.errors import DataError, UsageError, read_as
from vid2ev.formats.event_file import PACKETS, Picture, Recording, promised, regrouped
from vid2ev.formats.evt_state import Left, State, said_of
from vid2ev.formats.ros_messages import CHANNELS, KINDS, EventArray, EventPacket, event_array, event_packet, image
from vid2ev.formats.rosbag import Topic
from vid2ev.formats.sequential import Sequential
from vid2ev.stream.events import Events

EVENTS_TOPIC, IMAGES_TOPIC = "/dvs/events", "/dvs/image_raw"
WINDOW_US = 10_000  # of a message
DAY_US = 24 * 3600 * 10**6
CLOCK_US = (0, (10**6 << 31) - 1)  # stamps of ROS 2 end in 2038


class Bag(Protocol):
    """A bag, of whichever version."""

    cdr: bool  # how its messages are stored
    topics: list[Topic]
    warnings: list[str]

    def messages(self, names: Collection[str]) -> Iterator[tuple[str, bytes]]:
        """The messages of topics, each with its topic's name, in the order in which they were recorded."""


class RosEvents(Sequential):
    """The events and images of a bag.

    Raises DataError for a file that is not there, has no topic of events, or is damaged.
    """

    def __init__(self, path: Path, open_bag: Callable[[Path], Bag]):
        super().__init__(path)
        with read_as(self.path, "a bag"):
            self._bag = open_bag(path)
            self.warnings = self._bag.warnings
            events = [topic for topic in self._bag.topics if KINDS.get(topic.type) in ("array", "packet")]
            if not events:
                raise DataError(f"{path} has no topic of events; expected one of type dvs_msgs/EventArray or the like")
            if len(events) > 1:
                self.warnings.append(f"{path} has {len(events)} topics of events; only {events[0].name} is read")
            self._topic = events[0]
            self._images = _nearest([t for t in self._bag.topics if KINDS.get(t.type) == "image"], self._topic)
            self.has_frames = self._images is not None
            self._encoding: str | None = None
            self._look()

    def describe(self) -> dict[str, Any]:
        """Topics and encoding."""
        images = self._images.name if self._images else None
        return {"topic": self._topic.name, "type": self._topic.type, "encoding": self._encoding, "images": images}

    def frames(self) -> Iterator[Picture]:
        """The images of the topic next to that of the events."""
        with read_as(self.path, "a bag"):
            for topic, content in self._bag.messages([self._images.name] if self._images else []):
                try:
                    picture = image(content, self._bag.cdr)
                except KeyError as error:
                    raise DataError(
                        f"{self.path} holds images of {topic} in the encoding {error}, expected {', '.join(CHANNELS)};"
                        " leave them out: render with --no-frames, reformat to a format without frames, such as hdf5"
                    ) from error
                yield picture

    def _look(self) -> None:
        """Size, start and encoding, from the first messages."""
        stamp_us = None
        for message in self._messages():
            self.size = self.size or (message.size if min(message.size) > 0 else None)
            if isinstance(message, EventPacket):
                self._encoding = message.encoding
                break
            stamp_us = message.stamp_us if stamp_us is None else stamp_us
            if len(message.events):
                break
        if self._encoding == "evt3":
            return
        first = next((int(events.t[0]) for events in self._unpacked() if len(events)), stamp_us or 0)
        near = stamp_us is not None and first - DAY_US <= stamp_us <= first
        self.start_us, self.says_start = stamp_us if near and stamp_us is not None else first, near

    def _messages(self) -> Iterator[EventArray | EventPacket]:
        decode = event_array if KINDS[self._topic.type] == "array" else event_packet
        for _, content in self._bag.messages([self._topic.name]):
            yield decode(content, self._bag.cdr)

    def _decoded(self) -> Iterator[Events]:
        return self._all_inside(regrouped(self._unpacked(), PACKETS))

    def _unpacked(self) -> Iterator[Events]:
        with read_as(self.path, "a bag"):
            words = _Words(self.size or (1 << 11, 1 << 11))
            for message in self._messages():
                if isinstance(message, EventArray):
                    yield message.events
                elif message.encoding in ("evt3", "libcaer_cmp"):
                    yield words.events(message)
                else:
                    yield _unpacked(message, self.path)
            for count, what in said_of(words.left, self._outside):
                self._leave_out(count, what)


def _nearest(images: list[Topic], events: Topic) -> Topic | None:
    """The topic whose name begins like that of the events; of several that of pictures, and not of depth, as
    simulators have it."""
    beside = [topic for topic in images if topic.name.split("/")[:-1] == events.name.split("/")[:-1]]

    def is_other(topic: Topic) -> tuple[bool, bool]:
        name = topic.name.rpartition("/")[2]
        return "depth" in name, "image" not in name

    return min(beside or images, key=is_other, default=None)


class _Words:
    """Words, decoded from packet to packet: what they mean depends on those before."""

    def __init__(self, size: tuple[int, int]):
        self.size = size
        self.state = np.full(len(State), -1, np.int64)
        self.left = np.zeros(len(Left), np.int64)
        self.place = np.zeros(3, np.int64)

    def events(self, packet: EventPacket) -> Events:
        from vid2ev.formats import evt3_words, libcaer_words

        words = np.frombuffer(packet.content, "<u2", len(packet.content) // 2)
        room = 12 * len(words) + 12
        t, x, y = np.empty(room, np.int64), np.empty(room, np.uint16), np.empty(room, np.uint16)
        p = np.empty(room, np.uint8)
        if packet.encoding == "evt3":
            _, found = evt3_words.decode(self.state, self.left, 0, words, *self.size, t, x, y, p)
        else:
            found = libcaer_words.decode(words, _base_us(packet), self.place, t, x, y, p)
        return Events(t[:found].copy(), x[:found].copy(), y[:found].copy(), p[:found].copy())


def _base_us(packet: EventPacket) -> int:
    if packet.time_base >> 63:
        raise ValueError("a time beyond 2262")
    return packet.time_base // 1000


def _unpacked(packet: EventPacket, path: Path) -> Events:
    """The events of a packet of 8 bytes each."""
    words = np.frombuffer(packet.content, "<u8", len(packet.content) // 8)
    low, high = words & 0xFFFFFFFF, words >> 32
    base_us = _base_us(packet)
    if packet.encoding == "mono":
        t = base_us + (packet.time_base % 1000 + low.astype(np.int64)) // 1000
        return _columns(t, high & 0xFFFF, high >> 16 & 0x7FFF, high >> 31)
    if packet.encoding == "libcaer":
        after = high.astype(np.int64)
        # The time of libcaer has 31 bits: where it goes back by half of that, it has begun anew.
        after[1:] += np.cumsum(np.diff(after) < -(1 << 30)) << 31
        return _columns(base_us + after, low >> 17, low >> 2 & 0x7FFF, low >> 1 & 1)
    raise DataError(
        f"{path} holds events in the encoding '{packet.encoding}'; expected evt3, libcaer_cmp, libcaer or mono, so"
        " convert it with event_camera_tools first"
    )


def _columns(t: np.ndarray, x: np.ndarray, y: np.ndarray, p: np.ndarray) -> Events:
    return Events(t, x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))


def outgoing(recording: Recording) -> Iterator[EventArray | Picture]:
    """What a bag of a recording holds, in order of time.  Raises UsageError for what no message can hold."""
    _check_times(recording.start_us, recording.start_us + recording.duration_us)
    pictures = _pictures(recording)
    picture = next(pictures, None)
    stamp_us: int | None = recording.start_us
    for events in _windows(recording):
        while picture is not None and picture.t_us <= events.t[-1]:
            yield picture
            picture = next(pictures, None)
        yield EventArray(recording.size, int(events.t[0]) if stamp_us is None else stamp_us, events)
        stamp_us = None
    if stamp_us is not None:
        yield EventArray(recording.size, stamp_us, Events.empty())
    while picture is not None:
        yield picture
        picture = next(pictures, None)


def _check_times(first_us: int, last_us: int) -> None:
    if first_us < CLOCK_US[0] or last_us > CLOCK_US[1]:
        raise UsageError(f"times from {first_us} to {last_us} us: ROS has 0 to 2^31 s; choose --format hdf5")


def _pictures(recording: Recording) -> Iterator[Picture]:
    for picture in recording.frames() if recording.frames else ():
        _check_times(picture.t_us, picture.t_us)
        yield picture


def _windows(recording: Recording) -> Iterator[Events]:
    """The events of each 10 ms that have any."""
    for t, events in promised(recording):
        window = t // WINDOW_US
        cuts = [0, *(np.flatnonzero(np.diff(window)) + 1).tolist(), len(events)]
        for first, last in pairwise(cuts):
            yield events.stretch(first, last)
