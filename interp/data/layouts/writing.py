"""Sequences written in the HS-ERGB or BS-ERGB layout, so that what reads the releases reads them too.

Coordinates are pixels, float32, in HS-ERGB, as its release has them and Time Lens's loader takes them, and pixels times
32, uint16, in BS-ERGB.  File n of HS-ERGB has the events before picture n, the first one, which is empty, is before the
first picture; file n of BS-ERGB those after it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from interp.data.layouts.ergb import LAYOUTS, STAMPS
from interp.data.layouts.event_parts import SCALE
from interp.data.layouts.sequence import Sequence
from interp.own_codes import in_srgb
from vid2ev.errors import UsageError
from vid2ev.recording.disk import whole, write_npz, writing
from vid2ev.recording.exposures import write_codes


def write_sequence(sequence: Sequence, folder: Path, layout: str) -> None:
    """Write a sequence as a folder, there as a whole or not at all.

    Raises UsageError where events and pictures differ in size, or are too large for 16 bits, DataError for what cannot
    be written.
    """
    if sequence.size != sequence.event_size:
        raise UsageError(
            f"{sequence.name}: events of {sequence.event_size[0]}x{sequence.event_size[1]} beside pictures of"
            f" {sequence.size[0]}x{sequence.size[1]} pixels; the layout {layout} takes one size, --layout own both"
        )
    names = LAYOUTS[layout]
    if names.scaled and SCALE * max(sequence.size) > np.iinfo(np.uint16).max:
        raise UsageError(f"{sequence.name}: pictures of {max(sequence.size)} pixels; expected up to 2047 in {layout}")
    with writing(folder), whole(folder) as made:
        images, parts = made / names.images, made / names.events
        images.mkdir(parents=True)
        parts.mkdir()
        for k in range(len(sequence.times_us)):
            write_codes(images / f"{k:06d}.png", in_srgb(sequence.frame(k), sequence.curve))
        (images / STAMPS[0]).write_text("".join(f"{t}\n" for t in sequence.times_us), encoding="utf-8")
        edges = [int(t) for t in sequence.times_us]
        gaps = list(pairwise(edges))
        gaps = gaps if names.events_after else [(edges[0], edges[0]), *gaps]
        for k, (start_us, stop_us) in enumerate(gaps):
            t, x, y, p = sequence.events(start_us, stop_us)
            places = [_written(values, names.scaled) for values in (x, y)]
            write_npz(parts / f"{k:06d}.npz", dict(zip(names.columns, [*places, t, p], strict=True)))


def _written(px: np.ndarray, scaled: bool) -> np.ndarray:
    return np.rint(SCALE * px).astype(np.uint16) if scaled else px.astype(np.float32)
