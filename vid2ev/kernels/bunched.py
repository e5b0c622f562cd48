"""How near to each other the events of a pixel come: those of one recording are counted (`vid2ev.bounds.scene`).

The levels of a pixel are a threshold apart from a phase on, so the play sends an event where it crosses one.  While it
is pushed they follow each other evenly, a gap g apart.  Of n of them, the first of which comes upon a trace T of those
before, what all come upon adds up to

    T s + (n - s) q / (1 - q)        q = exp(-g / tau),  s = (1 - q^n) / (1 - q)

and T q^(n-1) + s is left at the last.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import PITCH
from vid2ev.kernels.measured import PHASE, TRACED
from vid2ev.physics.elementary import exp64

F = np.float32
AT_ONCE = 1e-6  # gaps, in units of tau, that are none
GONE_BY = F(1e-6)  # what is left of a trace that is none
BELOW_1 = F(0.99999994)


@inner
def left(trace, took_s, num):
    """What is left of a trace after a time."""
    return F(trace * exp64(-np.float64(took_s) / num.tau_s)) if trace > GONE_BY else F(0.0)


@inner
def sent_near(i, pushed, moved, took_s, num, own, scratch):
    """Push a pixel one way, for a time, so that it travels `moved`; returns twice what its events come upon, in units
    of travel [nat]."""
    per_event = 2.0 * num.half
    events, phase = np.float64(moved) / per_event, np.float64(own[PHASE * PITCH + i])
    at = phase + (events if pushed > F(0.0) else -events)
    number = abs(np.floor(at))
    own[PHASE * PITCH + i] = min(F(at - np.floor(at)), BELOW_1)
    if number < 1.0:
        scratch[TRACED + i] = left(scratch[TRACED + i], took_s, num)
        return 0.0
    gap_s = np.float64(took_s) / events
    ahead_s = gap_s * ((1.0 - phase) if pushed > F(0.0) else phase)
    trace = np.float64(left(scratch[TRACED + i], ahead_s, num))
    found, last = trace, trace + 1.0
    if number > 1.0:
        together, among, kept = number, 0.5 * number * (number - 1.0), exp64(-gap_s / num.tau_s)
        if gap_s > AT_ONCE * num.tau_s:
            together = (1.0 - exp64(-gap_s * number / num.tau_s)) / (1.0 - kept)
            among = (number - together) * kept / (1.0 - kept)
        found = trace * together + among
        last = trace * exp64(-gap_s * (number - 1.0) / num.tau_s) + together
    rest_s = max(np.float64(took_s) - ahead_s - gap_s * (number - 1.0), 0.0)
    scratch[TRACED + i] = left(F(last), rest_s, num)
    return 2.0 * per_event * found
