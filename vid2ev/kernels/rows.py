"""Numbers of sensors and of intervals as rows of tables, as many of them go into one call."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import Interval, Numbers
from vid2ev.physics.log_curve import Curve

RISEN = 19  # where the last number of an interval is: the leak that goes into the memories before it [nat]


def sensor_row(num: Any) -> tuple[np.ndarray, np.ndarray]:
    """(float64, int64) of a sensor's `Numbers`."""
    floats = [
        *num.curve, num.threshold_on, num.threshold_off, num.mismatch, num.crossing_noise, num.leak_nat_per_ns,
        num.noise_rms, num.shot_rate_hz, num.shot_light_factor, num.hot_rate_hz, num.bandwidth_dark, num.tau1_ns,
        num.tau2_ns,
    ]  # fmt: skip
    seed = np.uint64(num.seed).view(np.int64)
    ints = [seed, num.camera, num.refractory_ns, num.frame_time, num.max_crossings]
    return np.array(floats, np.float64), np.array(ints, np.int64)


@inner
def sensor_of(floats, ints):
    """The `Numbers` of a row."""
    curve = Curve(floats[0], floats[1], floats[2], floats[3], floats[4], floats[5])
    return Numbers(
        np.uint64(ints[0]), ints[1], curve, floats[6], floats[7], floats[8], floats[9], ints[2], ints[3] != 0, ints[4],
        floats[10], floats[11], floats[12], floats[13], floats[14], floats[15], floats[16], floats[17],
    )  # fmt: skip


def interval_row(iv: Any, risen: float) -> tuple[np.ndarray, np.ndarray]:
    """(float64, int64) of an `Interval`, and of what the leak has risen before it."""
    floats = [
        iv.dt_ns, iv.offset_ns, iv.x1, iv.w1, iv.x2, iv.g, iv.w2, iv.a, iv.b, iv.leak0, iv.leak1, iv.gain, iv.shift,
        iv.noise_keep1, iv.noise_mix, iv.noise_keep2, iv.noise_s11, iv.noise_s21, iv.noise_s22, risen,
    ]  # fmt: skip
    ints = [iv.t0_ns, iv.first_us, iv.last_us, iv.noise_resolved, iv.step]
    return np.array(floats, np.float64), np.array(ints, np.int64)


def interval_rows(steps: Any) -> tuple[np.ndarray, np.ndarray]:
    """(float64, int64), each [steps, .], of pairs of an `Interval` and what the leak has risen before it."""
    rows = [interval_row(*step) for step in steps]
    return np.array([floats for floats, _ in rows]), np.array([ints for _, ints in rows])


@inner
def interval_of_row(floats, ints):
    """The `Interval` of a row."""
    single = np.float32
    return Interval(
        ints[0], floats[0], ints[1], floats[1], ints[2], floats[2], floats[3], floats[4], floats[5], floats[6],
        floats[7], floats[8], floats[9], floats[10], single(floats[11]), single(floats[12]), single(floats[13]),
        single(floats[14]), single(floats[15]), single(floats[16]), single(floats[17]), single(floats[18]),
        ints[3] != 0, ints[4],
    )  # fmt: skip
