"""Scratch of a walk: arrays that a tile writes before it reads them, made once and used for every interval.

They begin at the start of a line of the cache, as planes are whole lines long: a vector as wide as a line would
otherwise take two of them each time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vid2ev.kernels.crossing import FREE
from vid2ev.kernels.layout import BLOCK, LANE_COUNT, LANE_PITCH
from vid2ev.kernels.path import KNOTS
from vid2ev.kernels.response import LANES
from vid2ev.kernels.roots import GUESSES, JOBS
from vid2ev.kernels.scratch import SCRATCH
from vid2ev.kernels.turns import TURNS

LINE = 64  # bytes


class Work(NamedTuple):
    """For a block: what the scan finds.  For LANE_COUNT lanes: planes, pixels, a batch of crossings, their times."""

    scratch: np.ndarray  # float32, the block's new state
    flagged: np.ndarray  # uint8
    hits: np.ndarray  # int32
    lent: np.ndarray  # int32, pixels whose lags are borrowed
    lanes: np.ndarray  # float64
    pixels: np.ndarray  # int64
    live: np.ndarray  # int64
    who: np.ndarray  # int64, the lanes of a batch of crossings
    levels: np.ndarray  # float64 [nat]
    when: np.ndarray  # float64, fraction of the interval
    steps: np.ndarray  # float64, how far off the times may be
    jobs: np.ndarray  # float64
    guesses: np.ndarray  # float32
    turns: np.ndarray  # float64
    stamps: np.ndarray  # uint64, keys of events
    one_lane: np.ndarray  # float64, for a pixel by itself
    one_pixel: np.ndarray  # int64 [2], the pixel and 0, the number of its lane
    shot_lanes: np.ndarray  # float64
    shot_pixels: np.ndarray  # int64
    knots: np.ndarray  # float64


def new_work() -> Work:
    """Scratch for one thread."""
    f64, f32, i64 = np.float64, np.float32, np.int64
    return Work(
        scratch=aligned(SCRATCH, f32),
        flagged=aligned(BLOCK, np.uint8),
        hits=aligned(BLOCK + 8, np.int32),
        lent=aligned(BLOCK, np.int32),
        lanes=aligned(LANES, f64),
        pixels=aligned(LANE_COUNT, i64),
        live=aligned(LANE_COUNT + 1, i64),
        who=aligned(LANE_COUNT + 2, i64),
        levels=aligned(LANE_COUNT + 2, f64),
        when=aligned(LANE_COUNT + 2, f64),
        steps=aligned(LANE_COUNT, f64),
        jobs=aligned(JOBS, f64),
        guesses=aligned(GUESSES, f32),
        turns=aligned(TURNS, f64),
        stamps=aligned(2 * LANE_PITCH, np.uint64),
        one_lane=aligned(FREE, f64),
        one_pixel=aligned(2, i64),
        shot_lanes=aligned(FREE, f64),
        shot_pixels=aligned(LANE_COUNT, i64),
        knots=aligned(KNOTS, f64),
    )


def aligned(size: int, dtype: Any) -> np.ndarray:
    """An array of zeros at the start of a line of the cache."""
    dtype = np.dtype(dtype)
    room = np.zeros(size * dtype.itemsize + LINE, np.uint8)
    start = -room.ctypes.data % LINE
    return room[start : start + size * dtype.itemsize].view(dtype)
