"""Events in the packets of a file, handed on in blocks of a size that pays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from vid2ev.stream.events import Events

ENOUGH = 1 << 16  # events for which it pays to be handed on; packets of some files hold a handful


def in_blocks(packets: Iterable[Events], block: int) -> Iterator[Events]:
    """The same events in the same order, no part of them empty or longer than `block`: packets of fewer than `ENOUGH`
    events are joined, those that are too long are cut."""
    enough = min(ENOUGH, block)
    held: list[Events] = []
    count = 0
    for events in packets:
        if not len(events):
            continue
        if held and count + len(events) > block:
            yield from _cut(held, block)
            held, count = [], 0
        held.append(events)
        count += len(events)
        if count >= enough:
            yield from _cut(held, block)
            held, count = [], 0
    yield from _cut(held, block)


def _cut(held: list[Events], block: int) -> Iterator[Events]:
    events = Events.concatenate(held)
    if len(events) <= block:
        if len(events):
            yield events
        return
    for at in range(0, len(events), block):
        yield events.select(np.arange(at, min(at + block, len(events))))
