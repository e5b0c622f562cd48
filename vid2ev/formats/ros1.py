"""Bags of ROS 1: events as dvs_msgs/EventArray on /dvs/events, frames as sensor_msgs/Image on /dvs/image_raw.

`rosbag.py` and `rosbag_writer.py` have the container, `ros_messages.py` has the messages, `ros_events.py` says what is
in which message.  Bags are written without compression, as `rosbag record` does; the time of a message is that of its
last event.
"""

from __future__ import annotations

from pathlib import Path

from vid2ev.formats.event_file import Format, Picture, Recording
from vid2ev.formats.ros_events import CLOCK_US, EVENTS_TOPIC, IMAGES_TOPIC, RosEvents, outgoing
from vid2ev.formats.ros_messages import event_array_bytes, image_bytes
from vid2ev.formats.rosbag import MAGIC, BagReader, Topic
from vid2ev.formats.rosbag_writer import BagWriter

HEADER = "std_msgs/Header header\n"
RULE = "=" * 80 + "\n"
HEADER_DEFINITION = RULE + "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
EVENTS = Topic(
    EVENTS_TOPIC,
    "dvs_msgs/EventArray",
    "5e8beee5a6c107e504c2e78903c224b8",
    HEADER + "uint32 height\nuint32 width\ndvs_msgs/Event[] events\n" + HEADER_DEFINITION + RULE
    + "MSG: dvs_msgs/Event\nuint16 x\nuint16 y\ntime ts\nbool polarity\n",
)  # fmt: skip
IMAGES = Topic(
    IMAGES_TOPIC,
    "sensor_msgs/Image",
    "060021388200f6f0f447d0fcd9c64743",
    HEADER + "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n"
    + HEADER_DEFINITION,
)  # fmt: skip


def open_events(path: Path) -> RosEvents:
    """The events of a bag.  Raises DataError."""
    return RosEvents(path, BagReader)


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it, UsageError for times that ROS does not have."""
    counts = {EVENTS: 0, IMAGES: 0}
    with open(path, "wb") as file:
        bag = BagWriter(file, [EVENTS, IMAGES] if recording.frames else [EVENTS])
        for part in outgoing(recording):
            if isinstance(part, Picture):
                topic, t_us, message = IMAGES, part.t_us, image_bytes(part, counts[IMAGES], cdr=False)
            else:
                topic, t_us = EVENTS, int(part.events.t[-1]) if len(part.events) else part.stamp_us
                message = event_array_bytes(part, counts[EVENTS], cdr=False)
            # ROS has no time 0.
            bag.write(topic, max(t_us * 1000, 1), message)
            counts[topic] += 1
        bag.finish()


FORMAT = Format(
    "ros1",
    "bag of ROS 1, dvs_msgs",
    ".bag",
    recognises=lambda head, path: head.startswith(MAGIC),
    open=open_events,
    write=write_events,
    largest=(1 << 16, 1 << 16),
    clock_us=CLOCK_US,
    keeps=frozenset({"frames", "size", "start"}),
)
