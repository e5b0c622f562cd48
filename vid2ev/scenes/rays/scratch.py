"""What one thread works in while it measures pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.scenes.rays.layout import STACK

KEYS = 12  # parts of a pixel that are told apart
AREA, X, Y, AT_X, AT_Y = range(5)


class Scratch(NamedTuple):
    """What one thread works in."""

    stack: np.ndarray  # int64 [STACK]: nodes of a hierarchy
    things: np.ndarray  # int64 [n]: what may be seen in a tile
    corners: np.ndarray  # int64 [cells + 1, cells + 1]: keys at the corners of cells
    across: np.ndarray  # float64 [cells + 1, cells]: where the key changes along horizontal sides, 0 ... 1
    down: np.ndarray  # float64 [cells, cells + 1]: along vertical sides
    middles: np.ndarray  # float64 [cells, cells, 2]: where the parts of a cell meet [px]
    depths: np.ndarray  # float64 [cells + 1, cells + 1]: depths at the corners
    split: np.ndarray  # float64 [1]: the depth at which a mesh hides itself in the pixel, infinite if it does not
    odd: np.ndarray  # int64 [1]: whether more is in the pixel than its cells tell apart
    keys: np.ndarray  # int64 [KEYS]: what is in the pixel
    parts: np.ndarray  # float64 [KEYS, 5]: area, first moments, the place of a corner with that key


def scratch_for(things: int, cells: int) -> Scratch:
    """New scratch, for a world of so many things."""
    return Scratch(
        np.empty(STACK, np.int64),
        np.empty(things, np.int64),
        np.empty((cells + 1, cells + 1), np.int64),
        np.empty((cells + 1, cells), np.float64),
        np.empty((cells, cells + 1), np.float64),
        np.empty((cells, cells, 2), np.float64),
        np.empty((cells + 1, cells + 1), np.float64),
        np.full(1, np.inf),
        np.zeros(1, np.int64),
        np.empty(KEYS, np.int64),
        np.empty((KEYS, 5), np.float64),
    )
