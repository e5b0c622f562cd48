"""What pixels start with, and what they start with again when the leak is taken into their memories."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.crossing import AT, LEVEL_ON, WHEN, fresh_thresholds, leave_levels, load_thresholds
from vid2ev.kernels.layout import HIGH, INPUT, LOW, PITCH, last_light, last_seen, place_of, stride_of
from vid2ev.physics.comparator import initial_phase
from vid2ev.physics.log_curve import log_level, log_level_32


@inner
def settle_lanes(block, light, first, count, p0, t_ns, bad, random_phase, planes, flags, num, work):
    """Pixels first ... first + count - 1 of a block of zeros, at most LANE_COUNT, after a long time in their light
    [count]: no lags, levels about the signal."""
    lanes, pixels, own, p1 = work.lanes, work.pixels, block[first:], p0 + first
    inputs = own[INPUT * PITCH : INPUT * PITCH + count]
    see_signals(own, inputs, light, lanes, count, flags, num)
    for j in range(count):
        pixels[j], work.live[j] = p1 + j, j
    fresh_thresholds(lanes, pixels, work.live, count, planes, flags, num)
    if random_phase:
        for j in range(count):
            level = lanes[AT + j]
            on = level + lanes[LEVEL_ON + j]
            lanes[AT + j] = level - (1.0 - initial_phase(num.seed, num.camera, p1 + j)) * (on - level)
    if len(flags.labels) and len(flags.leak):
        # Nothing but leak has lifted a settled signal above its memory.
        for j in range(count):
            planes.t_reset[p1 + j] = t_ns - np.int64((lanes[WHEN + j] - lanes[AT + j]) / num.leak_nat_per_ns)
    leave_levels(lanes, pixels, count, planes, flags, num)
    for j in range(count):
        if bad[p1 + j]:
            own[HIGH * PITCH + j], own[LOW * PITCH + j] = np.inf, -np.inf


@inner
def see_signals(own, inputs, light, lanes, count, flags, num):
    """The inputs of the filter into the state, and the signals [nat] into AT and WHEN."""
    if len(flags.log_input):
        for j in range(count):
            inputs[j] = log_level_32(light[j], num.curve)
            lanes[AT + j] = np.float64(inputs[j])
    else:
        for j in range(count):
            inputs[j] = light[j]
            lanes[AT + j] = log_level(np.float64(light[j]), num.curve)
    for j in range(count):
        lanes[WHEN + j] = lanes[AT + j]
    if len(flags.light_bandwidth):
        for j in range(count):
            own[last_light(flags) + j] = light[j]
    if len(flags.noise):
        for j in range(count):
            own[last_seen(flags) + j] = lanes[AT + j]


@inner
def shift_pixel(pixel, by, planes, flags, num, work):
    """Lower the memory of a pixel by `by` nats."""
    lane, pixels, place = work.one_lane, work.one_pixel, place_of(pixel, stride_of(flags))
    pixels[0] = pixel
    planes.memory[pixel] -= by
    if len(flags.noise):
        planes.fast[place + last_seen(flags)] -= np.float32(by)
    if abs(planes.fast[place + HIGH * PITCH]) < np.inf:  # a bad or a blind pixel keeps its sign
        load_thresholds(lane, pixels, 1, planes, flags, num)
        leave_levels(lane, pixels, 1, planes, flags, num)
