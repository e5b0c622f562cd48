"""The light of a part of a scene: pictures on a grid of instants, rendered roughly first, then finely, and kept.

Pictures are taken at k / 2^n s, so that those of one part serve another that overlaps it, or is looked at more closely;
2^n is as near as it can be to what motion asks for (`scenes.instants.rate_hz`) with `MOST` pictures or so.  Before the
part there are a few, further apart, by which a sensor gets to know the scene.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from vid2ev.scenes.instants import Eye, key_of, rate_hz
from vid2ev.scenes.reel import Reel
from vid2ev.scenes.world import World
from vid2ev.seen.instants import Instant
from vid2ev.seen.mounts import Mount
from vid2ev.seen.sight import arriving
from vid2ev.stream.frames import LUMINANCE, Frame

MOST = 48  # pictures of a part
RUN_IN_S = 0.03  # before it
SPARSER = 4  # is the grid there
ROUGH_S = 0.25  # until what is there is shown
ROUGH = 9  # pictures that come before the run-in
FINEST_HZ = 2**29  # the next power of two is more than 10^9 (`scenes.instants.rate_of`)
KNOT_S = 1 / 128  # from one look at motion to the next
KEPT_BYTES = 200_000_000


class Film:
    """Pictures of one world at a time, as its cameras see them; `check` is called before each that is rendered."""

    def __init__(self, check: Callable[[], None] = lambda: None):
        self._check = check
        self._world: World | None = None
        self._reels: dict[Any, Reel] = {}
        self._kept: dict[Any, np.ndarray] = {}
        self._rates: dict[Any, float] = {}

    def rate_hz(self, world: World, begin_s: float, end_s: float, eyes: Sequence[Eye] = ()) -> float:
        """How often motion and light ask for a picture from `begin_s` to `end_s` [1/s], as cameras see them."""
        self._turn_to(world)
        seen = tuple(map(key_of, eyes))
        knots = range(math.floor(begin_s / KNOT_S), math.ceil(end_s / KNOT_S) + 1)
        every = max(1, len(knots) // 4)
        for knot in knots[::every]:
            if (knot, seen) not in self._rates:
                self._check()
                t_ns = min(round(1e9 * knot * KNOT_S), world.duration_ns)
                self._rates[knot, seen] = rate_hz(world, t_ns, eyes)
        return max(self._rates[knot, seen] for knot in knots[::every])

    def parts(
        self, world: World, mounts: Sequence[Mount], ticks: Sequence[int], fps: float, slower: float = 1.0
    ) -> Iterator[tuple[Instant, ...]]:
        """The instants k / fps of the `ticks` k, in the order of time: what there is after `ROUGH_S`, then all.  Their
        times are divided by `slower`."""
        self._turn_to(world)
        began_s, seen, told = time.monotonic(), dict[int, Instant](), False
        for k in ticks:
            seen[k] = self._instant(world, mounts, round(k * 10**9 / fps), slower)
            late = time.monotonic() - began_s > ROUGH_S
            if late and not told and 3 <= len(seen) < len(ticks) - 1:
                told = True
                yield tuple(seen[each] for each in sorted(seen))
        yield tuple(seen[each] for each in sorted(seen))

    def _instant(self, world: World, mounts: Sequence[Mount], t_ns: int, slower: float) -> Instant:
        views = [key_of(mount.view) for mount in mounts]
        coloured = {view for view, mount in zip(views, mounts, strict=True) if mount.sensor.colour}
        lights = [
            self._light(world, mount, (view, view in coloured, t_ns)) for view, mount in zip(views, mounts, strict=True)
        ]
        slowed_ns = round(t_ns / slower)
        return Instant(arriving(Frame(lights[0], slowed_ns), lights, mounts, None), slowed_ns)

    def _light(self, world: World, mount: Mount, key: tuple[Any, bool, int]) -> np.ndarray:
        view, coloured, t_ns = key
        light = self._kept.pop(key, None)
        if light is None:
            self._check()
            light = self._reels.setdefault(view, Reel(world, *mount.view)).picture(t_ns)[0].light
            light = light if coloured else light @ LUMINANCE
        self._kept[key] = light  # (the last that will go)
        while sum(kept.nbytes for kept in self._kept.values()) > KEPT_BYTES:
            self._kept.pop(next(iter(self._kept)))
        return light

    def _turn_to(self, world: World) -> None:
        if world is not self._world:
            self._world = world
            for known in (self._reels, self._kept, self._rates):
                known.clear()


def grid_hz(asked_hz: float, length_s: float) -> int:
    """The power of two that is nearest to a rate, with two pictures in a part at least, and about `MOST` at most; no
    more than a scene can be asked for, however short a part is."""
    if length_s * FINEST_HZ > 2:
        asked_hz = min(max(asked_hz, 2 / length_s), MOST / length_s)
    elif length_s > 0:
        asked_hz = FINEST_HZ
    return 2 ** max(0, round(math.log2(min(asked_hz, FINEST_HZ))))


def ticks_of(begin_s: float, end_s: float, fps: float, since_s: float = 0.0) -> list[int]:
    """The instants k / fps of a part: its ends first, those between ever closer, and among them the run-in, of which
    none is before `since_s`."""
    first, last = math.floor(begin_s * fps + 1e-9), math.ceil(end_s * fps - 1e-9)
    if begin_s == end_s:  # (a picture, as in the recording of such a part)
        last = first
    part = [first + k for k in coarse_first(last - first + 1)]
    earliest = math.ceil(max(begin_s - RUN_IN_S, since_s) * fps)
    before = [k for k in range(earliest, first) if k % SPARSER == 0]
    return [*part[:ROUGH], *before, *part[ROUGH:]]


def coarse_first(count: int) -> list[int]:
    """0 ... count - 1: both ends, then the middle, then what is between these, and so on."""
    seen = dict.fromkeys((0, count - 1))
    step = 1 << max(count - 1, 1).bit_length()
    while step:
        seen |= dict.fromkeys(range(0, count, step))
        step //= 2
    return [*seen]
