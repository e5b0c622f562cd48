"""Bags of ROS 1 and 2: rosbags reads what is written, message by message; what cameras recorded is read."""

from __future__ import annotations

import bz2
import os
import sqlite3
import struct
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
from container_recordings import (
    EVENT_FILES,
    HOUR_US,
    SIZE,
    START_US,
    assert_same_pictures,
    events_at,
    pictures_at,
    recording_of,
    times_us,
)
from recordings import assert_same
from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from vid2ev.errors import DataError, UsageError
from vid2ev.formats import describe_events, format_named, open_events, read_events
from vid2ev.formats.event_file import Picture
from vid2ev.formats.ros1 import EVENTS, IMAGES
from vid2ev.formats.ros2 import DEFINITIONS
from vid2ev.formats.ros_messages import EventArray, Message, event_array_bytes, image, image_bytes
from vid2ev.stream.events import Events

TIMES = times_us()
KINDS = ("ros1", "ros2")
ARRAY = "dvs_msgs/msg/EventArray"
BLUE_FIRST = ("bgr8", "bgra8", "8UC3")
PACKET = """std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
"""
METADATA = """rosbag2_bagfile_information:
  version: 4
  storage_identifier: sqlite3
  relative_file_paths: [bag.db3]
  duration: {nanoseconds: 0}
  starting_time: {nanoseconds_since_epoch: 5}
  message_count: 1
  topics_with_message_count:
  - message_count: 1
    topic_metadata: {name: /dvs/events, type: dvs_msgs/msg/EventArray, serialization_format: cdr,
                     offered_qos_profiles: ''}
"""


def types_of(kind: str) -> Any:
    types = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    for name, definition in DEFINITIONS.items():
        text = definition.replace("builtin_interfaces/Time", "time") if kind == "ros1" else definition
        types.register(get_types_from_msg(text, name))
    types.register(get_types_from_msg(PACKET, "event_camera_msgs/msg/EventPacket"))
    return types


def written(folder: Path, kind: str, *args: Any) -> Path:
    path = folder / f"events{format_named(kind).suffix}"
    write = format_named(kind).write
    assert write
    write(path, recording_of(*args))
    return path


