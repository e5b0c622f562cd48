"""Levels are reached: memories move, thresholds are drawn, events are sent unless a pixel is refractory.

Every slow path ends here, so there is one text of what a crossing does.  Pixels are lanes of a few planes, worked on in
loops that vectorise.  An event is a 64-bit key,

    microseconds after the interval's first_us << 28 | pixel << 3 | polarity << 2 | label
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import HIGH, LANE_PITCH, LOW, PITCH, SWALLOWED, lane, place_of, stride_of
from vid2ev.kernels.scan import MARGIN, compared
from vid2ev.kernels.sink import put, room
from vid2ev.physics.crossing_noise import noisy_thresholds
from vid2ev.physics.thresholds import FLOOR

SIGNAL, SHOT, LEAK, HOT = range(4)

# Planes of the lanes that all slow paths share: memory [nat], thresholds (later levels) [nat], the levels as the scan
# compares them; label, direction and time (fraction of the interval) of a crossing; what a draw of thresholds needs.
AT, LEVEL_ON, LEVEL_OFF, SCAN_ON, SCAN_OFF, LABEL, UP, WHEN = (k * LANE_PITCH for k in range(8))
DRAWN_ON, DRAWN_OFF, DRAWN_FOR, DRAWN_AT = ((8 + k) * LANE_PITCH for k in range(4))
FREE = 12 * LANE_PITCH


@inner
def load_thresholds(lanes, pixels, count, planes, flags, num):
    """Memories [nat] into AT, thresholds [nat] into LEVEL_ON and LEVEL_OFF."""
    memory = planes.memory
    for j in range(count):
        lanes[AT + j] = memory[pixels[j]]
    if len(flags.crossing_noise) > 0 or num.mismatch > 0.0:
        theta = planes.drawn if len(flags.crossing_noise) else planes.theta
        for j in range(count):
            lanes[LEVEL_ON + j] = theta[pixels[j], 0]
            lanes[LEVEL_OFF + j] = theta[pixels[j], 1]
    else:
        for j in range(count):
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = num.threshold_on, num.threshold_off


@inner
def least_threshold(pixel, theta, flags, num):
    """What no threshold of a pixel is below, whatever is drawn [nat]."""
    least = min(num.threshold_on, num.threshold_off)
    if num.mismatch > 0.0:
        least = np.float64(min(theta[pixel, 0], theta[pixel, 1]))
    return FLOOR * least if len(flags.crossing_noise) else least


@inner
def thresholds_to_levels(lanes, count, flags, num):
    """From memories and thresholds to levels [nat], and to those that the scan compares."""
    for j in range(count):
        lanes[LEVEL_ON + j] = lanes[AT + j] + lanes[LEVEL_ON + j]
        lanes[LEVEL_OFF + j] = lanes[AT + j] - lanes[LEVEL_OFF + j]
    compared(lanes[SCAN_ON:], lanes[LEVEL_ON:], -MARGIN, count, flags, num)
    compared(lanes[SCAN_OFF:], lanes[LEVEL_OFF:], MARGIN, count, flags, num)


@inner
def fresh_thresholds(lanes, pixels, live, alive, planes, flags, num):
    """Thresholds [nat] of the lanes live[:alive], which have just crossed, into LEVEL_ON and LEVEL_OFF."""
    theta, drawn, crossings = planes.theta, planes.drawn, planes.count
    for k in range(alive):
        j = lane(live[k])
        lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = num.threshold_on, num.threshold_off
        if num.mismatch > 0.0:
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = theta[pixels[j], 0], theta[pixels[j], 1]
    if len(flags.crossing_noise):
        for k in range(alive):
            j = lane(live[k])
            pixel = pixels[j]
            lanes[DRAWN_ON + k], lanes[DRAWN_OFF + k] = lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j]
            lanes[DRAWN_FOR + k], lanes[DRAWN_AT + k] = pixel, crossings[pixel]
            crossings[pixel] += np.uint32(1)
        for k in range(alive):
            lanes[DRAWN_ON + k], lanes[DRAWN_OFF + k] = noisy_thresholds(
                lanes[DRAWN_ON + k],
                lanes[DRAWN_OFF + k],
                num.crossing_noise,
                num.seed,
                num.camera,
                np.int64(lanes[DRAWN_FOR + k]),
                np.int64(lanes[DRAWN_AT + k]),
            )
        for k in range(alive):  # the rounded thresholds are the thresholds, now and when they are read back
            j = lane(live[k])
            pixel = pixels[j]
            drawn[pixel, 0], drawn[pixel, 1] = lanes[DRAWN_ON + k], lanes[DRAWN_OFF + k]
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = drawn[pixel, 0], drawn[pixel, 1]


@inner
def leave_levels(lanes, pixels, count, planes, flags, num):
    """Memories AT and thresholds to levels, in the lanes and in the state."""
    memory, fast, stride = planes.memory, planes.fast, stride_of(flags)
    thresholds_to_levels(lanes, count, flags, num)
    for j in range(count):
        memory[pixels[j]] = lanes[AT + j]
        at = place_of(pixels[j], stride)
        fast[at + HIGH * PITCH] = np.float32(lanes[SCAN_ON + j])
        fast[at + LOW * PITCH] = np.float32(lanes[SCAN_OFF + j])


@inner
def key_of(when_ns, pixel, polarity, label, iv):
    """The key of an event `when_ns` after t0: its time is the nearest microsecond in (t0, t1]."""
    k = np.int64((iv.offset_ns + when_ns) * 1e-3 + 0.5)
    k = min(max(k, np.int64(1)), iv.last_us)
    return np.uint64((k << np.int64(28)) | (pixel << np.int64(3)) | (polarity << np.int64(2)) | label)


@inner
def send(when, who, count, lanes, pixels, planes, flags, num, iv, out, n, tally):
    """Keys of crossings at the fractions `when` of the lanes `who`, without those in refractory periods.

    The crossings of a pixel come in order of time.  LABEL is read only with the flag `labels`.  Returns (out, n).
    """
    out = room(out, n, count)
    t_last, t_reset = planes.t_last, planes.t_reset
    for k in range(count):
        j = lane(who[k])
        pixel, polarity, when_ns = pixels[j], np.int64(lanes[UP + j]), when[k] * iv.dt_ns
        t_ns = iv.t0_ns + np.int64(when_ns)
        label = np.int64(lanes[LABEL + j]) if len(flags.labels) else np.int64(SIGNAL)
        if len(flags.labels) and len(flags.leak):
            leaked_ns, whole_ns = np.float64(t_ns - t_reset[pixel]), leak_of_threshold_ns(pixel, planes, num)
            leaks = (label == SIGNAL) & (polarity == 1) & (leaked_ns > 0.5 * whole_ns)
            label = np.int64(LEAK) if leaks else label
            # (where all events of an interval come at its end, what has leaked until then makes several)
            left_ns = max(leaked_ns - whole_ns, 0.0) if leaks & num.frame_time else 0.0
            t_reset[pixel] = t_ns - np.int64(left_ns)
        key = key_of(when_ns, pixel, polarity, label, iv)
        if num.refractory_ns > 0:
            blind = t_ns - t_last[pixel] < num.refractory_ns
            t_last[pixel] = t_last[pixel] if blind else t_ns
            tally[SWALLOWED] += np.int64(blind)
            n = put(out, n, key, not blind)
        else:
            n = put(out, n, key, True)
    return out, n


@inner
def leak_of_threshold_ns(pixel, planes, num):
    """How long the leak takes to the pixel's mean ON level [ns]: an event to which it has come half-way is its own."""
    threshold = np.float64(planes.theta[pixel, 0]) if num.mismatch > 0.0 else num.threshold_on
    return threshold / num.leak_nat_per_ns


@inner
def cross(lanes, pixels, every, count, planes, flags, num, iv, out, n, tally):
    """One crossing in each lane: the memory AT [nat] is taken at WHEN; `every` counts the lanes.

    Returns (out, n).
    """
    fresh_thresholds(lanes, pixels, every, count, planes, flags, num)
    leave_levels(lanes, pixels, count, planes, flags, num)
    return send(lanes[WHEN:], every, count, lanes, pixels, planes, flags, num, iv, out, n, tally)
