"""Reads damaged copies of a file, one after another, with little memory and little time; prints how many were read
and how many were refused.  Anything but events or one sentence of DataError ends it.

    python container_damage.py FILE FOLDER COPIES SEED
"""

from __future__ import annotations

import resource
import signal
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats import open_events

MEMORY = 3 << 30  # bytes of address space, most of which compiled code and libraries take
SECONDS = 20


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """A copy with bits flipped, bytes overwritten, cut short, or with a span left out, doubled or put in."""
    copy = bytearray(content)
    for _ in range(int(random.integers(1, 4))):
        # Headers are short and matter most: every other place is near the start.
        reach = len(copy) if random.integers(2) else min(len(copy), 1 << int(random.integers(5, 15)))
        at = int(random.integers(max(reach, 1)))
        length = 1 << int(random.integers(0, 12))
        match int(random.integers(7)):
            case 0:
                copy[at : at + 1] = bytes(byte ^ 1 << int(random.integers(8)) for byte in copy[at : at + 1])
            case 1:
                copy[at : at + 4] = random.choice([b"\xff" * 4, b"\xff\xff\xff\x7f", bytes(4), b"\x00\x00\x00\x80"])
            case 2:
                del copy[at:]
            case 3:
                del copy[at : at + length]
            case 4:
                copy[at:at] = copy[at : at + length]
            case 5:
                copy[at:at] = random.bytes(length)
            case _:
                copy[at : at + 8] = random.bytes(len(copy[at : at + 8]))
    return bytes(copy)


def outcome(path: Path) -> str:
    """What becomes of reading a file."""
    try:
        file = open_events(path)
        for events in file.events():
            assert len(events.t) == len(events.x) == len(events.y) == len(events.p) and events.p.max() <= 1
        for picture in file.frames():
            assert picture.pixels.dtype == np.uint8 and picture.pixels.ndim in (2, 3)
    except DataError as error:
        assert "\n" not in str(error) and str(path) in str(error), error
        return "refused"
    return "read"


def main(source: Path, folder: Path, copies: int, seed: int) -> None:
    content, path = source.read_bytes(), folder / "damaged"
    path.write_bytes(content)
    assert outcome(path) == "read"
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    found: Counter[str] = Counter()
    for copy in range(copies):
        path.write_bytes(damaged(content, np.random.default_rng([seed, copy])))
        signal.alarm(SECONDS)
        try:
            found[outcome(path)] += 1
        except BaseException:
            print(f"copy {copy} of {source} with seed {seed}", file=sys.stderr)
            raise
        signal.alarm(0)
    print(found["read"], found["refused"])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