def read_by_rosbags(path: Path) -> tuple[Events, list[Picture], list[int]]:
    """Events and pictures field by field, and the times of the messages."""
    columns: list[list[int]] = [[], [], [], []]
    pictures, times = [], []
    with AnyReader([path]) as bag:
        for connection, time, content in bag.messages():
            message: Any = bag.deserialize(content, connection.msgtype)
            times.append(time)
            if connection.topic == "/dvs/image_raw":
                channels = {"mono8": (), "rgb8": (3,)}[message.encoding]
                pixels = message.data.reshape(message.height, message.width, *channels)
                assert message.step * message.height == message.data.size
                pictures.append(
                    Picture(message.header.stamp.sec * 10**6 + message.header.stamp.nanosec // 1000, pixels)
                )
                continue
            assert (message.width, message.height) == SIZE
            for event in message.events:
                t = event.ts.sec * 10**6 + event.ts.nanosec // 1000
                for column, value in zip(columns, (t, event.x, event.y, event.polarity), strict=True):
                    column.append(value)
    t, x, y, p = (np.array(column, kind) for column, kind in zip(columns, ("i8", "u2", "u2", "u1"), strict=True))
    return Events(t, x, y, p), pictures, times


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", TIMES)
def test_rosbags_reads_what_is_written_and_so_do_we(tmp_path: Path, kind: str, name: str) -> None:
    events = events_at(TIMES[name][::8] + START_US)
    pictures = pictures_at(START_US + 9_973 * np.arange(12), 3, 4, 3)
    path = written(tmp_path, kind, events, START_US - 5, pictures)
    found = open_events(path)
    assert_same(Events.concatenate(found.events()), events)
    assert_same_pictures(list(found.frames()), pictures)
    assert (found.size, found.start_us, found.has_frames, found.warnings) == (SIZE, START_US - 5, True, [])
    theirs, their_pictures, times = read_by_rosbags(path)
    assert_same(theirs, events)
    assert_same_pictures(their_pictures, pictures)
    assert times == sorted(times)


@pytest.mark.parametrize("kind", KINDS)
def test_gray_frames_and_blocks_and_windows(tmp_path: Path, kind: str) -> None:
    events, pictures = events_at(TIMES["dense"] + START_US), pictures_at(START_US + 9_973 * np.arange(3), 31, 17)
    path = written(tmp_path, kind, events, START_US, pictures)
    assert_same_pictures(list(open_events(path).frames()), pictures)
    parts = list(read_events(path, START_US + 12_345, START_US + 54_321, block=1000))
    assert max(map(len, parts)) <= 1000
    inside = (events.t >= START_US + 12_345) & (events.t < START_US + 54_321)
    assert_same(Events.concatenate(parts), events.select(inside))


@pytest.mark.parametrize("kind", KINDS)
def test_messages_last_ten_milliseconds(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, kind, events_at(TIMES["dense"] + START_US), START_US)
    with AnyReader([path]) as bag:
        assert sum(1 for _ in bag.messages()) == 10
        (topic,) = bag.topics
        assert topic == "/dvs/events"


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_events_give_the_same_bytes(tmp_path: Path, kind: str) -> None:
    contents = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        contents.append(written(tmp_path / name, kind, events_at(TIMES["dense"] + START_US)).read_bytes())
    assert contents[0] == contents[1]
    assert [path.name for path in (tmp_path / "one").iterdir()] == [f"events{format_named(kind).suffix}"]


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_there_is_replaced_and_a_link_is_written_through(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"events{format_named(kind).suffix}"
    path.write_bytes(b"before")
    events = events_at(TIMES["sparse"] + START_US)
    assert_same(Events.concatenate(read_events(written(tmp_path, kind, events))), events)
    path.rename(tmp_path / "target")
    path.symlink_to(tmp_path / "target")
    written(tmp_path, kind, events_at(TIMES["one"] + START_US))
    assert path.is_symlink() and len(Events.concatenate(read_events(tmp_path / "target"))) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_recording_that_starts_at_zero_or_long_before_its_events(tmp_path: Path, kind: str) -> None:
    for first_us in (0, 1, 3 * HOUR_US):
        path = written(tmp_path, kind, events_at(np.array([first_us, first_us + 10])), 0)
        assert open_events(path).start_us == 0
        assert Events.concatenate(read_events(path)).t.tolist() == [first_us, first_us + 10]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("start_us", [-10, 10**6 << 31])
def test_times_that_ros_does_not_have_are_refused(tmp_path: Path, kind: str, start_us: int) -> None:
    with pytest.raises(UsageError, match="hdf5"):
        written(tmp_path, kind, events_at(np.array([start_us])), start_us)
    with pytest.raises(UsageError, match="hdf5"):
        written(tmp_path, kind, events_at(np.array([5])), 5, pictures_at(np.array([start_us]), 3, 4))


def test_definitions_are_those_of_ros() -> None:
    for topic, name in ((EVENTS, "dvs_msgs/msg/EventArray"), (IMAGES, "sensor_msgs/msg/Image")):
        definition, md5 = types_of("ros1").generate_msgdef(name)
        assert topic.md5 == md5
        assert topic.definition.split() == definition.split()


@pytest.mark.parametrize("name", ["evt3_vga_legs.bag", "evt3_vga_legs_ros2", "evt3_vga_legs_ros2/test_events_1.db3"])
def test_what_a_camera_recorded_is_read(name: str) -> None:
    if not (EVENT_FILES / name).exists():
        pytest.skip(f"needs {name} of the shared data")
    found = describe_events(EVENT_FILES / name)
    assert (found["size"], found["events"], found["times_going_back"]) == ([640, 480], 343_474, 0)
    assert (found["on"], found["last_us"] - found["first_us"]) == (125_183, 2_078_178)
    assert found["stored"]["encoding"] == "evt3"
    one, other = (Events.concatenate(read_events(EVENT_FILES / path)) for path in ("evt3_vga_legs.bag", name))
    assert_same(one, other)


@pytest.mark.parametrize(
    ("name", "rest_ns", "sums"),
    [
        ("test_data_evt3_trigger_0.db3", 0, (1_222_326_831_810_000, 42_078_718, 31_656_267, 41_439)),
        ("test_data_mono_cd_0.db3", 0, (4_950_000, 34_450, 26_450, 50)),
        ("libcaer_rollover_0.db3", 18, (15_762_826_572_202_229_126, 111_651_612, 82_801_007, 181_908)),
    ],
)
def test_sums_are_those_of_event_camera_codecs(name: str, rest_ns: int, sums: tuple[int, ...]) -> None:
    """Its own recordings, and what its tests say of them; times are nanoseconds there, modulo 2^64."""
    if not (EVENT_FILES / name).exists():
        pytest.skip(f"needs {name} of the shared data")
    events = Events.concatenate(read_events(EVENT_FILES / name))
    t_ns = sum(events.t.tolist()) * 1000 + rest_ns * len(events)
    assert (t_ns % 2**64, *(int(getattr(events, key).sum()) for key in "xyp")) == sums


def packet_bag(folder: Path, kind: str, encoding: str, packets: list[tuple[int, bytes]], topics: int = 1) -> Path:
    """A bag of event_camera_msgs by rosbags: (time base, content) of each packet."""
    types, name = types_of(kind), "event_camera_msgs/msg/EventPacket"
    time, header, packet = (types.types[key] for key in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", name))
    path = folder / ("camera.bag" if kind == "ros1" else "camera")
    bag: Any = rosbag1.Writer(path) if kind == "ros1" else rosbag2.Writer(path, version=9)
    with bag:
        connections = [bag.add_connection(f"/cam{k}/events", name, typestore=types) for k in range(topics)]
        for connection in connections:
            for number, (base, content) in enumerate(packets):
                head = {"seq": number} if kind == "ros1" else {}
                stamp = header(**head, stamp=time(sec=5, nanosec=6), frame_id="camera")
                data = np.frombuffer(content, np.uint8)
                message = packet(stamp, 480, 640, number, base, encoding, False, data)
                serialise: Callable = types.serialize_ros1 if kind == "ros1" else types.serialize_cdr
                bag.write(connection, 10**9 + number, bytes(serialise(message, name)))
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_packets_of_other_encodings_are_read(tmp_path: Path, kind: str) -> None:
    mono = [struct.pack("<Q", p << 63 | y << 48 | x << 32 | t) for t, x, y, p in ((0, 1, 2, 1), (3999, 639, 479, 0))]
    path = packet_bag(tmp_path, kind, "mono", [(10**9, b"".join(mono)), (2 * 10**9, mono[1])])
    found = open_events(path)
    events = Events.concatenate(found.events())
    assert (events.t.tolist(), events.x.tolist()) == ([1_000_000, 1_000_003, 2_000_003], [1, 639, 639])
    assert (events.y.tolist(), events.p.tolist(), found.size) == ([2, 479, 479], [1, 0, 0], (640, 480))
    assert (found.start_us, found.describe()["encoding"]) == (1_000_000, "mono")


@pytest.mark.parametrize("kind", KINDS)
def test_the_time_of_libcaer_begins_anew_within_a_packet(tmp_path: Path, kind: str) -> None:
    stored = [struct.pack("<Ii", 7 << 17 | 5 << 2 | p << 1 | 1, t) for t, p in ((2**31 - 1, 1), (0, 0), (9, 1))]
    path = packet_bag(tmp_path, kind, "libcaer", [(10**9, b"".join(stored))])
    (events,) = read_events(path)
    assert (events.t - 10**6).tolist() == [2**31 - 1, 2**31, 2**31 + 9]
    assert (events.x.tolist(), events.y.tolist(), events.p.tolist()) == ([7] * 3, [5] * 3, [1, 0, 1])


@pytest.mark.parametrize("kind", KINDS)
def test_packets_count_from_the_same_instant_in_any_encoding(tmp_path: Path, kind: str) -> None:
    base_ns = 1_744_227_144_732_712_000  # as drivers have it: the clock's time of the packet's first event
    stored = {
        "libcaer_cmp": np.array([0x0001, 0x1002, 0x2003, 0x3804], "<u2").tobytes(),
        "libcaer": struct.pack("<Ii", 3 << 17 | 4 << 2 | 1 << 1 | 1, 4098),
        "mono": struct.pack("<Q", 1 << 63 | 4 << 48 | 3 << 32 | 4_098_000),
    }
    for encoding, content in stored.items():
        (tmp_path / encoding).mkdir()
        (events,) = read_events(packet_bag(tmp_path / encoding, kind, encoding, [(base_ns, content)]))
        found = [column.tolist() for column in (events.t, events.x, events.y, events.p)]
        assert found == [[base_ns // 1000 + 4098], [3], [4], [1]]


@pytest.mark.parametrize("kind", KINDS)
def test_a_packet_beyond_what_nanoseconds_hold_is_refused(tmp_path: Path, kind: str) -> None:
    for encoding in ("libcaer_cmp", "libcaer", "mono"):
        (tmp_path / encoding).mkdir()
        path = packet_bag(tmp_path / encoding, kind, encoding, [(1 << 63, bytes(8))])
        with pytest.raises(DataError, match="cannot be read as a bag"):
            list(read_events(path))


@pytest.mark.parametrize("kind", KINDS)
def test_words_of_libcaer_begin_anew_in_time_but_not_in_place(tmp_path: Path, kind: str) -> None:
    first = np.array([0x0001, 0x1002, 0x2003, 0x3804, 0x1005, 0x480A, 0x5081, 0x5001, 0x6FFF], "<u2")
    second = np.array([0x1001, 0x3005, 0x5080], "<u2")
    path = packet_bag(tmp_path, kind, "libcaer_cmp", [(10**9, first.tobytes()), (2 * 10**9, second.tobytes())])
    events = Events.concatenate(read_events(path))
    assert events.t.tolist() == [1_004_098, 1_004_101, 1_004_101, 1_004_101, 2_000_001, 2_000_001]
    assert (events.x.tolist(), events.y.tolist()) == ([3] * 6, [4, 10, 17, 18, 5, 33])
    assert events.p.tolist() == [1, 1, 1, 1, 0, 1]


@pytest.mark.parametrize("kind", KINDS)
def test_words_of_evt3_go_on_in_the_next_packet(tmp_path: Path, kind: str) -> None:
    words = np.array([0x8001, 0x6002, 0x0003, 0x2804, 0x8FFF, 0x6000, 0x2005, 0x8000, 0x6007, 0x3806, 0x4005], "<u2")
    whole, cut = (packet_bag(tmp_path / str(at), kind, "evt3", [(0, words[:at].tobytes()), (0, words[at:].tobytes())])
                  for at in (len(words), 3) if (tmp_path / str(at)).mkdir() is None)  # fmt: skip
    events = Events.concatenate(read_events(whole))
    assert events.t.tolist() == [4098, 4095 << 12, (1 << 24) + 7, (1 << 24) + 7]
    assert (events.x.tolist(), events.y.tolist(), events.p.tolist()) == ([4, 5, 6, 8], [3] * 4, [1, 0, 1, 1])
    assert_same(Events.concatenate(read_events(cut)), events)


@pytest.mark.parametrize("kind", KINDS)
def test_what_words_of_evt3_hold_beside_events_is_said(tmp_path: Path, kind: str) -> None:
    words = np.array([0x0003, 0x2004, 0x8001, 0x6002, 0x2004, 0x2AFF, 0xA001, 0xE000, 0xF000], "<u2")
    found = open_events(packet_bag(tmp_path, kind, "evt3", [(0, words[:2].tobytes()), (0, words[2:].tobytes())]))
    for _ in range(2):  # (but once, however often it is read)
        assert [len(events) for events in found.events()] == [1]
        assert found.warnings == [
            "1 events before the first time word are left out",
            "1 events outside of the 640x480 sensor are left out",
            "1 external triggers are left out",
            "1 words of other kinds are left out",
        ]


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_that_is_stamped_after_its_first_event_begins_with_that(tmp_path: Path, kind: str) -> None:
    types = types_of(kind)
    time, header, event, array = (
        types.types[name]
        for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "dvs_msgs/msg/Event", ARRAY)
    )
    stamp = header(**({"seq": 0} if kind == "ros1" else {}), stamp=time(5, 0), frame_id="")
    message = array(stamp, 10, 10, [event(1, 2, time(4, 7000), True)])
    path = tmp_path / ("late.bag" if kind == "ros1" else "late")
    bag: Any = rosbag1.Writer(path) if kind == "ros1" else rosbag2.Writer(path, version=9)
    with bag:
        connection = bag.add_connection("/dvs/events", ARRAY, typestore=types)
        content = (types.serialize_ros1 if kind == "ros1" else types.serialize_cdr)(message, ARRAY)
        bag.write(connection, 10**9, bytes(content))
    assert open_events(path).start_us == 4_000_007


def image_message(cdr: bool, encoding: str, pixels: bytes, width: int, big: int = 0) -> Picture:
    """A picture of one row, which ends with what is in `pixels` beyond it."""
    message = Message(cdr)
    message.header(0, 5_000_006)
    for number in (1, width):
        message.number("I", number)
    message.text(encoding)
    message.number("B", big)
    for _ in range(2):
        message.number("I", len(pixels))
    return image(message.whole(pixels), cdr)


@pytest.mark.parametrize("cdr", [False, True])
def test_images_of_other_encodings_are_read(cdr: bool) -> None:
    for big, order in enumerate("<>"):
        pixels = np.array([0x1234, 0xABCD]).astype(f"{order}u2").tobytes() + b"pad!"
        assert image_message(cdr, "mono16", pixels, 2, big).pixels.tolist() == [[0x12, 0xAB]]
    for encoding, seen in (("rgb8", [1, 2, 3]), ("rgba8", [1, 2, 3]), *((name, [3, 2, 1]) for name in BLUE_FIRST)):
        pixels = bytes([1, 2, 3, 4][: 4 if "a" in encoding else 3])
        assert image_message(cdr, encoding, pixels, 1).pixels.tolist() == [[seen]]


def simulators_bag(folder: Path, kind: str, topics: dict[str, bytes]) -> Path:
    """A bag with an event and, before it, an image of 1x1 pixels in some encodings, each of five letters."""
    types, path = types_of(kind), folder / ("camera.bag" if kind == "ros1" else "camera")
    bag: Any = rosbag1.Writer(path) if kind == "ros1" else rosbag2.Writer(path, version=9)
    with bag:
        for number, (topic, encoding) in enumerate(topics.items()):
            content = image_bytes(Picture(5_000_000, np.full((1, 1), number, np.uint8)), 0, kind == "ros2")
            connection = bag.add_connection(topic, "sensor_msgs/msg/Image", typestore=types)
            bag.write(connection, 10**9 + number, content.replace(b"mono8", encoding))
        content = event_array_bytes(EventArray((8, 8), 5_000_000, events_at([5_000_000])), 0, kind == "ros2")
        bag.write(bag.add_connection("/cam0/events", ARRAY, typestore=types), 2 * 10**9, content)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_of_images_beside_events_those_that_are_pictures_are_read(tmp_path: Path, kind: str) -> None:
    """ESIM writes /cam0/image_raw and /cam0/depthmap; MVSEC has depth_image_raw."""
    topics = {"/cam1/image_raw": b"mono8", "/cam0/depthmap": b"32FC1", "/cam0/depth_image_raw": b"32FC1"}
    found = open_events(simulators_bag(tmp_path, kind, topics | {"/cam0/image_raw": b"mono8"}))
    assert found.describe()["images"] == "/cam0/image_raw"
    assert [picture.pixels.tolist() for picture in found.frames()] == [[[3]]]


@pytest.mark.parametrize("kind", KINDS)
def test_images_in_an_encoding_that_is_not_read_are_not_said_to_be_damaged(tmp_path: Path, kind: str) -> None:
    said = refused(simulators_bag(tmp_path, kind, {"/cam0/depthmap": b"32FC1"}))
    assert "images of /cam0/depthmap in the encoding '32FC1', expected mono8, " in said and "--no-frames" in said


@pytest.mark.parametrize("kind", KINDS)
def test_of_two_topics_the_first_is_read_with_a_warning(tmp_path: Path, kind: str) -> None:
    found = open_events(packet_bag(tmp_path, kind, "mono", [(0, bytes(8))], topics=2))
    assert sum(map(len, found.events())) == 1 and "only /cam0/events" in found.warnings[0]


@pytest.mark.parametrize("kind", KINDS)
def test_encodings_that_nobody_knows_and_bags_without_events_are_refused(tmp_path: Path, kind: str) -> None:
    assert "'secret'" in refused(packet_bag(tmp_path, kind, "secret", [(0, bytes(8))]))
    (tmp_path / "none").mkdir()
    assert "no topic of events" in refused(packet_bag(tmp_path / "none", kind, "", [], topics=0))


@pytest.mark.parametrize("compression", ["BZ2", "LZ4"])
def test_compressed_bags_are_read(tmp_path: Path, compression: str) -> None:
    events = events_at(TIMES["dense"] + START_US)
    path = written(tmp_path, "ros1", events)
    with rosbag1.Reader(path) as reader:
        writer = rosbag1.Writer(tmp_path / "compressed.bag")
        writer.set_compression(writer.CompressionFormat[compression])
        with writer:
            connection = writer.add_connection(EVENTS.name, "dvs_msgs/msg/EventArray", typestore=types_of("ros1"))
            for _, time, content in reader.messages():
                writer.write(connection, time, content)
    assert_same(Events.concatenate(read_events(tmp_path / "compressed.bag")), events)


def test_a_bag_whose_recording_was_interrupted_is_read_with_a_warning(tmp_path: Path) -> None:
    events = events_at(TIMES["dense"] + START_US)
    content = bytearray(written(tmp_path, "ros1", events).read_bytes())
    at = content.index(b"index_pos=") + 10
    (index_at,) = struct.unpack_from("<Q", content, at)
    content[at : at + 8] = bytes(8)
    (tmp_path / "whole").write_bytes(content[:index_at])
    assert_same(Events.concatenate(read_events(tmp_path / "whole")), events)
    (tmp_path / "cut").write_bytes(content[: index_at // 2])
    found = open_events(tmp_path / "cut")
    read = Events.concatenate(found.events())
    assert 0 < len(read) < len(events) and "interrupted" in found.warnings[0]
    assert_same(read, events.select(np.arange(len(read))))


def refused(path: Path) -> str:
    with pytest.raises(DataError) as raised:
        file = open_events(path)
        list(file.events())
        list(file.frames())
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)
    return str(raised.value)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.001, 0.02, 0.3, 0.6, 0.9, 0.9999])
def test_a_bag_cut_short_is_refused(tmp_path: Path, kind: str, share: float) -> None:
    whole = written(tmp_path, kind, events_at(TIMES["dense"] + START_US)).read_bytes()
    (tmp_path / "cut").write_bytes(whole[: max(int(share * len(whole)), 20)])
    assert "damaged" in refused(tmp_path / "cut")


@pytest.mark.parametrize("compress", [bz2.compress, lz4.frame.compress])
def test_a_small_chunk_that_swells_without_end_is_refused(tmp_path: Path, compress: Callable) -> None:
    content = written(tmp_path, "ros1", events_at(TIMES["one"] + START_US)).read_bytes()
    at, name = content.index(b"compression=none"), b"bz2" if compress is bz2.compress else b"lz4"
    head_at, bomb = at - 4 - 4 - 4, compress(bytes(400 << 20))
    fields = [b"op=\5", b"compression=" + name, b"size=" + struct.pack("<I", 400 << 20)]
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    record = struct.pack("<I", len(header)) + header + struct.pack("<I", len(bomb)) + bomb
    (tmp_path / "bomb").write_bytes(content[: head_at - 4] + record)
    refused(tmp_path / "bomb")


def base_of(path: Path, content: object) -> Path:
    """A base of SQLite with one message of events."""
    with closing(sqlite3.connect(path.with_name("base"))) as base, base:
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        columns = "name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT"
        base.execute(f"CREATE TABLE topics(id INTEGER PRIMARY KEY, {columns})")
        base.execute("INSERT INTO topics VALUES (1, '/dvs/events', 'dvs_msgs/msg/EventArray', 'cdr', '')")
        base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, 5, ?)", (content,))
    return path.with_name("base").rename(path)


@pytest.mark.parametrize("content", [None, 1 << 40, 0.5, "text"])
def test_messages_of_a_base_that_are_no_bytes_are_refused(tmp_path: Path, content: object) -> None:
    """A number would be taken for how many bytes to make."""
    assert "damaged" in refused(base_of(tmp_path / "bag.db3", content))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has fewer letters for names")
@pytest.mark.parametrize("name", [b"run#1.db3", b"run?mode=rwc", b"r%75n", b"a b.db3", "ü:€".encode(), b"\xff.db3"])
def test_a_base_is_read_whatever_it_and_its_folder_are_called(tmp_path: Path, name: bytes) -> None:
    """Not another one, which has the beginning of its name."""
    events, folder = events_at(START_US + np.arange(99)), tmp_path / os.fsdecode(name)
    folder.mkdir()
    whole, part = (
        event_array_bytes(EventArray(SIZE, START_US, events.stretch(0, count)), 0, cdr=True) for count in (99, 9)
    )
    path = base_of(folder / os.fsdecode(name), whole)
    for other in (folder / "run", tmp_path / "run"):
        base_of(other, part)
    assert_same(Events.concatenate(read_events(path)), events)
    path.rename(folder / "bag.db3")
    (folder / "metadata.yaml").write_text(METADATA)
    assert_same(Events.concatenate(read_events(folder)), events)


def test_without_rosbags_one_sentence_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, "ros2", events_at(TIMES["one"]), 0)
    for name in ("rosbags", "rosbags.rosbag2", "rosbags.rosbag2.storage_mcap", "rosbags.typesys"):
        monkeypatch.setitem(sys.modules, name, None)
    assert "pip install 'vid2ev[formats]'" in refused(path)
    with pytest.raises(UsageError, match="pip install"):
        written(tmp_path, "ros2", events_at(TIMES["one"]), 0)
