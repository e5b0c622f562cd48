"""What the second pole takes from the peaks of a signal behind the first.

Light turns from slope r to -r'.  Behind the first pole the signal has its peak where it is bent by r' / tau1, and the
second lowers that by

    tau2^2 r' / (2 tau1), and more the nearer the poles are: tau2 k r', k = -1 - ln(1 - q) / q,  q = tau2 / tau1
    tau2 r                where r is so much less than r' that the peak is at the bend

so by tau2 k r r' / (r + k r') or a little more: 1.13 times (found by trying all ratios; the tests do so again).

Whatever the ratio of the poles, it is lowered by no more than reach times r + r', or e sqrt(r r') if that is less, with
reach = tau2^2 / (2 tau1), where r << r' by 0.27 sqrt(tau1 / tau2) of that, and <= tau2/e (found alike).

What is left of earlier bends, b, makes r other by as much, and the second pole late by tau2 b q / (1 - q).
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inlined

F = np.float32
MORE = F(1.13)
SLOWEST = F(0.99)  # second pole, in units of the first, for which the first of the laws is tried


@inlined
def second_reach(tau1_s, tau2_s):
    """By how much the second pole rounds off a bend of the slope by 1, at most [s] (float32)."""
    ratio = tau2_s / max(tau1_s, F(1e-30))
    smoothed_s = F(0.5) * tau2_s * ratio * max(F(1.0), F(0.27) / np.sqrt(max(ratio, F(1e-30))))
    return min(smoothed_s, F(0.36787945) * tau2_s)


@inlined
def taken(before, after, left, tau1_s, tau2_s):
    """By how much the second pole lowers the peak [nat] of light that goes by `before`, then back by `after`, with
    `left` of the bends before [nat/s, float32, >= 0]."""
    reach_s, ratio = second_reach(tau1_s, tau2_s), tau2_s / max(tau1_s, F(1e-30))
    turned = min(before + after, F(2.7182818) * np.sqrt(before * after))
    anyway = reach_s * (left + turned)
    if ratio > SLOWEST:
        return anyway
    k = ratio * (F(0.5) + ratio * (F(1.0 / 3.0) + F(0.25) * ratio / (F(1.0) - ratio)))
    slope = before + left
    meet = slope * k * after / max(slope + k * after, F(1e-30))
    late = left * ratio / (F(1.0) - ratio)
    return min(anyway, tau2_s * (MORE * meet + late))
