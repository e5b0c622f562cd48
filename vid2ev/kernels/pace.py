"""How fast the signals of pixels go that are pushed.

Behind one pole a signal is its light less `smooth_s` times the smoothed slope, exactly; that slope goes from what it
was to the light's.  Of a short way the greatest slope is taken; a long one is cut into steps.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.bunched import sent_near
from vid2ev.kernels.layout import PITCH
from vid2ev.kernels.measured import (
    AT_HALF,
    AT_LEVEL,
    AT_LIGHT,
    AT_LIT,
    AT_PLAY,
    AT_SLOPE,
    AT_SMOOTH,
    BY_LIGHT,
    BY_SLOPE,
    DIMMEST,
    FROM,
    GONE,
    LIGHT,
    LIT,
    LOST,
    MOVED,
    PUSHED,
    SHARE,
    SLOPE,
    SMOOTHED,
    STEEP,
    TOOK,
    left_of,
    note,
    note_both,
)
from vid2ev.physics.elementary import expm1_32, log32
from vid2ev.physics.log_curve import light_per_nat_32

F = np.float32
STEP_NAT = 0.1  # what goes no further than this is taken at its greatest slope
MOST_STEPS = 64


@inner
def push(count, curve, num, lanes):
    """How far and which way each is pushed, and what follows from that if it is not far."""
    mean = F(num.half)
    blind = F(num.blind_s / (num.dt_s * 2.0 * num.half))
    for k in range(count):
        level, play, half = lanes[AT_LEVEL + k], lanes[AT_PLAY + k], lanes[AT_HALF + k]
        weight = mean / half
        pushed = F(level - half > play) - F(level + half < play)
        gone = abs(level - lanes[FROM + k])
        moved = abs(level - pushed * half - play) if pushed != F(0.0) else F(0.0)
        share = min(moved / max(gone, F(1e-30)), F(1.0))
        lanes[TOOK + k] = share
        if len(num.tracks):
            sent = F(1.0) / (F(1.0) + gone * blind * weight)  # (events are theta + the blind time's way apart)
            moved, share = moved * sent, share * sent
        moved, share = moved * weight, share * weight
        lanes[PUSHED + k], lanes[MOVED + k], lanes[GONE + k] = pushed, moved, gone
        lanes[SHARE + k], lanes[LOST + k] = share, moved * apart(gone, half, num)
        slope, fast0, lit, light = lanes[AT_SLOPE + k], lanes[AT_SMOOTH + k], lanes[AT_LIT + k], lanes[AT_LIGHT + k]
        fast = slope + (fast0 - slope) * F(num.kept)
        near0, near = near_at(lit, fast0, curve, num), near_at(light, fast, curve, num)
        dimmest = min(lit, light)
        lanes[STEEP + k], lanes[DIMMEST + k] = steepest(fast0, near0, fast, near, dimmest, curve, num), dimmest


@inner
def near_at(light, fast, curve, num):
    """What a slope is divided by to be one of the level, where the bare light and the smoothed slope are these."""
    return light_per_nat_32(smoothed(light, fast, num), curve) if num.before_log else F(1.0)


@inner
def smoothed(light, fast, num):
    """The light behind the pole, where the bare light and the smoothed slope are these."""
    return max(light - F(num.smooth_s) * fast, F(0.0))


@inner
def steepest(fast0, near0, fast, near, dimmest, curve, num):
    """The greatest slope of the level [nat/s] between two instants: smoothed slopes and light go one way; where the
    smoothed light turns in between, it is no darker than the bare light."""
    darkest = min(near0, near)
    if num.before_log:
        turning = min(darkest, light_per_nat_32(dimmest, curve))
        darkest = turning if (fast0 < F(0.0)) & (fast > F(0.0)) else darkest
    return max(abs(fast0), abs(fast)) / darkest


@inner
def apart(gone, half, num):
    """What two events that should be one cost at most, if between them there is a share of the gap from event to event
    and the rest to the next: 1 - exp(-gap / (2 tau)), at the least slope of an interval that goes so many nats."""
    slope = max(-expm1_32(-gone) / F(num.dt_s), F(1e-12))
    return -expm1_32(F(-0.5 / num.tau_s) * ((half + half) / slope + F(num.blind_s)))


@inner
def paced(i, pushed, moved, gone, took_s, curve, num, own, spread, scratch):
    """Spread a long travel over the slopes of the smoothed signal in the interval, each as much as it goes at them: in
    steps in each of which the bare light goes as many nats; its events come within a time."""
    slope, old, new = own[SLOPE * PITCH + i], scratch[LIT + i], own[LIGHT * PITCH + i]
    count = np.int64(min(gone / F(STEP_NAT), F(MOST_STEPS))) + 1
    per0, per1 = light_per_nat_32(old, curve), light_per_nat_32(new, curve)
    even = (num.before_log == False) | (abs(per1 - per0) < F(1e-3) * per0)  # noqa: E712
    times = F(1.0) + expm1_32(log32(per1 / per0) / F(count))
    whole = F(1e-30)
    for turn in range(2):
        fast0, light0, per = scratch[SMOOTHED + i], old, per0
        lit0, near0, share0 = smoothed(old, fast0, num), near_at(old, fast0, curve, num), F(0.0)
        for step in range(1, count + 1):
            per *= times
            share = F(step) / F(count) if even else (per - per0) / (per1 - per0)
            fast = faster(share * F(num.dt_s), scratch[SMOOTHED + i], slope, num)
            light = max(old + share * (new - old), F(0.0))
            lit, near = smoothed(light, fast, num), near_at(light, fast, curve, num)
            way = abs(lit - lit0) / (near + near0) if num.before_log else abs(fast0) + abs(fast)
            if turn == 0:
                whole += way
            else:
                part, dimmest = moved * way / whole, min(light, light0)
                steep = steepest(fast0, near0, fast, near, dimmest, curve, num)
                near_it = sent_near(i, pushed, part, (share - share0) * took_s, num, own, scratch)
                note_both(spread, BY_SLOPE, steep, part, near_it)
                note(spread, BY_LIGHT, dimmest, part)
            fast0, light0, lit0, near0, share0 = fast, light, lit, near, share


@inner
def faster(t_s, fast0, slope, num):
    """The smoothed slope so long after the last frame."""
    if t_s > F(16.0) * F(num.smooth_s):
        return slope
    return slope + (fast0 - slope) * left_of(t_s, F(num.smooth_s))
