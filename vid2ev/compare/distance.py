"""The distance of van Rossum between two streams of events: pixel by pixel, signed, normalised.

Each event leaves a trace that decays, ON upwards and OFF downwards; the distance is what remains of the traces of A
when those of B are taken away:

    f(t)  = sum of +-exp(-(t - t_i) / tau) over the events i before t
    D2    = (1 / tau) integral (f_A - f_B)^2 dt = 1/2 sum_ij w_i w_j exp(-|t_i - t_j| / tau)
    vR    = 2 sum of D2 over all pixels / (n_A + n_B)

with w = +-1 by polarity, the other way round for B.  Between two events f_A - f_B decays from some M, so each interval
adds M^2 (1 - exp(-2 dt / tau)) / 2: one pass over the events, no two numbers that cancel, and exactly 0 for the same
events.  Events of one pixel at the same microsecond add up first, so their order is of no account.

How to read it: 0 is the same; an event without a counterpart costs half an event on its side, so if a share s of the
events is missing, vR = s / (2 - s); a counterpart dt away costs 1 - exp(-dt / tau); 1 is nothing in common, for events
far apart; more than 1 are bunched events (their traces add up, as rates do), or polarities that are wrong (2).
sqrt(D2) is a metric: symmetric, and it obeys the triangle inequality.

Source: M. C. W. van Rossum (2001), "A novel spike distance", Neural Computation 13, 751-763.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compare.by_pixel import ByPixel
from vid2ev.compiling.cache import cached

TAUS_US = (1000, 100)  # the headline, and a magnifier for small errors of time
_NEVER = np.int64(1 << 62)


def squared_distances(
    a: ByPixel, b: ByPixel, tau_us: float, bins: np.ndarray | None = None, start_us: int = 0, bin_us: float = 1.0
) -> np.ndarray:
    """D2 of each pixel, float64 [P], at the time constant tau_us.

    bins   where given, float64 [2, K]: of what begins in bin k, [start_us + k bin_us, ...), D2 and the number of events
           are added there; the first bin has also what is before it, the last what is after it
    """
    into = np.zeros((2, 1)) if bins is None else bins
    return _distances(a.moments, a.begins, b.moments, b.begins, float(tau_us), into, start_us, 1.0 / bin_us)


@cached
def _distances(a, a_begins, b, b_begins, tau_us, bins, start_us, bins_per_us):  # type: ignore[no-untyped-def]
    pixels = len(a_begins) - 1
    squared = np.zeros(pixels)
    for pixel in range(pixels):
        i, i_stop, j, j_stop = a_begins[pixel], a_begins[pixel + 1], b_begins[pixel], b_begins[pixel + 1]
        trace, now = 0.0, _next_us(a, i, i_stop, b, j, j_stop)
        while now != _NEVER:
            # (whole numbers of events at one instant: A's and B's cancel exactly)
            jump, before = 0, i + j
            while i < i_stop and a[i] >> 1 == now:
                jump += 2 * (a[i] & 1) - 1
                i += 1
            while j < j_stop and b[j] >> 1 == now:
                jump -= 2 * (b[j] & 1) - 1
                j += 1
            trace += jump
            place = min(max(np.int64((now - start_us) * bins_per_us), 0), bins.shape[1] - 1)
            bins[1, place] += i + j - before
            following = _next_us(a, i, i_stop, b, j, j_stop)
            if trace != 0.0:
                left = np.exp((now - following) / tau_us)
                lost = 0.5 * trace * trace * (1.0 - left) * (1.0 + left)
                squared[pixel] += lost
                bins[0, place] += lost
                trace *= left
            now = following
    return squared


@cached
def _next_us(a, i, i_stop, b, j, j_stop):  # type: ignore[no-untyped-def]
    """The instant of the next event of either."""
    return min(a[i] >> 1 if i < i_stop else _NEVER, b[j] >> 1 if j < j_stop else _NEVER)


def normalised(squared: Any, events: int, reference_events: int) -> float:
    """vR of the sum of D2 over all pixels; 0 where neither has an event."""
    return 2.0 * float(squared) / max(events + reference_events, 1)
