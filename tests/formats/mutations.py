"""Reads a file again and again, each time with some of its bytes changed; run in a process of its own.

    python -m tests.formats.mutations FORMAT FILE FIRST COUNT

Whatever the bytes, reading ends in events or in a DataError, in a few seconds and a few hundred megabytes.  The number
of each attempt is printed before it begins, so that it is known after a crash: attempts FIRST ... FIRST + COUNT - 1
depend on nothing but their number.
"""

from __future__ import annotations

import re
import resource
import signal
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats import format_named, read_events
from vid2ev.formats.event_file import EventFile, Format

SECONDS = 20  # for an attempt
MEMORY = 600 << 20  # bytes beyond those that the process has when it has read the file once
MOST_EVENTS = 20_000_000  # that a small file can hold in good faith
NUMBERS = (b"0", b"1", b"-1", b"65536", b"4294967296", b"99999999999999999999", b"1e300", b"x", b"")


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """The bytes with one to four changes."""
    data = bytearray(content)
    for _ in range(random.integers(1, 5)):
        at, end = np.sort(random.integers(0, len(data) + 1, 2))
        at, end = (at, min(end, at + 64)) if random.random() < 0.7 else (at, end)
        early = int(random.integers(0, min(len(data), 400) + 1))
        change = random.integers(0, 9)
        if change == 0 and len(data):
            data[random.integers(len(data))] ^= 1 << int(random.integers(8))
        elif change == 1:
            data[early : early + 1] = random.bytes(1)
        elif change == 2:
            del data[at:]
        elif change == 3:
            del data[at:end]
        elif change == 4:
            data[at:at] = random.bytes(int(random.integers(1, 64)))
        elif change == 5:
            data[end:end] = data[at:end]
        elif change == 6:
            data[at:end] = bytes(end - at) if random.random() < 0.5 else b"\xff" * (end - at)
        elif change == 7:
            numbers = list(re.finditer(rb"\d+", bytes(data[:2000])))
            if numbers:
                number = numbers[random.integers(len(numbers))]
                data[number.start() : number.end()] = NUMBERS[random.integers(len(NUMBERS))]
        else:
            data[early : early + 8] = random.bytes(8)
    return bytes(data)


def consume(file: EventFile) -> None:
    """All that a file gives, and that it is what it should be."""
    count = 0
    for events in file.events():
        assert len(events) == len(events.x) == len(events.y) == len(events.p) > 0
        assert (events.t.dtype, events.x.dtype, events.y.dtype, events.p.dtype) == ("i8", "u2", "u2", "u1")
        assert events.p.max() <= 1
        count += len(events)
        assert count < MOST_EVENTS
    if file.has_frames:
        for picture in file.frames():
            assert picture.pixels.dtype == np.uint8
    file.describe()


def attempt(kind: Format, path: Path) -> None:
    """Read a file as one of the format, and as whatever it is taken for."""
    assert kind.open is not None
    try:
        consume(kind.open(path))
    except DataError as error:
        assert "\n" not in str(error)
    try:
        for _ in read_events(path):
            pass
    except DataError as error:
        assert "\n" not in str(error)


def main(name: str, sample: str, first: int, count: int) -> None:
    warnings.simplefilter("error")
    kind, content = format_named(name), Path(sample).read_bytes()
    attempt(kind, Path(sample))
    used = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[1]) << 10  # type: ignore[index]
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / Path(sample).name
        for number in range(first, first + count):
            print(number, flush=True)
            path.write_bytes(mutated(content, np.random.default_rng(number)))
            signal.alarm(SECONDS)
            attempt(kind, path)
            signal.alarm(0)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
