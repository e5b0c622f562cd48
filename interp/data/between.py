"""What the events of a recording say between two of its key frames."""

from __future__ import annotations

import numpy as np

from interp.candidates.calibrated import calibrated
from interp.data.layouts import Sequence
from interp.data.layouts.sequence import matter_from_us
from interp.data.tensors import as_tensor
from interp.own_codes import shown
from interp.representation.event_counts import EventCounts, count_events

Part = tuple[int, int, int, int]


def events_between(
    sequence: Sequence, keys: np.ndarray, between_us: tuple[int, int], steps: int, part: Part | None = None
) -> EventCounts:
    """Counts, B = 1, of the events after the first and up to the second of two instants.

    keys    the frames at these instants, codes by its curve uint8 [2, H, W, 3]: they say what an event stands for,
            where nobody knows, and how far an event camera that stands apart looks beside them
    steps   sub-intervals
    part    left, top, width and height of what is counted [px of the event camera], if that is not all; `keys` are of
            that part, then
    Raises DataError for files that cannot be read.
    """
    left, top, *size = part or (0, 0, *sequence.event_size)
    start_us, stop_us = between_us
    placed = sequence.events(matter_from_us(sequence, start_us, sequence.dead_time), stop_us)
    seen, _ = placed.part(left, top, size[0], size[1])
    counts = count_events(seen, (size[0], size[1]), start_us, stop_us, steps, dead_time=sequence.dead_time)
    looks = sequence.looks((start_us + stop_us) // 2)
    return calibrated(as_tensor(shown(keys, sequence.curve)), counts, sequence.contrast, sequence.apart, looks)
