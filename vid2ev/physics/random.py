"""Noise as a function of (seed, camera, effect, pixel, tick): the same draw whoever asks, in whatever order.

The generator is Philox4x32-10 (Salmon, Moraes, Dror, Shaw: *Parallel random numbers: as easy as 1, 2, 3*, SC 2011,
with the rounds and constants of their Random123 library): key = seed, counter = (pixel, tick low, tick high,
effect + 256 * camera).  Nothing is carried from one draw to the next, so chunks, tiles, threads and resumed runs agree.

`tick` is what the effect counts: crossings of the pixel, cells of a fixed clock, steps, or 0 for a frozen map.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inlined
from vid2ev.compiling.intrinsics import floor, fma, sqrt
from vid2ev.physics.elementary import log64

PHASE, MISMATCH, CROSSING, SHOT, HOT, HOT_MAP, PHOTORECEPTOR, RICE, READOUT, FIXED_PATTERN = range(10)

_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = np.uint32(0x9E3779B9), np.uint32(0xBB67AE85)
_2W0, _3W0, _4W0, _5W0 = (np.uint32(n * int(_W0) & 0xFFFFFFFF) for n in (2, 3, 4, 5))
_2W1, _3W1, _4W1, _5W1 = (np.uint32(n * int(_W1) & 0xFFFFFFFF) for n in (2, 3, 4, 5))
_32 = np.uint64(32)
_TO_UNIT = 2.0**-32


@inlined
def _round(c0, c1, c2, c3, k0, k1):
    first, second = np.uint64(c0) * _M0, np.uint64(c2) * _M1
    return (
        np.uint32((second >> _32) ^ c1 ^ k0),
        np.uint32(second),
        np.uint32((first >> _32) ^ c3 ^ k1),
        np.uint32(first),
    )


@inlined
def _five_rounds(c0, c1, c2, c3, k0, k1):
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, np.uint32(k0 + _W0), np.uint32(k1 + _W1))
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, np.uint32(k0 + _2W0), np.uint32(k1 + _2W1))
    c0, c1, c2, c3 = _round(c0, c1, c2, c3, np.uint32(k0 + _3W0), np.uint32(k1 + _3W1))
    return _round(c0, c1, c2, c3, np.uint32(k0 + _4W0), np.uint32(k1 + _4W1))


@inlined
def philox(seed, stream, pixel, tick):
    """Four uint32 words for a seed (uint64), a stream (effect + 256 * camera), a pixel and a tick (int64).

    Without a loop over the rounds, a loop over pixels is vector code.
    """
    k0, k1 = np.uint32(seed), np.uint32(np.uint64(seed) >> _32)
    c1, c2 = np.uint32(tick), np.uint32(np.uint64(tick) >> _32)
    c0, c1, c2, c3 = _five_rounds(np.uint32(pixel), c1, c2, np.uint32(stream), k0, k1)
    return _five_rounds(c0, c1, c2, c3, np.uint32(k0 + _5W0), np.uint32(k1 + _5W1))


@compiled
def fill_words(words, seed, stream, first, tick):
    """The words of `philox` for pixels first, first + 1, ... into words uint32 [4, n]."""
    w0, w1, w2, w3 = words[0], words[1], words[2], words[3]
    for i in range(w0.size):
        w0[i], w1[i], w2[i], w3[i] = philox(seed, stream, first + i, tick)


@inlined
def unit(word):
    """A uint32 word as a float64 in (0, 1), symmetric about 1/2."""
    return (np.float64(word) + 0.5) * _TO_UNIT


@inlined
def normal_pair(first, second):
    """Two independent standard normal numbers from two words (Box and Muller 1958); |z| < 6.8."""
    radius = sqrt(-2.0 * log64(unit(first)))
    quarter = unit(second) * 4.0
    nearest = floor(quarter + 0.5)
    a = (quarter - nearest) * 1.5707963267948966
    z = a * a
    sine = fma(z, fma(z, fma(z, fma(z, 2.7557319e-06, -1.984126984e-04), 8.333333333e-03), -0.16666666666666666), 1.0)
    sine = a * sine
    cosine = fma(z, fma(z, fma(z, 2.48015873e-05, -1.3888888889e-03), 4.1666666666666664e-02), -0.5)
    cosine = fma(z, cosine, 1.0)
    turns = np.int64(nearest) & 3
    x = cosine if turns & 1 == 0 else sine
    y = sine if turns & 1 == 0 else cosine
    x = -x if (turns == 1) | (turns == 2) else x
    y = -y if turns >= 2 else y
    return radius * x, radius * y
