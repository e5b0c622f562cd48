"""Libraries that are not ours read what is written, and what faery writes is read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import hdf5plugin  # noqa: F401  (registers the filters)
import numpy as np
import pytest
from recordings import all_events, assert_same, corner, dense, empty, events_of, long, sparse, written

from vid2ev.formats import format_named, open_events, read_events, recognise
from vid2ev.stream.events import Events

faery = pytest.importorskip("faery")
CASES = {"dense": dense, "sparse": sparse, "long": long, "empty": empty, "corner": lambda: corner((2048, 2048))}
SIZE = (640, 480)


def read_by_faery(path: Path, **options: object) -> Events:
    packets = [packet.copy() for packet in faery.events_stream_from_file(path, **options)]
    packet = np.concatenate(packets) if packets else np.zeros(0, faery.EVENTS_DTYPE)
    return Events(packet["t"].astype(np.int64), packet["x"], packet["y"], packet["on"].astype(np.uint8))


def write_by_faery(path: Path, events: Events, size: tuple[int, int], **options: object) -> None:
    """Only for few events in order of time, from zero: faery fills the disk with others."""
    assert len(events) < 10_000 and events.t[0] < 10**6 and np.all(np.diff(events.t) >= 0) and events.t[-1] < 10**8
    packet = np.zeros(len(events), faery.EVENTS_DTYPE)
    for name, column in (("t", events.t), ("x", events.x), ("y", events.y), ("on", events.p)):
        packet[name] = column
    faery.file_encoder.events_to_file([packet], path, size, **options)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", ["evt2", "evt3", "dat"])
def test_faery_reads_what_is_written(tmp_path: Path, name: str, case: str) -> None:
    recording = CASES[case]()
    path, events = written(format_named(name), recording, tmp_path), all_events(recording)
    if name == "dat":
        events = events.select(events.t - recording.start_us < 1 << 32)  # (the first file, which is all it knows of)
    read = read_by_faery(path)
    assert_same(Events(read.t + recording.start_us, read.x, read.y, read.p), events)


@pytest.mark.parametrize("case", ["dense", "sparse", "long", "empty"])
def test_faery_reads_the_text(tmp_path: Path, case: str) -> None:
    recording = CASES[case]()
    events = all_events(recording)
    blocks = [Events(events.t, events.x, events.y, events.p)] if len(events) else []
    path = written(format_named("csv"), replace(recording, blocks=lambda: iter(blocks), labelled=False), tmp_path)
    assert_same(read_by_faery(path, dimensions_fallback=recording.size), events)


@pytest.mark.parametrize("case", ["dense", "sparse", "long", "empty"])
@pytest.mark.parametrize("name", ["npz", "v2e-hdf5", "hdf5", "rpg"])
def test_plain_numpy_and_h5py_read_what_is_written(tmp_path: Path, name: str, case: str) -> None:
    recording = CASES[case]()
    kind, events = format_named(name), all_events(recording)
    if recording.duration_us > (kind.longest_us or recording.duration_us):
        pytest.skip("longer than this format can be")
    path = written(kind, recording, tmp_path)
    if name == "npz":
        with np.load(path) as file:
            columns = [file[column] for column in "txyp"]
    elif name == "rpg":
        table = np.loadtxt(path, skiprows=1, ndmin=2) if len(events) else np.zeros((0, 4))
        columns = [np.rint(table[:, 0] * 1e6), *table[:, 1:].T]
    else:
        with h5py.File(path) as file:
            table = file["events"]
            columns = [table[c][:] for c in "txyp"] if name == "hdf5" else list(table[:].reshape(-1, 4).T)
            columns[0] = columns[0].astype(np.int64) + recording.start_us
    for column, expected in zip(columns, (events.t, events.x, events.y, events.p), strict=True):
        np.testing.assert_array_equal(column, expected)


@pytest.mark.parametrize(
    ("suffix", "version", "name"),
    [
        ("raw", "evt2", "evt2"),
        ("raw", "evt3", "evt3"),
        ("dat", "dat2", "dat"),
        ("es", None, "es"),
        ("csv", None, "csv"),
    ],
)
def test_what_faery_writes_is_read(tmp_path: Path, suffix: str, version: str | None, name: str) -> None:
    gaps = np.random.default_rng(7).choice([0, 0, 1, 60, 130, 4000, 300_000], 1000)
    events = events_of(500 + np.cumsum(gaps), SIZE)
    path = tmp_path / f"events.{suffix}"
    write_by_faery(path, events, SIZE, version=version)
    file, kind = open_events(path), recognise(path)
    assert kind is not None and kind.name == name and file.size == SIZE
    first_us = int(events.t[0]) if name == "es" else 0  # (faery keeps the start of time in the others)
    read = Events.concatenate(file.events())
    assert_same(Events(read.t + first_us, read.x, read.y, read.p), events)
    assert file.warnings == []


def test_version_1_of_dat(tmp_path: Path) -> None:
    events = events_of(np.arange(1000) * 3, (304, 240))
    write_by_faery(tmp_path / "events.dat", events, (304, 240), version="dat1")
    assert_same(Events.concatenate(read_events(tmp_path / "events.dat")), events)
