"""Candidates of forced events, a thread for each cell of the clock in each of its blocks of pixels or hot pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.forced import hot_of_cell, shot_of_cell
from vid2ev.kernels.rows import sensor_of
from vid2ev.physics.shot import CELL_NS, CELL_PIXELS


class Proposals(NamedTuple):
    """What is asked for, and room for it."""

    t0_ns: np.ndarray  # int64 [clips], candidates come after it
    dt_ns: np.ndarray  # float64 [clips], and within as long
    cells: int  # of the longest
    blocks: int  # of CELL_PIXELS in each clip
    hot: np.ndarray  # int64, clip x pixels + pixel
    keys: np.ndarray  # int64 [threads, room]
    chance: np.ndarray  # float64 [threads, room]
    count: np.ndarray  # int64 [threads], -1 where there is no room
    place: np.ndarray  # int64 [threads], added to the pixels of the keys
    clip: np.ndarray  # int64 [threads]


class Span(NamedTuple):
    """As much of an interval as candidates have to do with."""

    t0_ns: int
    dt_ns: float


@compiled
def propose(thread, clips, asked, flags):
    """The candidates of a thread's cell: first all of shots, by clip, block and cell, then those of hot pixels."""
    shots = clips.light.shape[1] * asked.blocks * asked.cells
    hot = thread >= shots
    part, cell = (thread - shots if hot else thread) // asked.cells, thread % asked.cells
    place = asked.hot[part] if hot else np.int64(0)
    clip = place // clips.pixels if hot else part // asked.blocks
    pixel = place - clip * clips.pixels if hot else (part - clip * asked.blocks) * CELL_PIXELS
    num = sensor_of(clips.sensor_floats[clip], clips.sensor_ints[clip])
    iv, keys, chance = Span(asked.t0_ns[clip], asked.dt_ns[clip]), asked.keys[thread], asked.chance[thread]
    cell += iv.t0_ns // CELL_NS
    n = np.int64(0)
    if cell <= (iv.t0_ns + np.int64(iv.dt_ns) - 1) // CELL_NS:
        if hot:
            n = hot_of_cell(keys, chance, n, pixel, pixel, cell, num, iv) if num.hot_rate_hz > 0.0 else n
        elif num.shot_rate_hz > 0.0:
            n = shot_of_cell(keys, chance, n, pixel, min(CELL_PIXELS, clips.pixels - pixel), cell, num, iv)
    asked.count[thread], asked.place[thread], asked.clip[thread] = n, clip * clips.pixels + pixel, clip
