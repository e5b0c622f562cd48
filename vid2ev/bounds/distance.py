"""Bounds on the distance of two recordings, from what was measured of a scene; the theory is that of `scene.py`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vid2ev.bounds.scene import DISTANCE_TAU_S, QUARTER_EDGES, Scene

EVEN = 0.54  # integral e^2 of what a bend leaves of e, at most, in units of its greatest times its integral
PIXELS_DIFFER = 4.0  # how much more than the mean of its tile a pixel's signals may differ for, where that counts


class Left(NamedTuple):
    """What a bend by r leaves in memories that jump to the signal (`Scene`).

    variance_s2, reach_s   of the delay of the poles that are left out, where the events are
    by_light_s2            r slope by_light_s2 / theta more, as the delay changes with light
    """

    variance_s2: float
    reach_s: float
    by_light_s2: float


def off_by(
    scene: Scene,
    error_nat: np.ndarray,
    *,
    echoes: bool,
    one_way: bool = False,
    levels: float | None = None,
    parts: tuple[np.ndarray | float, np.ndarray | float] = (1.0, 1.0),
) -> float:
    """Bound on the mean distance where the comparator's input is off by up to error_nat [tiles]; one_way if it is
    never above in one place and below in another, for then the sign of N is the same everywhere.

    levels   how many can be between the two signals, for each that is on average
    parts    of the error, what there is of it while pixels are pushed, and as they turn, on average
    """
    if scene.still:
        return 0.0
    many = 1.0 + np.floor(error_nat / scene.threshold) if levels is None else levels
    sides = 1.0 if one_way else _sides(error_nat / scene.threshold)
    while_pushed, at_turns = parts
    change = sides * many * error_nat * (while_pushed * scene.pushed_s / DISTANCE_TAU_S + at_turns * scene.turns)
    change = np.minimum(change, 4.0 * many**2 * scene.travel)  # (each stretch begins with an event of either)
    if echoes:
        return float(change.sum() / scene.travel.sum()) + _echo(scene, scene.by_turns, float(error_nat.max()))
    return float(change.sum() / scene.travel.sum())


def _sides(share: np.ndarray) -> np.ndarray:
    """By how much stretches of either sign cost more than each by itself, where there is one for such a share of the
    time: a stretch and one of the other sign that is a time t away share at most exp(-t/tau) of the shorter, so all
    that are near it add up to twice their share, and never to more than itself."""
    return 1.0 + np.minimum(2.0 * share, 1.0)


def delayed(
    scene: Scene,
    variance_s2: np.ndarray,
    frozen_nat: np.ndarray,
    after_turns: np.ndarray,
    *,
    steep_nat_s: float = 0.0,
    steep_nat: float = 0.0,
    left: Left | None = None,
) -> float:
    """Bound on the mean distance where a low-pass gives way to its mean delay.

    A bend of the slope by r is rounded off: the area between the two signals is r variance / 2.  At turns they differ
    by frozen_nat, the sum of each tile; after_turns [2, quarters] is the travel that counts by the sum of that before
    it, none where recordings that disagree go on alike.  Where several levels are between the two signals, their number
    counts squared: steep_nat_s and steep_nat are what that adds to all areas and to what is frozen (`steeper`).  Where
    memories jump to the signal, a bend leaves something in them (`Left`).
    """
    if scene.still:
        return 0.0
    area = 0.5 * variance_s2 * scene.bend
    often = (area / np.maximum(scene.pushed_s, 1e-30) + frozen_nat / np.maximum(scene.turns, 1.0)) / scene.threshold
    change = _sides(PIXELS_DIFFER * often) * (area / DISTANCE_TAU_S + frozen_nat)
    steep = 2.0 * (steep_nat_s / DISTANCE_TAU_S + steep_nat)
    mean = (float(change.sum()) + steep) / float(scene.travel.sum()) + _echo(scene, after_turns, 1.0)
    return mean if left is None else mean + _stirred(scene, left)


def steeper(felt: np.ndarray, share: float) -> float:
    """What it adds to a sum of bends [nat/s] that there are several levels between two signals, where these are a share
    as far apart as `Scene.by_felt` or `by_felt_at_turns` says.

    Of x levels on average, at a phase that is even, there are floor(x) or one more: squared x + x^2 - x + 1/4 at most.
    """
    levels = share * QUARTER_EDGES[1:]
    return float(np.dot(felt[0], np.where(levels > 1.0, np.minimum(levels - 0.75, np.floor(levels)), 0.0)))


def later(scene: Scene, late_s: float, levels: np.ndarray) -> float:
    """Bound on the mean distance where events are early or late, by so much on average; so many levels are between the
    two signals in a tile, for each that is on average."""
    if scene.still:
        return 0.0
    often = late_s * float(scene.travel.sum()) / max(float(scene.pushed_s.sum()) * scene.threshold, 1e-30)
    many = min(float(np.dot(levels, scene.travel) / scene.travel.sum()), scene.bunched)
    return float(_sides(np.array(PIXELS_DIFFER * often))) * many * late_s / DISTANCE_TAU_S


def _stirred(scene: Scene, left: Left) -> float:
    """What bends have left in memories: events at other times, others at turns, and those after them."""
    stirs = scene.by_stirs, scene.by_stirs_at_turns, scene.by_stirs_before
    strays = scene.by_strays, scene.by_strays_at_turns, scene.by_strays_before
    poles = _moved(scene, *stirs, left.variance_s2 * 1e6)
    poles = min(poles, _moved(scene, *strays, 1e3 * math.sqrt(1e3 * EVEN * left.variance_s2 * left.reach_s)))
    return poles + _moved(scene, *stirs, left.by_light_s2 * 1e6)


def _moved(scene: Scene, apart: np.ndarray, turns: np.ndarray, before: np.ndarray, nat: float) -> float:
    """What it costs that memories are moved by so many nats for each number, of travel, at turns, and before it."""
    number, numbers = turns
    share = numbers / np.maximum(number, 1e-300) * (nat / scene.threshold)  # of a cycle, in each quarter
    sides = float(np.dot(_sides(share), numbers)) / max(float(numbers.sum()), 1e-300)
    at_times = _echo(scene, apart, nat * scene.threshold / DISTANCE_TAU_S)
    return sides * (at_times + _echo(scene, turns, nat)) + _echo(scene, before, nat)


def unlike(scene: Scene, by_itself: float, lag_s: np.ndarray | float = math.inf) -> float:
    """Bound on the mean distance whatever becomes of the levels, and of the times where signals are no further apart
    than by lag_s, of all tiles or of each.  So great is D of each recording by itself, for each half of an event.

    While both signals go one way, all events of both are of one sign, so D is at most that of either by itself, and of
    one: what an event has near it, of its own recording or of the other, is what is dense there.  Only where they
    turn are events of both signs near each other.
    """
    if scene.still:
        return 0.0
    turning = np.minimum(np.multiply(lag_s, np.maximum(scene.bend_at_turns, 1e-30)), scene.travel)
    return (1.0 + float(turning.sum() / scene.travel.sum())) * by_itself


def _echo(scene: Scene, spread: np.ndarray, per_number_nat: float) -> float:
    """The share of the events that come after a disagreement in their pixel: no more than all of them."""
    return float(np.minimum(spread[0], spread[1] * per_number_nat / scene.threshold).sum() / scene.travel.sum())


def bare(scene: Scene, *, echoes: bool) -> float:
    """Bound on the mean distance where the light is without the lens shading."""
    if not scene.travel.any() and not scene.bare_travel.any():
        return 0.0
    mean_travel = 0.5 * float(scene.travel.sum() + scene.bare_travel.sum())
    often = scene.bare_apart / np.maximum(scene.pushed_s, 1e-30) + scene.bare_frozen / np.maximum(scene.turns, 1.0)
    change = _sides(PIXELS_DIFFER * often / scene.threshold) * (scene.bare_apart / DISTANCE_TAU_S + scene.bare_frozen)
    echo = _echo(scene, scene.by_bare, 1.0) if echoes and not scene.still else 0.0
    return float(np.minimum(change, 4.0 * (scene.travel + scene.bare_travel)).sum() / mean_travel) + echo


def elsewhere(scene: Scene) -> float:
    """What it costs an event, on average, if all levels are others."""
    return float(scene.by_turns[0].sum() / scene.travel.sum()) if not scene.still else 0.0


def added(events: float, extra: float, touched: float) -> float:
    """Bound on the distance where up to `extra` events of noise [number] come or go beside at least so many others, and
    up to a share `touched` of these comes after one of them in its pixel, and so from other levels."""
    return touched + extra / (2.0 * events + extra) if extra > 0.0 else 0.0


def together(*distances: float) -> float:
    """Bound on the distance of several changes made together: its root obeys the triangle inequality."""
    return sum(math.sqrt(distance) for distance in distances) ** 2
