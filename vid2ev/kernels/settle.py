"""What a pixel starts with, and what it starts with again when the leak is taken into its memory."""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_compiler import inner
from vid2ev.kernels.crossing import AT, LEVEL_ON, fresh_thresholds, leave_levels, load_thresholds
from vid2ev.kernels.layout import HIGH, INPUT, LAG1, LOW, PITCH, last_light, place_of, stride_of
from vid2ev.physics.comparator import initial_phase
from vid2ev.physics.log_curve import log_level, log_level_32


@inner
def settle_pixel(block, light, i, pixel, t_ns, bad, random_phase, planes, flags, num, work):
    """Pixel i of a block of zeros after a long time in this light: no lags, levels about the signal."""
    lane, pixels = work.one_lane, work.one_pixel
    u, level = light, log_level(np.float64(light), num.curve)
    if len(flags.light_bandwidth):
        block[last_light(flags) + i] = u
    if len(flags.log_input):
        u = log_level_32(u, num.curve)
        level = np.float64(u)
    block[INPUT * PITCH + i] = u
    if len(flags.noise):
        block[(LAG1 + len(flags.poles) + 2) * PITCH + i] = level
    pixels[0], pixels[1], lane[AT] = pixel, 0, level
    fresh_thresholds(lane, pixels, pixels[1:], 1, planes, flags, num)
    leave_levels(lane, pixels, 1, planes, flags, num)
    if random_phase:
        phase = initial_phase(num.seed, num.camera, pixel)
        planes.memory[pixel] = level - (1.0 - phase) * (lane[LEVEL_ON] - level)
        load_thresholds(lane, pixels, 1, planes, flags, num)
        leave_levels(lane, pixels, 1, planes, flags, num)
    if len(flags.labels) and len(flags.leak):
        # Nothing but leak has lifted a settled signal above its memory.
        lifted = level - planes.memory[pixel]
        planes.t_reset[pixel] = t_ns - np.int64(lifted / num.leak_nat_per_ns)
    if bad[pixel]:
        block[HIGH * PITCH + i], block[LOW * PITCH + i] = np.inf, -np.inf


@inner
def shift_pixel(pixel, by, planes, flags, num, work):
    """Lower the memory of a pixel by `by` nats."""
    lane, pixels = work.one_lane, work.one_pixel
    pixels[0] = pixel
    planes.memory[pixel] -= by
    if (
        abs(planes.fast[place_of(pixel, stride_of(flags)) + HIGH * PITCH]) < np.inf
    ):  # a bad or a blind pixel keeps its sign
        load_thresholds(lane, pixels, 1, planes, flags, num)
        leave_levels(lane, pixels, 1, planes, flags, num)
