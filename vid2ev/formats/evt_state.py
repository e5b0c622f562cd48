"""What a decoder or encoder of EVT words remembers from word to word, and what it counts; -1 is "not yet"."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class State(IntEnum):
    """Where the stream is."""

    HIGH = 0  # time, the upper bits
    LOOPS = 1  # how often they have started anew, less one
    LOW = 2  # time, the lower bits
    ROW = 3
    COLUMN = 4  # of the next vector
    ON = 5  # polarity of the next vector
    WIDTH = 6  # of the sensor


class Left(IntEnum):
    """What is left out."""

    EARLY = 0
    OUTSIDE = 1
    TRIGGERS = 2
    OTHERS = 3


def said_of(left: np.ndarray, outside: str) -> list[tuple[int, str]]:
    """How many of what are left out, of all kinds; `outside` names events that are no pixel's."""
    early, others = "events before the first time word are", "words of other kinds are"
    whats = (early, f"{outside} are", "external triggers are", others)
    return [(int(left[kind]), what) for kind, what in zip(Left, whats, strict=True)]
