"""A clip parted in time, for recordings of its parts that are put together again.

At **cuts**, where sensors start afresh anyway, this is exact: what they send after a cut depends on nothing before it.

Anywhere else a part does not know what its pixels have in them from before.  Approximately they do after a while:
sensors are shown some of what comes before the part, and nothing is kept of that.  By then filters have forgotten where
they began, and pixels that have sent events are as many as ever near their next level.  But the levels of a pixel lie
elsewhere between two thresholds than they would, and so do the times of its events, up to the next cut or event that
brings its memory to the signal (shot noise).

    warm-up = 1 s + 10 (tau of all poles) + refractory period + delay, and up to a frame more
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.spec import DvsSpec
from vid2ev.upsample.cuts import CutDetector

WARM_US, TIME_CONSTANTS = 1_000_000, 10

Look = Callable[[int, int | None], object]  # takes how many frames were looked at, and of how many


class Stretch(NamedTuple):
    """A part of a clip, as options of `convert`: both ends [s, of the source's own clock], in the middle between two
    frames; what comes before `since_ns` [ns, of the recording's] is its warm-up."""

    start: Fraction | None
    stop: Fraction | None
    since_ns: int | None = None


def at_cuts(recipe: Recipe, count: int, options: dict[str, Any], look: Look | None = None) -> list[Stretch]:
    """At most so many stretches, all but the first of which begin with a shot, about as long as each other."""
    times_ns, cuts = _looked_at(recipe, look, cuts=True)
    wanted = [len(times_ns) * k / count for k in range(1, count)]
    chosen = sorted({min(cuts, key=lambda cut: abs(cut - place)) for place in wanted}) if cuts else []
    ends = _ends(times_ns, [cut - 1 for cut in chosen], options)
    return [Stretch(*both) for both in pairwise([options.get("start"), *ends, options.get("stop")])]


def with_warm_up(recipe: Recipe, count: int, options: dict[str, Any], look: Look | None = None) -> list[Stretch]:
    """At most so many stretches, as long as each other to a frame; the last frame of one is the first of the next."""
    times_ns, _ = _looked_at(recipe, look, cuts=False)
    last, warm_ns = len(times_ns) - 1, 1000 * warm_up_us(recipe)
    seams = sorted({last * k // count for k in range(1, count)} - {0})
    begun = [max(bisect(times_ns, times_ns[seam] - warm_ns) - 1, 0) for seam in seams]
    starts = [_ends(times_ns, [first - 1], options)[0] if first else options.get("start") for first in begun]
    stops = [*_ends(times_ns, seams, options), options.get("stop")]
    since = [None, *(times_ns[seam] for seam in seams)]
    return [Stretch(*each) for each in zip([options.get("start"), *starts], stops, since, strict=True)]


def warm_up_us(recipe: Recipe) -> int:
    """How long sensors are shown what comes before a part [us], but for whole frames."""
    specs = [mount.sensor.spec for mount in recipe.mounts if isinstance(mount.sensor.spec, DvsSpec)]
    return WARM_US + max(
        round(TIME_CONSTANTS * _slowest_us(spec) + spec.refractory_us + spec.delay_us) for spec in specs
    )


def _slowest_us(spec: DvsSpec) -> float:
    """The sum of a sensor's time constants, in the dark."""
    slower = (1.0 + spec.bandwidth_dark) / spec.bandwidth_dark if spec.bandwidth == "light" else 1.0
    return slower * spec.photoreceptor_tau_us + spec.follower_tau_us


def _looked_at(recipe: Recipe, look: Look | None, cuts: bool) -> tuple[list[int], list[int]]:
    """The times of all frames [ns], and the numbers of those that begin a shot, if asked for."""
    times_ns, shots, before, detector = list[int](), list[int](), None, CutDetector(recipe.threshold)
    for frame in recipe.source.frames():
        if cuts and before is not None and detector.begins_shot(before, frame):
            shots.append(len(times_ns))
        times_ns.append(frame.t_ns)
        before = frame
        if look:
            look(len(times_ns), recipe.source.frames_expected)
    return times_ns, shots


def _ends(times_ns: Sequence[int], after: Sequence[int], options: dict[str, Any]) -> list[Fraction]:
    """The instants in the middle between these frames and the next [s, of the source's own clock]."""
    slowdown = Fraction(str(options.get("slowdown") or 1))
    return [Fraction(times_ns[k] + times_ns[k + 1], 2 * 10**9) * slowdown for k in after]
