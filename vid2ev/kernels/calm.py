"""The light of a block as it arrives, and the strips of it in which nothing happens.

A strip of 256 pixels is **calm** after an interval in which its light kept all its bits: its slopes are 0 and nothing
in it is pushed.  While it goes on like that it is left alone: bends and smoothed slopes only decay, for a time and by
factors that are kept for the strip and `owed` to its pixels until its light changes.  What whoever makes frames knows
(`vid2ev.stream.still`) is not looked for.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import BLOCK, PITCH, STRIP
from vid2ev.kernels.light import BRIGHTEST
from vid2ev.kernels.measured import BEHIND, BENDS, LEVEL, LIGHT, SEEN, SMOOTH, TRACE, first_tau, left_of

F = np.float32
STRIPS = BLOCK // STRIP
CHANGES, CALM, LEFT = range(3)  # a strip's light has changed; it has not; nor the time before, and the strip is owed


@inner
def arriving(light):
    """Light as the sensor takes it: what is no number or negative is none."""
    light = light if light > F(0.0) else F(0.0)
    return light if light < BRIGHTEST else BRIGHTEST


@inner
def take(light, shade, scratch):
    """Light into scratch, behind the lens shading if there is some."""
    for i in range(light.size):
        scratch[SEEN + i] = arriving(light[i])
    for i in range(shade.size):
        scratch[SEEN + i] = scratch[SEEN + i] * shade[i]


@inner
def rest(light, told, shade, num, own, scratch, calm, owed):
    """Light of a block into scratch, of the strips that cannot be left alone; these get what they are owed.  Returns
    whether there are others.  told [strips or none]: those that are known to be still."""
    left = False
    for strip in range((light.size + STRIP - 1) // STRIP):
        begin = strip * STRIP
        end = min(begin + STRIP, light.size)
        same = told.size > 0 and told[strip] != 0
        if not same or calm[strip] == CHANGES:
            take(light[begin:end], shade[min(begin, shade.size) : min(end, shade.size)], scratch[begin:])
            same = same or is_same(own, scratch, begin, end - begin)
        if same and calm[strip] != CHANGES:
            calm[strip], left = LEFT, True
            owed[strip, 0] += F(num.dt_s)
            owed[strip, 1] *= F(num.kept)
            continue
        if calm[strip] == LEFT:
            give(own[begin:], owed[strip], num)
        calm[strip] = CALM if same else CHANGES
    return left


@inner
def give(own, owed, num):
    """What the pixels of a strip are owed."""
    left1, left2 = left_of(owed[0], F(num.tau1_s)), left_of(owed[0], F(num.tau2_s))
    traced = left_of(owed[0], F(num.tau_s))
    for i in range(STRIP):
        if len(num.by_light):
            left1 = left_of(owed[0], first_tau(own[LIGHT * PITCH + i], num))
        here = own[LIGHT * PITCH + i] if num.before_log else own[LEVEL * PITCH + i]
        own[BEHIND * PITCH + i] = here + (own[BEHIND * PITCH + i] - here) * left1
        own[BENDS * PITCH + i] *= max(left1, left2)
        own[SMOOTH * PITCH + i] *= owed[1]
        own[TRACE * PITCH + i] *= traced
    owed[0], owed[1] = F(0.0), F(1.0)


@inner
def is_same(own, scratch, begin, n):
    """Whether n pixels have the light that they had."""
    differ = np.uint32(0)
    for i in range(n):
        at = np.uintp(begin) + np.uintp(i)  # (unsigned: otherwise it may be negative, and does not vectorise)
        differ = np.uint32(differ | np.uint32(own[np.uintp(LIGHT * PITCH) + at] != scratch[np.uintp(SEEN) + at]))
    return differ == 0


@inner
def next_run(first, n, calm):
    """The next pixels that are not left alone, from `first` on: (the first of them, the one after the last)."""
    while first < n and calm[first // STRIP] == LEFT:
        first += STRIP
    last = first
    while last < n and calm[last // STRIP] != LEFT:
        last += STRIP
    return min(first, n), min(max(last, first), n)
