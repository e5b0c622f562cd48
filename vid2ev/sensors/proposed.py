"""Candidates of forced events of some clips on a GPU, asked for and put in order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vid2ev.kernels.cuda.clips import Candidates, Clips
from vid2ev.kernels.cuda.proposals import Proposals
from vid2ev.kernels.forced import LOCAL
from vid2ev.physics.shot import CELL_NS, CELL_PIXELS

NOWHERE = np.iinfo(np.int64).max


def none_proposed(memory: Any) -> Candidates:
    """No candidates at all, but for the one of no pixel."""
    one = memory.put(np.array([NOWHERE]))
    return Candidates(one, one, memory.zeros(1, np.float64), memory.zeros(1, np.int64), memory.zeros(1, np.float64))


def proposed(
    memory: Any, kernel: Any, clips: Clips, hot: np.ndarray, numbers: Sequence, t0_ns: list[int], t1_ns: list[int]
) -> Candidates:
    """The candidates in (t0, t1] of each clip; their pixels are marked in `clips.forced`.

    `hot` has the hot pixels, each as clip x pixels + pixel.
    """
    cells = max((t1 - 1) // CELL_NS - t0 // CELL_NS + 1 for t0, t1 in zip(t0_ns, t1_ns, strict=True))
    shots = max(num.shot_rate_hz for num in numbers)
    blocks = -(-clips.pixels // CELL_PIXELS) if shots > 0 else 0
    threads = (len(numbers) * blocks + len(hot)) * cells
    if threads == 0:
        return none_proposed(memory)
    mean = max(CELL_PIXELS * shots, max(num.hot_rate_hz for num in numbers)) * CELL_NS * 1e-9
    room, count = math.ceil(mean + 6.0 * math.sqrt(mean)) + 8, memory.zeros((3, threads), np.int64)
    t0, dt = memory.put(np.array(t0_ns, np.int64)), memory.put(np.subtract(t1_ns, t0_ns).astype(np.float64))
    hot = memory.put(hot if len(hot) else np.zeros(1, np.int64))
    while True:
        keys, chance = memory.zeros((threads, room), np.int64), memory.zeros((threads, room), np.float64)
        asked = Proposals(t0, dt, cells, blocks, hot, keys, chance, count[0], count[1], count[2])
        memory.launch(kernel, threads, clips, asked)
        if int(count[0].min()) >= 0:
            return _in_order(memory, clips, asked)
        room *= 2


def _in_order(memory: Any, clips: Clips, asked: Proposals) -> Candidates:
    """The candidates that were found, by pixel and time."""
    found = memory.count_to(asked.keys.shape[1])[None, :] < asked.count[:, None]
    thread = (asked.keys * 0 + memory.count_to(asked.keys.shape[0])[:, None])[found]
    keys, wanted = asked.keys[found], asked.chance[found]
    place = asked.place[thread] + (keys >> int(LOCAL))
    t_ns = asked.t0_ns[asked.clip[thread]] + (keys & ((1 << int(LOCAL)) - 1))
    by_time = memory.order(t_ns)
    order = by_time[memory.order(place[by_time])]
    clips.forced[place] = 1
    none = none_proposed(memory)
    parts = ((place, none.pixel), (t_ns, none.t_ns), (wanted, none.wanted))
    pixel, t_ns, wanted = (memory.joined((part[order], last)) for part, last in parts)
    return Candidates(pixel, t_ns, wanted, pixel * 0, wanted * 0.0)
