"""`rebuilding`: every way to rebuild frames on some gaps of footage, its frames scored, and timed in turn.

First every way rebuilds all the gaps, and its frames are scored as `vid2ev eval` does it; what has to be compiled for
frames of that size is compiled then.  Then all rebuild the gap in the middle, several times over, so that a slow minute
of the machine hits all alike, every other round backwards; likewise of its frames brought to other sizes, after a
round that does not count.  What takes long is timed once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch.nn import functional as F

from interp.cost.ways import Way, ways
from interp.data.tensors import as_tensor
from interp.evaluate.group import Group
from interp.evaluate.protocol import Protocol, range_of
from interp.evaluate.rebuilders import OfMethod
from interp.evaluate.scoring import scores_of
from interp.evaluate.sets import check_simulated, footage_of
from interp.evaluate.simulated import Simulated
from interp.evaluate.tables import mean_of
from interp.methods import Gap
from vid2ev.cost.front import ahead
from vid2ev.cost.turns import Report, Turns
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.manifest import machine
from vid2ev.terminal import counted

Size = tuple[int, int]
GAPS = 4
SIZES: tuple[Size, ...] = ((640, 480), (1280, 720))
LONG_S = 10.0
AS_GOOD_DB = 0.2


@dataclass(frozen=True)
class Row:
    """A way as measured.

    psnr, ssim   means over its frames, against the range of the true frame; None where it is not worth a look, and
                 SSIM of frames that are smaller than its window
    ms           for each size, how long each pass took per frame that it made [ms]
    """

    way: Way
    psnr: float | None
    ssim: float | None
    ms: dict[Size, list[float]] = field(default_factory=dict)

    def time(self, size: Size) -> float:
        """The shortest: what else a machine does only ever adds to it."""
        return min(self.ms[size])


@dataclass(frozen=True)
class Rebuilding:
    """What was measured.  `sizes` [px] begin with that of the footage, whose frames are scored; that is `sequence`, the
    first of so many in the source."""

    source: str
    sequence: str
    first_of: int
    gaps: int
    multiple: int
    sizes: tuple[Size, ...]
    device: str
    threads: int
    rows: tuple[Row, ...]

    @property
    def front(self) -> list[Row]:
        """The ways than which none is both faster and closer to the truth, from the fastest on."""
        scored = [row for row in self.rows if row.psnr is not None]
        return ahead(scored, lambda row: row.time(self.sizes[0]), lambda row: -(row.psnr or 0.0))

    @property
    def recommended(self) -> Row:
        """The fastest of the ways that can be asked for and are as good as the best of these."""
        asked = [row for row in self.rows if row.way.asked and row.psnr is not None]
        best = max(row.psnr for row in asked if row.psnr is not None)
        good = [row for row in asked if row.psnr is not None and row.psnr >= best - AS_GOOD_DB]
        return min(good, key=lambda row: row.time(self.sizes[0]))

    def describe(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        best, front = self.recommended, self.front
        rows = [
            {
                "name": row.way.name,
                "group": row.way.group,
                "arguments": row.way.asked,
                "psnr_db": row.psnr,
                "ssim": row.ssim,
                "ms_per_frame": {f"{width}x{height}": times for (width, height), times in row.ms.items()},
                "front": row in front,
            }
            for row in self.rows
        ]
        return {
            "source": self.source,
            "sequence": self.sequence,
            "first_of": self.first_of,
            "gaps": self.gaps,
            "multiple": self.multiple,
            "size": list(self.sizes[0]),
            "device": self.device,
            "threads": self.threads,
            "machine": machine(),
            "ways": rows,
            "recommended": best.way.name,
        }


def rebuilding(
    source: str,
    *,
    multiple: int = 8,
    networks: Sequence[str | Path] = (),
    simulated: Simulated | None = None,
    gaps: int = GAPS,
    sizes: Sequence[Size] = SIZES,
    repeats: int = 3,
    threads: int | None = None,
    device: str = "cpu",
    report: Report | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> Rebuilding:
    """Try all ways on the first gaps of a source.

    source      what `vid2ev eval` takes: a recording, a video, `scene:NAME`; of several recordings the first is taken
    multiple    each so many-th frame is a key frame, and those between are rebuilt
    networks    weights (`interp.pretrained.path_of`); by default those that come with vid2ev
    simulated   the event camera that looks at films; by default a clean one, and without films none
    gaps        how many
    sizes       (width, height) to which frames are brought, besides their own, to be timed
    repeats     how often each way is timed
    threads     of torch; by default all cores
    report      told before each pass
    Raises UsageError for what cannot be meant, DataError for what cannot be read.
    """
    if multiple < 2 or gaps < 1 or repeats < 1:
        asked = f"{counted(multiple, 'time')} the frames, {counted(gaps, 'gap')}, {counted(repeats, 'repeat')}"
        raise UsageError(f"{asked}: expected at least 2, 1 and 1")
    protocol = Protocol(multiple - 1, multiple - 1)
    several = footage_of([source], protocol, simulated or Simulated.of("clean"), gaps).footage
    footage = several[0]
    check_simulated([footage], simulated)
    groups = list(footage.groups())
    if not groups:
        raise UsageError(f"{source}: no two key frames {counted(multiple, 'frame')} apart; give a longer one")
    if not any(range_of(true) for group in groups for true in group.truth):
        raise DataError(f"{source}: each frame to be rebuilt is of one value all over; give one of things")
    tried = ways(networks, device)
    own = groups[0].keys.shape[2], groups[0].keys.shape[1]
    every = tuple(dict.fromkeys([own, *sizes]))
    turns = Turns(report, len(tried) * (1 + (1 + repeats) * len(every)))
    with _threads(threads) as used:
        methods = [OfMethod(way.name, {}, way.open(), protocol, device) for way in tried]
        rows = []
        for way, method in zip(tried, methods, strict=True):
            turns.next(way.name)
            rows.append(Row(way, *_scores(method.begin(footage), groups) if way.scored else (None, None)))
        for size in every:
            gap, times = _brought_to(groups[len(groups) // 2], size, protocol, device)
            for row, taken in zip(rows, _timed(methods, gap, times, repeats, turns, clock), strict=True):
                row.ms[size] = taken
    of = source, footage.name, len(several)
    return Rebuilding(*of, len(groups), multiple, every, device, used, tuple(rows))


@contextmanager
def _threads(wanted: int | None) -> Iterator[int]:
    """How many torch has within."""
    before = torch.get_num_threads()
    torch.set_num_threads(wanted or before)
    try:
        yield torch.get_num_threads()
    finally:
        torch.set_num_threads(before)


def _scores(method: OfMethod, groups: Sequence[Group]) -> tuple[float, float | None]:
    """PSNR and SSIM, means over all frames; no SSIM of frames smaller than its window."""
    scores = [
        scores_of(made, true, group.keys)
        for group in groups
        for made, true in zip(method.frames(group), group.truth, strict=True)
        if made is not None
    ]
    psnr, ssim = (mean_of(each[name] for each in scores).mean for name in ("psnr", "ssim"))
    return psnr, None if math.isnan(ssim) else ssim


def _brought_to(group: Group, size: Size, protocol: Protocol, device: str) -> tuple[Gap, torch.Tensor]:
    """The gap with frames of another size, and of an event camera that is as much finer or coarser than it was beside
    them: each event is in the pixels that its own has become; and when to make frames."""
    high, wide = group.keys.shape[1:3]
    keys = as_tensor(np.stack([cv2.resize(key, size, interpolation=cv2.INTER_LINEAR) for key in group.keys]))
    counts, (tall, long) = group.events.off_on.flatten(0, 1).float(), group.events.off_on.shape[-2:]
    counts = F.interpolate(counts, (max(1, round(tall * size[1] / high)), max(1, round(long * size[0] / wide))))
    off_on = counts.to(group.events.off_on.dtype).unflatten(0, group.events.off_on.shape[:2])
    across = group.events.footprint
    across = max(1, round(across * size[0] / wide)) if across > 1 else 1  # (of those that are not laid over frames)
    events = replace(group.events, off_on=off_on, footprint=across)
    times = torch.from_numpy(protocol.targets(group.times_us)).float()
    return Gap(keys[0].to(device), keys[1].to(device), events.to(device)), times.to(device)


def _timed(
    methods: Sequence[OfMethod], gap: Gap, times: torch.Tensor, repeats: int, turns: Turns, clock: Callable[[], float]
) -> list[list[float]]:
    """How long each method takes per frame [ms], in turn; the first round, in which things are compiled and memory is
    found, does not count."""
    taken: list[list[float]] = [[] for _ in methods]
    for again in range(-1, repeats):
        for k in range(len(methods))[:: -1 if again % 2 else 1]:
            turns.next(methods[k].name)
            if taken[k] and taken[k][0] * len(times) > 1000 * LONG_S:
                continue
            method = methods[k].method.begin()
            began = clock()
            method.between(gap, times)
            if gap.frame_0.is_cuda:
                torch.cuda.synchronize(gap.frame_0.device)
            if again >= 0:
                taken[k].append(1000 * (clock() - began) / len(times))
    return taken
