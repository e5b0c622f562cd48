"""Which event of A is which event of B: at most one each, at the same pixel, in the order of time.

Of all ways to pair the events of one pixel and polarity, that with the least

    cost = sum of |t_A - t_B| over the pairs + window / 2 for each event without a partner

is taken (the distance of Victor and Purpura at 2 / window per microsecond).  Partners are less than a window apart, and
an event that is missing does not shift those after it, as it does where the next free event is taken.

The cheapest way is found in one pass.  Let k be how many events of A wait for a partner, negative where those of B do,
and f(k) the least cost so far.  Time passes: f(k) += |k| dt.  An event of A:

    f(k) <- min(f(k - 1), f(k) + window / 2)

and the same with k + 1 for B.  f stays convex: the event puts a slope of -window / 2 (+window / 2 for B) in its place
among the slopes of f.  Slopes right of k = 0 rise with time and fall left of it, so what comes new always goes to the
end next to k = 0 of two stacks, and what has reached the window at the other end never matters again.  How many slopes
are left of those, noted for each event, leads back from k = 0 at the end to the events that have partners.  All numbers
are whole, in half microseconds.

Events that remain are paired the same way with those of the other polarity: these are errors of polarity.  Where events
are dense, chance finds partners, too, and near ones: read their share and errors beside the distance, never alone.

Source: J. D. Victor, K. P. Purpura (1997), "Metric-space analysis of spike trains", Network 8, 127-164.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vid2ev.compare.by_pixel import ByPixel
from vid2ev.compiling.cache import cached

WINDOW_US = 5000


@dataclass(frozen=True, slots=True)
class Matches:
    """What was found.

    errors            int64 [2 window_us - 1]: how many pairs have t_A - t_B = k - (window_us - 1) microseconds
    polarity_errors   pairs of opposite polarity, of events without a partner of their own
    """

    errors: np.ndarray
    polarity_errors: int


def match(a: ByPixel, b: ByPixel, window_us: int = WINDOW_US) -> Matches:
    """Pair the events of A with those of B; partners are less than window_us >= 1 apart."""
    errors = np.zeros(2 * window_us - 1, np.int64)
    most = [int(side.counts.max(initial=0)) for side in (a, b)]
    polarity_errors = _match(a.moments, a.begins, b.moments, b.begins, window_us, errors, *most)
    return Matches(errors, int(polarity_errors))


@cached
def _pair(a, b, a_many, b_many, window, a_kept, b_kept, scratch):  # type: ignore[no-untyped-def]
    """Mark the events that have partners: a[:a_many] and b[:b_many] are times [us], ascending."""
    live, right, left = scratch[0], scratch[1], scratch[2]
    # The slopes right of k = 0 are right[r0:r1] + 2 t, those left of it left[l0:l1] - 2 t; the last is next to k = 0.
    r0 = r1 = l0 = l1 = i = j = 0
    while i < a_many or j < b_many:
        if j == b_many or (i < a_many and a[i] <= b[j]):
            t = 2 * a[i]
            while l0 < l1 and left[l0] - t <= -window:
                l0 += 1
            live[i + j] = l1 - l0
            slope = -window
            if l0 < l1:
                l1 -= 1
                slope = left[l1] - t
            right[r1] = slope - t
            r1 += 1
            i += 1
        else:
            t = 2 * b[j]
            while r0 < r1 and right[r0] + t >= window:
                r0 += 1
            live[i + j] = r1 - r0
            slope = window
            if r0 < r1:
                r1 -= 1
                slope = right[r1] + t
            left[l1] = slope + t
            l1 += 1
            j += 1
    k = 0
    while i > 0 or j > 0:
        if j == 0 or (i > 0 and a[i - 1] > b[j - 1]):
            i -= 1
            a_kept[i] = k > -live[i + j]
            k -= a_kept[i]
        else:
            j -= 1
            b_kept[j] = k < live[i + j]
            k += b_kept[j]


@cached
def _match(a, a_begins, b, b_begins, window, errors, a_most, b_most):  # type: ignore[no-untyped-def]
    a_us, b_us = np.empty((2, a_most), np.int64), np.empty((2, b_most), np.int64)
    a_kept, b_kept = np.empty(a_most, np.bool_), np.empty(b_most, np.bool_)
    scratch = np.empty((3, a_most + b_most), np.int64)
    a_many, b_many = np.empty(2, np.int64), np.empty(2, np.int64)
    polarity_errors = 0
    for pixel in range(len(a_begins) - 1):
        _by_polarity(a[a_begins[pixel] : a_begins[pixel + 1]], a_us, a_many)
        _by_polarity(b[b_begins[pixel] : b_begins[pixel + 1]], b_us, b_many)
        for p in range(2):
            if a_many[p] and b_many[p]:
                _pair(a_us[p], b_us[p], a_many[p], b_many[p], window, a_kept, b_kept, scratch)
                _note(a_us[p], b_us[p], a_many[p], a_kept, b_kept, errors)
                a_many[p] = _leave(a_us[p], a_many[p], a_kept)
                b_many[p] = _leave(b_us[p], b_many[p], b_kept)
        for p in range(2):
            if a_many[p] and b_many[1 - p]:
                _pair(a_us[p], b_us[1 - p], a_many[p], b_many[1 - p], window, a_kept, b_kept, scratch)
                polarity_errors += a_kept[: a_many[p]].sum()
    return polarity_errors


@cached
def _by_polarity(moments, times, many):  # type: ignore[no-untyped-def]
    """The times of OFF and ON events, each for itself."""
    many[:] = 0
    for moment in moments:
        p = moment & 1
        times[p, many[p]] = moment >> 1
        many[p] += 1


@cached
def _note(a, b, a_many, a_kept, b_kept, errors):  # type: ignore[no-untyped-def]
    """Count the errors of time of the pairs."""
    zero, j = len(errors) // 2, 0
    for i in range(a_many):
        if a_kept[i]:
            while not b_kept[j]:
                j += 1
            errors[zero + a[i] - b[j]] += 1
            j += 1


@cached
def _leave(times, many, kept):  # type: ignore[no-untyped-def]
    """Take the events that have partners out of the others, and return how many are left."""
    left = 0
    for i in range(many):
        if not kept[i]:
            times[left] = times[i]
            left += 1
    return left
