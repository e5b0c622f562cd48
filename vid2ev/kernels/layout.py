"""What the walk works on: planes of pixel state, numbers of the sensor, numbers of the interval, and flags.

Pixels lie in blocks of 2048 in row-major order.  What the scan touches is interleaved by block (`fast`: block, plane,
pixel), so that the compiler sees that planes do not overlap and a block's work stays in the nearest caches; what only
the slow path touches is plain planes.  The slow path takes pixels out into **lanes**, planes of its own.

A **flag** is a tuple: empty when the effect is off, of length one when it is on.  Its type differs, so numba compiles a
walk for each combination in use, and what `if len(flags.effect):` switches off is not even looked at.  What takes no
time where it is off, as it is asked once for a block or an event, is no flag but a number: each flag doubles the walks
that people wait for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.widths import BLOCK, BLOCK_BITS, LANE_COUNT, LANE_PITCH, PITCH
from vid2ev.physics.log_curve import Curve
from vid2ev.stream.still import STRIP  # pixels of a block that sleep or are awake together

__all__ = ["BLOCK", "BLOCK_BITS", "LANE_COUNT", "LANE_PITCH", "PITCH", "STRIP"]  # (and what is below)

PIXEL_LIMIT = 1 << 25  # bits of the event key
ON = (0,)
OFF = ()

# Planes of `fast`, in units of PITCH; after the lags in use come
# three of the photoreceptor noise (its pair, the comparator's input without it) and, for a light-dependent pole, the
# light of the last frame.
INPUT, HIGH, LOW, LAG1, LAG2 = range(5)

# Counters kept by the walk.
SWALLOWED, CAPPED, NOT_FINITE = range(3)
TALLIES = 3


class Flags(NamedTuple):
    """What the walk is compiled for; each entry is ON or OFF (`poles`: one entry per pole)."""

    poles: tuple  # (), (0,) or (0, 0)
    log_input: tuple  # the filter acts on the log
    log_compare: tuple  # the scan compares nats instead of light
    straight: tuple  # the comparator's input is a straight line in nats within the interval
    light_bandwidth: tuple
    leak: tuple
    drift: tuple  # what is added to the log of a response of light is not the same all the time
    crossing_noise: tuple
    track: tuple  # the refractory period ends by memorising the signal
    noise: tuple  # photoreceptor noise
    forced: tuple  # shot noise or hot pixels
    labels: tuple  # events have more than one cause, and are to say which
    uncounted: tuple  # crossings have to be looked at one by one, in order of time
    no_closed_form: tuple  # a flagged pixel always takes the general path


class Numbers(NamedTuple):
    """Numbers of the sensor."""

    seed: np.uint64
    camera: int
    curve: Curve
    threshold_on: float
    threshold_off: float
    mismatch: float  # [nat]; above 0 pixels have thresholds of their own (`Planes.theta`), which it is in already
    crossing_noise: float  # [nat]
    refractory_ns: int
    frame_time: bool  # all events at the end of the interval
    max_crossings: int
    leak_nat_per_ns: float
    noise_rms: float  # [nat]
    shot_rate_hz: float
    shot_light_factor: float
    hot_rate_hz: float
    bandwidth_dark: float
    tau1_ns: float
    tau2_ns: float


class Interval(NamedTuple):
    """Numbers of one interval (t0, t0 + dt]."""

    t0_ns: int
    dt_ns: float
    first_us: int  # the integer microsecond at or before t0
    offset_ns: float  # t0 after that microsecond
    last_us: int  # the last microsecond that an event may have, counted from first_us
    x1: float
    w1: float
    x2: float
    g: float
    w2: float
    a: float  # dt / tau1, the faster clock of a light-dependent pole being formed per pixel
    b: float  # dt / tau2
    leak0: float  # leak since its reference at the start [nat]
    leak1: float  # and at the end
    gain: np.float32  # exp(leak1), and dark times it: leak in the light domain
    shift: np.float32
    noise_keep1: np.float32  # photoreceptor noise: see physics/photoreceptor_noise.py
    noise_mix: np.float32
    noise_keep2: np.float32
    noise_s11: np.float32
    noise_s21: np.float32
    noise_s22: np.float32
    noise_resolved: bool
    step: int


class Planes(NamedTuple):
    """State of the pixels; a plane that nothing uses has few entries."""

    fast: np.ndarray  # float32, blocks x planes x PITCH
    rest: np.ndarray  # float32, blocks x 2 x PITCH: what steep lags have beyond float32 (scan.refine)
    memory: np.ndarray  # float64 [n]: the level that each pixel memorised [nat]
    theta: np.ndarray  # float32 [n, 2]: its ON and OFF threshold [nat], if there is mismatch
    drawn: np.ndarray  # float32 [n, 2]: the same with the noise of the crossing to come
    t_last: np.ndarray  # int64 [n]: its last event [ns]
    count: np.ndarray  # uint32 [n]: crossings so far
    t_reset: np.ndarray  # int64 [n]: when its level last moved [ns]
    hot: np.ndarray  # int32: indices of the hot pixels, ascending
    shade: np.ndarray  # float32 [n]: optical gain, if there is shading; else [1], 1


@inner
def lane(number):
    """The number of a lane, below LANE_COUNT, a power of two: of one lane a compiler then knows which, and has it in
    registers."""
    return number & np.int64(LANE_COUNT - 1)


@compiled
def stride_of(flags):
    """Length of a block in `fast` for these flags."""
    return (LAG1 + len(flags.poles) + 3 * len(flags.noise) + len(flags.light_bandwidth)) * PITCH


@compiled
def last_light(flags):
    """Start of the plane of a block that has the light of the last frame, for a pole that depends on it."""
    return (LAG1 + len(flags.poles) + 3 * len(flags.noise)) * PITCH


@compiled
def last_seen(flags):
    """Start of the plane of a block that has the comparator's input at the last frame without photoreceptor noise."""
    return (LAG1 + len(flags.poles) + 2) * PITCH


@compiled
def place_of(pixel, stride):
    """Where a pixel stands in the first plane of `fast`."""
    return (pixel >> BLOCK_BITS) * stride + (pixel & (BLOCK - 1))
