"""Row kernels of the frame sensor: take in light, add it up where rows are open, read out what they hold.

Light is float32, rows [H, n] (n = W, or 3 W for red, green, blue side by side); sums are float64, because thousands of
frames may go into one exposure and none of them may be lost in the rounding of the sum.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled
from vid2ev.compiling.intrinsics import fma
from vid2ev.physics.adc import WHITE, code_of
from vid2ev.physics.electrons import shoot
from vid2ev.physics.random import READOUT, fill_words, normal_pair
from vid2ev.stream.still import BRIGHTEST as MOST

F = np.float32
BRIGHTEST = F(MOST)


class ReadOut(NamedTuple):
    """Numbers of the sensor that readout needs."""

    seed: np.uint64
    camera: int
    exposure_gain: float
    random: bool  # whether there is noise of any kind
    electrons: bool  # whether any effect of electrons is on
    white_e: float
    shot_noise: bool
    full_well_e: float  # inf: no limit
    read_noise_e: float
    least: float  # I16 of code 0
    slope: float
    top: float  # the highest code
    noise_lsb: float


@compiled
def take_rows(light, into, signed):
    """Copy light [H, n] into float32 rows, mended: what is no light >= 0 becomes 0, what is above 1e30 becomes 1e30.

    Returns how many values were mended; with `signed` a negative one is a colour that lacks a primary, and not counted.
    """
    mended = np.int64(0)
    least = -BRIGHTEST if signed else F(0.0)
    for y in range(into.shape[0]):
        row, target, bad = light[y], into[y], np.int32(0)
        for i in range(row.size):
            value = F(row[i])
            bad += np.int32(0) if (value >= least) & (value <= BRIGHTEST) else np.int32(1)
            value = value if value > F(0.0) else F(0.0)  # a NaN fails the comparison and becomes 0
            target[i] = value if value < BRIGHTEST else BRIGHTEST
        mended += bad
    return mended


@compiled
def add_rows(total, before, weight_before, after, weight_after):
    """total += weight_before before + weight_after after, by rows; weights float64 [H].  Rows without weight rest."""
    for y in range(total.shape[0]):
        target, w = total[y], weight_before[y]
        if w != 0.0:
            row = before[y]
            for i in range(target.size):
                target[i] = fma(w, np.float64(row[i]), target[i])
        w = weight_after[y]
        if w != 0.0:
            row = after[y]
            for i in range(target.size):
                target[i] = fma(w, np.float64(row[i]), target[i])


@compiled
def read_rows(total, shade, gain, dark, first, tick, num, words, noise, codes, light):
    """Codes uint16 [h, n] of the sums of rows that begin with pixel `first`, in the exposure number `tick`.

    `shade` [h, n], `gain` and `dark` (see physics/fixed_pattern.py) and `light` (float32, to be filled) are empty
    [0, 0] where they are not in use.  The sums are used up.  `words` (uint32 [4, n]) is scratch, and so is `noise`
    (float64 [2, n], zeros).
    """
    n = total.shape[1]
    for y in range(total.shape[0]):
        level = total[y]
        if shade.size > 0:
            for i in range(n):
                level[i] *= np.float64(shade[y, i])
        if light.size > 0:
            for i in range(n):
                light[y, i] = F(level[i])
        if num.random:
            fill_words(words, num.seed, READOUT + 256 * num.camera, first + y * n, tick)
            fill_noise(words[0], words[1], noise[0], noise[1])
        for i in range(n):
            level[i] *= num.exposure_gain
        if num.electrons:
            through_electrons(level, gain, dark, y, words, noise[1], num)
        row = codes[y]
        for i in range(n):
            row[i] = np.uint16(code_of(WHITE * level[i], num.least, num.slope, num.top, num.noise_lsb * noise[0, i]))


@compiled
def fill_noise(high, low, noise, noise_e):
    """Standard normal numbers of two words each: those of the ADC and those of the read noise."""
    for i in range(noise.size):
        noise[i], noise_e[i] = normal_pair(high[i], low[i])


@compiled
def through_electrons(level, gain, dark, y, words, noise_e, num):
    """What is read of row y takes the place of its light, float64 [n]."""
    for i in range(level.size):
        level[i] *= num.white_e
    if gain.size > 0:
        for i in range(level.size):
            level[i] *= np.float64(gain[y, i])
    if num.shot_noise:
        shoot(level, words[2], words[3])
    for i in range(level.size):
        level[i] = (min(level[i], num.full_well_e) + num.read_noise_e * noise_e[i]) / num.white_e
    if dark.size > 0:
        for i in range(level.size):
            level[i] += np.float64(dark[y, i]) / num.white_e
