"""AEDAT4: dv-processing and faery read what is written; what they and a camera wrote is read."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import dv_processing as dv
import faery
import numpy as np
import pytest
from container_recordings import (
    EVENT_FILES,
    SIZE,
    START_US,
    assert_same_pictures,
    events_at,
    pictures_at,
    recording_of,
    times_us,
)
from recordings import assert_same

from vid2ev.errors import DataError, UsageError
from vid2ev.formats import check_holds, describe_events, open_events, read_events
from vid2ev.formats.aedat4 import FORMAT, MAGIC, write_events
from vid2ev.formats.event_file import Picture, Recording
from vid2ev.stream.events import Events

TIMES = times_us()


def read_by_dv(path: Path) -> Events:
    camera = dv.io.MonoCameraRecording(str(path))
    parts = [np.empty(0, dv.EventStore().numpy().dtype)]
    while (batch := camera.getNextEventBatch()) is not None:
        parts.append(batch.numpy())
    stored = np.concatenate(parts)
    t, x, y, p = (stored[name] for name in ("timestamp", "x", "y", "polarity"))
    return Events(t, x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))


def write_by_dv(path: Path, events: Events, compression: str, pictures: Sequence[Picture] = ()) -> None:
    config = dv.io.MonoCameraWriter.Config("CAMERA_7")
    config.addEventStream(SIZE)
    config.addFrameStream(SIZE)
    config.compression = getattr(dv.CompressionType, compression)
    writer, store = dv.io.MonoCameraWriter(str(path), config), dv.EventStore()
    for event in zip(
        events.t.tolist(), events.x.tolist(), events.y.tolist(), events.p.astype(bool).tolist(), strict=True
    ):
        store.push_back(*event)
    writer.writeEvents(store)
    for picture in pictures:
        writer.writeFrame(dv.Frame(picture.t_us, picture.pixels))
    del writer


@pytest.mark.parametrize("name", TIMES)
def test_dv_and_faery_read_what_is_written_and_so_do_we(tmp_path: Path, name: str) -> None:
    path, events = tmp_path / "events.aedat4", events_at(TIMES[name] + START_US)
    write_events(path, recording_of(events, START_US - 5))
    assert_same(Events.concatenate(read_events(path)), events)
    found = open_events(path)
    assert (found.size, found.start_us, found.labelled, found.has_frames) == (SIZE, START_US - 5, False, False)
    assert_same(read_by_dv(path), events)
    camera = dv.io.MonoCameraRecording(str(path))
    assert (camera.getEventResolution(), camera.getCameraName()) == (SIZE, "vid2ev")
    if len(events):
        assert camera.getTimeRange() == (events.t[0], events.t[-1])
        stream = faery.events_stream_from_file(path, file_type="aedat")
        stored = np.concatenate(list(stream))
        assert stream.dimensions() == SIZE
        t, x, y, p = (stored[key] for key in ("t", "x", "y", "on"))
        assert_same(Events(t.astype(np.int64), x, y, p.astype(np.uint8)), events)


def test_dv_finds_any_window_by_the_table_at_the_end(tmp_path: Path) -> None:
    events = events_at(TIMES["dense"] + START_US)
    write_events(tmp_path / "events.aedat4", recording_of(events))
    camera = dv.io.MonoCameraRecording(str(tmp_path / "events.aedat4"))
    for first, last in ((0, 1), (0, 50_000), (33_333, 33_334), (40_000, 99_000), (99_999, 100_000)):
        store = camera.getEventsTimeRange(START_US + first, START_US + last)
        inside = (events.t >= START_US + first) & (events.t < START_US + last)
        np.testing.assert_array_equal(store.timestamps().ravel(), events.t[inside])


@pytest.mark.parametrize("shape", [(30, 40), (31, 41, 3)])
def test_frames_stand_among_the_events_and_come_back(tmp_path: Path, shape: tuple[int, ...]) -> None:
    events = events_at(TIMES["dense"] + START_US)
    pictures = pictures_at(START_US + 9_973 * np.arange(-2, 13), *shape)
    write_events(tmp_path / "events.aedat4", recording_of(events, pictures=pictures))
    found = open_events(tmp_path / "events.aedat4")
    assert found.has_frames
    assert_same_pictures(list(found.frames()), pictures)
    assert_same(Events.concatenate(found.events()), events)
    assert_same(read_by_dv(tmp_path / "events.aedat4"), events)
    camera = dv.io.MonoCameraRecording(str(tmp_path / "events.aedat4"))
    assert camera.getFrameResolution() == (shape[1], shape[0])
    for picture in pictures:
        frame = camera.getNextFrame()
        assert frame is not None and frame.timestamp == picture.t_us
        np.testing.assert_array_equal(frame.image, picture.pixels if len(shape) == 2 else picture.pixels[..., ::-1])
    assert camera.getNextFrame() is None


@pytest.mark.parametrize("seed", range(4))
def test_frames_whose_times_go_back_leave_the_events_as_they_are(tmp_path: Path, seed: int) -> None:
    """As they may stand in a file of others, whose events are put in order and whose frames are not."""
    events = events_at(TIMES["dense"] + START_US)
    order = np.random.default_rng(seed).permutation(10)
    pictures = pictures_at(START_US + 9_973 * order, 3, 4)
    write_events(tmp_path / "events.aedat4", recording_of(events, pictures=pictures))
    found = open_events(tmp_path / "events.aedat4")
    assert_same(Events.concatenate(found.events()), events)
    assert_same_pictures(list(found.frames()), pictures)


def test_packets_are_in_order_of_time(tmp_path: Path) -> None:
    events = events_at(TIMES["dense"] + START_US)
    pictures = pictures_at(START_US + 9_973 * np.arange(12), 3, 4)
    write_events(tmp_path / "events.aedat4", recording_of(events, pictures=pictures))
    content = (tmp_path / "events.aedat4").read_bytes()
    at = 18 + struct.unpack_from("<I", content, 14)[0]
    (end,) = struct.unpack_from("<q", content, 54)
    streams = []
    while at < end:
        stream, size = struct.unpack_from("<ii", content, at)
        streams.append(stream)
        at += 8 + size
    frames = np.flatnonzero(streams)
    assert at == end and len(frames) == 12 and np.all(np.diff(frames) > 1)


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "LZ4_HIGH", "ZSTD", "ZSTD_HIGH"])
def test_what_dv_wrote_is_read(tmp_path: Path, compression: str) -> None:
    events = events_at(TIMES["sparse"] + START_US)
    pictures = pictures_at(START_US + 1000 * np.arange(3), 240, 320)
    colour = Picture(START_US + 9000, np.random.default_rng(0).integers(0, 256, (240, 320, 3)).astype(np.uint8))
    deep = (np.arange(320 * 240).reshape(240, 320) % (1 << 16)).astype(np.uint16)
    write_by_dv(tmp_path / "dv.aedat4", events, compression, [*pictures, colour, Picture(START_US + 9001, deep)])
    found = open_events(tmp_path / "dv.aedat4")
    assert_same(Events.concatenate(found.events()), events)
    assert (found.size, found.start_us, found.warnings) == (SIZE, int(events.t[0]), [])
    assert found.describe() == {"camera": "CAMERA_7", "compression": compression.split("_")[0].lower()}
    rgb = [Picture(colour.t_us, colour.pixels[..., ::-1]), Picture(START_US + 9001, (deep >> 8).astype(np.uint8))]
    assert_same_pictures(list(found.frames()), [*pictures, *rgb])


def test_what_a_camera_recorded_is_read_as_dv_and_faery_read_it() -> None:
    path = EVENT_FILES / "davis.aedat4"
    if not path.exists():
        pytest.skip("needs davis.aedat4 of the shared data")
    found = open_events(path)
    events = Events.concatenate(found.events())
    assert (len(events), int(events.p.sum()), found.size) == (117_667, 72_363, (346, 260))
    assert_same(events, read_by_dv(path))
    stored = np.concatenate(list(faery.events_stream_from_file(path)))
    np.testing.assert_array_equal(stored["t"].astype(np.int64), events.t)
    camera = dv.io.MonoCameraRecording(str(path))
    for picture in found.frames():
        frame = camera.getNextFrame()
        # dv-processing 2 gives the start of the exposure, the file the middle.
        middle_us = frame.timestamp + frame.exposure.total_seconds() * 1e6 / 2
        assert abs(picture.t_us - middle_us) <= 1
        np.testing.assert_array_equal(frame.image, picture.pixels)
    assert camera.getNextFrame() is None


def test_what_faery_wrote_is_read(tmp_path: Path) -> None:
    events = events_at(TIMES["dense"])
    stored = np.zeros(len(events), faery.EVENTS_DTYPE)
    stored["t"], stored["x"], stored["y"], stored["on"] = events.t, events.x, events.y, events.p
    faery.events_stream_from_array(stored, SIZE).to_file(tmp_path / "faery.aedat4")
    assert_same(Events.concatenate(read_events(tmp_path / "faery.aedat4")), events)


def test_of_two_cameras_the_first_is_read_with_a_warning(tmp_path: Path) -> None:
    left, right = (dv.io.MonoCameraWriter.EventOnlyConfig(name, SIZE) for name in ("L", "R"))
    writer = dv.io.StereoCameraWriter(str(tmp_path / "two.aedat4"), left, right)
    for side, x in ((writer.left, 3), (writer.right, 4)):
        store = dv.EventStore()
        store.push_back(10, x, 1, True)
        side.writeEvents(store)
    del writer, side
    found = open_events(tmp_path / "two.aedat4")
    (events,) = found.events()
    assert events.x.tolist() == [3] and "2 streams" in found.warnings[0]


def test_a_recording_whose_end_was_never_written_is_read(tmp_path: Path) -> None:
    events = events_at(TIMES["sparse"] + START_US)
    write_events(tmp_path / "whole.aedat4", recording_of(events))
    content = bytearray((tmp_path / "whole.aedat4").read_bytes())
    (table_at,) = struct.unpack_from("<q", content, 54)
    struct.pack_into("<q", content, 54, -1)
    (tmp_path / "unplugged.aedat4").write_bytes(content[:table_at])
    assert_same(Events.concatenate(read_events(tmp_path / "unplugged.aedat4")), events)


def test_the_same_events_give_the_same_bytes(tmp_path: Path) -> None:
    recording = recording_of(events_at(TIMES["dense"] + START_US))
    for name in ("one", "other"):
        write_events(tmp_path / f"{name}.aedat4", recording)
    assert (tmp_path / "one.aedat4").read_bytes() == (tmp_path / "other.aedat4").read_bytes()


def test_windows_and_blocks(tmp_path: Path) -> None:
    events = events_at(TIMES["sparse"] + START_US)
    write_events(tmp_path / "events.aedat4", recording_of(events))
    parts = list(read_events(tmp_path / "events.aedat4", START_US + 50, START_US + 20_000_050, block=100))
    assert max(map(len, parts)) <= 100
    inside = events.select((events.t >= START_US + 50) & (events.t < START_US + 20_000_050))
    assert_same(Events.concatenate(parts), inside)


@pytest.mark.parametrize("t", [[5, 4], [-1, 0]])
def test_times_out_of_order_or_before_the_start_are_not_written(tmp_path: Path, t: list[int]) -> None:
    with pytest.raises(ValueError, match="order"):
        write_events(tmp_path / "events.aedat4", recording_of(events_at(np.array(t)), 0))


def test_what_cannot_be_held_is_refused(tmp_path: Path) -> None:
    check_holds(FORMAT, (32767, 32767))
    with pytest.raises(UsageError, match="32767x32767"):  # (a frame of that width would be refused while it is written)
        check_holds(FORMAT, (32768, 1))
    deep = [Picture(START_US, np.zeros((3, 4), np.uint16))]
    with pytest.raises(UsageError, match="uint16"):
        write_events(tmp_path / "events.aedat4", recording_of(events_at(np.array([START_US])), pictures=deep))


def refused(path: Path) -> str:
    with pytest.raises(DataError) as raised:
        list(read_events(path))
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)
    return str(raised.value)


@pytest.mark.parametrize("share", [0.001, 0.02, 0.3, 0.6, 0.9])
def test_a_file_cut_short_is_refused(tmp_path: Path, share: float) -> None:
    write_events(tmp_path / "events.aedat4", recording_of(events_at(TIMES["dense"] + START_US)))
    whole = (tmp_path / "events.aedat4").read_bytes()
    (tmp_path / "cut.aedat4").write_bytes(whole[: max(int(share * len(whole)), len(MAGIC))])
    assert "cut short" in refused(tmp_path / "cut.aedat4")


def test_a_small_packet_that_swells_without_end_is_refused(tmp_path: Path) -> None:
    import lz4.frame

    write_events(tmp_path / "events.aedat4", recording_of(events_at(TIMES["one"] + START_US)))
    content = (tmp_path / "events.aedat4").read_bytes()
    at = 18 + struct.unpack_from("<I", content, 14)[0]
    bomb = lz4.frame.compress(bytes(300 << 20))
    (tmp_path / "bomb.aedat4").write_bytes(content[:at] + struct.pack("<ii", 0, len(bomb)) + bomb)
    assert "damaged" in refused(tmp_path / "bomb.aedat4")


def test_a_file_of_frames_alone_is_refused(tmp_path: Path) -> None:
    config = dv.io.MonoCameraWriter.FrameOnlyConfig("C", (40, 30))
    writer = dv.io.MonoCameraWriter(str(tmp_path / "frames.aedat4"), config)
    writer.writeFrame(dv.Frame(5, np.zeros((30, 40), np.uint8)))
    del writer
    assert "no stream of events" in refused(tmp_path / "frames.aedat4")


def test_the_description(tmp_path: Path) -> None:
    events = events_at(TIMES["dense"] + START_US)
    recording = recording_of(events)
    write_events(tmp_path / "events.aedat4", Recording(SIZE, START_US, 200_000, recording.count, recording.blocks))
    found = describe_events(tmp_path / "events.aedat4")
    assert (found["format"], found["events"], found["on"]) == ("aedat4", len(events), int(events.p.sum()))
    assert (found["start_us"], found["first_us"], found["times_going_back"]) == (START_US, int(events.t[0]), 0)
