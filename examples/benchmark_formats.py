#!/usr/bin/env python3
"""How fast event files are written and read, and how large they are.

    python examples/benchmark_formats.py                            every format that can be written
    python examples/benchmark_formats.py --format evt3 --format dat --events 2000000

The events are those of 40 objects that move over 1280x720 pixels for five seconds, in memory.  Times are of the
processor, of one thread, without the first use, which compiles; the formats take turns (A B C A B C), and the table has
the best of the rounds.  Each event that is read is compared with the one that was written.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import click
import numpy as np

from vid2ev.formats import FORMATS, format_named
from vid2ev.formats.event_file import BLOCK, Format, Recording
from vid2ev.stream.events import Events

SIZE = (1280, 720)
DURATION_US = 5_000_000
OBJECTS, SPREAD = 40, 25.0  # pixels


def clustered(count: int) -> Events:
    """Events around objects that move to the right, in order of time, row and column."""
    random = np.random.default_rng(0)
    t = random.integers(0, DURATION_US, count)
    which = random.integers(0, OBJECTS, count)
    centre = random.uniform((100, 100), (SIZE[0] - 200, SIZE[1] - 100), (OBJECTS, 2))
    x = centre[which, 0] + random.normal(0, SPREAD, count) + t * (100 / DURATION_US)
    y = centre[which, 1] + random.normal(0, SPREAD, count)
    x, y = (np.clip(place, 0, side - 1).astype(np.uint16) for place, side in zip((x, y), SIZE, strict=True))
    order = np.lexsort((x, y, t))
    return Events(t[order], x[order], y[order], random.integers(0, 2, count).astype(np.uint8))


def recording_of(events: Events) -> Recording:
    """All of them as a recording."""
    count = len(events)
    starts = range(0, count, BLOCK)
    return Recording(SIZE, 0, DURATION_US, count, lambda: (events.stretch(at, min(at + BLOCK, count)) for at in starts))


def measure(kind: Format, events: Events, path: Path) -> tuple[float, float, float]:
    """Seconds to write and to read, and bytes for each event."""
    assert kind.write and kind.open
    begin = time.process_time()
    kind.write(path, recording_of(events))
    written = time.process_time()
    blocks = list(kind.open(path).events())
    read = time.process_time()
    found = Events.concatenate(blocks)
    if any(not np.array_equal(getattr(found, name), getattr(events, name)) for name in "txyp"):
        raise click.ClickException(f"{kind.name}: what was read is not what was written")
    return written - begin, read - written, path.stat().st_size / len(events)


@click.command(help="Write and read events in each format; print sizes and speeds.")
@click.option("--format", "names", multiple=True, help="A format; may be given again.  [default: all]")
@click.option("--events", "count", default=10_000_000, show_default=True, help="How many.")
@click.option("--rounds", default=3, show_default=True, help="How often; the best counts.")
def main(names: tuple[str, ...], count: int, rounds: int) -> None:
    """Measure, then print."""
    kinds = [kind for kind in map(format_named, names or FORMATS) if kind.write and kind.open]
    events = clustered(count)
    best: dict[str, tuple[float, ...]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            measure(kind, events.stretch(0, min(count, 1000)), Path(folder) / f"events{kind.suffix}")
        for _ in range(rounds):
            for kind in kinds:
                found = measure(kind, events, Path(folder) / f"events{kind.suffix}")
                best[kind.name] = tuple(map(min, found, best.get(kind.name, found)))
    click.echo("| format | bytes per event | write, M events/s | read, M events/s |\n|---|---:|---:|---:|")
    for name, (write_s, read_s, size) in best.items():
        click.echo(f"| {name} | {size:.2f} | {count / write_s / 1e6:.0f} | {count / read_s / 1e6:.0f} |")


if __name__ == "__main__":
    main()
