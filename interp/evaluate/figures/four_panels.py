"""What went in and what came out, as a film: both cameras above, rebuilt and truth below (the paper's Fig. 11)."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np

from interp.evaluate.figures.layout import below, beside, check_pictures, resized, titled
from interp.evaluate.figures.lettering import strip
from vid2ev.errors import UsageError
from vid2ev.pictures.colours import MOST, event_colours, in_8_bits
from vid2ev.recording.disk import whole, writing

NAMES = ("frame camera", "event camera", "rebuilt", "truth")


def panel(
    frame: np.ndarray, off_on: np.ndarray, rebuilt: np.ndarray, truth: np.ndarray, titles: tuple[str, ...] = NAMES
) -> np.ndarray:
    """Four pictures with their names, uint8 [rows, columns, 3].

    frame            what the frame camera has seen last, uint8 [H, W, 3]
    off_on           OFF and ON events per pixel of the event camera, whole numbers [2, h, w], of any size
    rebuilt, truth   uint8 [H, W, 3]
    Raises UsageError for pictures of different sizes.
    """
    check_pictures(frame=frame, rebuilt=rebuilt, truth=truth)
    height, width = frame.shape[:2]
    events = resized(event_picture(off_on), width, height)
    named = [
        titled(picture, strip(title, width))
        for picture, title in zip((frame, events, rebuilt, truth), titles, strict=True)
    ]
    return below([beside(named[:2]), beside(named[2:])])


def event_picture(off_on: np.ndarray) -> np.ndarray:
    """Events as they are shown everywhere, uint8 [h, w, 3], of their numbers [2, h, w].  Raises UsageError."""
    if off_on.ndim != 3 or len(off_on) != 2:
        raise UsageError(f"events {list(off_on.shape)}: expected numbers of OFF and ON events [2, h, w]")
    off, on = np.clip(off_on, 0, MOST).astype(np.intp)
    return in_8_bits(event_colours())[off, on]


def write_four_panels(path: Path, panels: Iterable[np.ndarray], fps: Fraction | int) -> int:
    """Write panels of one size as an MP4 that a browser plays, there as a whole or not at all; returns their number.

    Raises UsageError without any, DataError for what cannot be written.
    """
    from itertools import chain

    from vid2ev.pictures.film import write_film

    coming = iter(panels)
    first = next(coming, None)
    if first is None:
        raise UsageError(f"{path}: no pictures for this film; expected at least one")
    with writing(path), whole(path) as beside_it:
        return write_film(beside_it, chain([first], coming), fps)
