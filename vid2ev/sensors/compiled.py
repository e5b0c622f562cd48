"""From a specification to what the walk works on: flags, numbers, planes of state, and the numbers of an interval."""

from __future__ import annotations

import math

import numpy as np

from vid2ev.kernels.layout import BLOCK, OFF, ON, PITCH, Flags, Interval, Numbers, Planes, stride_of
from vid2ev.kernels.scan import HIGHEST
from vid2ev.kernels.work import aligned
from vid2ev.physics.bad_pixels import bad_pixel_map
from vid2ev.physics.log_curve import curve_of
from vid2ev.physics.mismatch import fill_thresholds
from vid2ev.physics.photoreceptor import separate, step_weights
from vid2ev.physics.photoreceptor_noise import RESOLVED, noise_step
from vid2ev.physics.shading import shading_map
from vid2ev.sensors.spec import DvsSpec

F = np.float32
STEEPEST_LEAK_NAT = 5.0  # by which light may be multiplied: the brightest, with the greatest gain, remains a float32
UNUSED = 2  # (a single entry is never spread out)
RECORDS: dict[str, tuple[type, tuple[int, ...]]] = {  # the planes that only the slow path touches
    "memory": (np.float64, ()),
    "theta": (np.float32, (2,)),
    "drawn": (np.float32, (2,)),
    "t_last": (np.int64, ()),
    "t_reset": (np.int64, ()),
    "count": (np.uint32, ()),
}


def flags_of(spec: DvsSpec, labels: bool) -> Flags:
    """What the walk has to be compiled for."""

    def flag(used: object) -> tuple:
        return ON if used else OFF

    poles = len(spec.pole_taus_us)
    log_input = spec.filter == "after" and poles > 0
    straight = spec.timing != "response" or (spec.filter == "after" and poles == 0)
    leak, noise, refractory = spec.leak_rate_hz > 0, spec.photoreceptor_noise > 0, spec.refractory_us > 0
    forced = spec.shot_rate_hz > 0 or (spec.hot_probability > 0 and spec.hot_rate_hz > 0)
    track = refractory and spec.refractory == "track"
    return Flags(
        poles=(0,) * poles,
        log_input=flag(log_input),
        log_compare=flag(log_input or noise or (leak and spec.log_curve != "offset")),
        straight=flag(straight),
        light_bandwidth=flag(spec.bandwidth == "light" and spec.photoreceptor_tau_us > 0),
        leak=flag(leak),
        drift=flag(not straight and not log_input and (leak or noise)),
        crossing_noise=flag(spec.crossing_noise > 0),
        track=flag(track),
        noise=flag(noise),
        forced=flag(forced),
        labels=flag(labels and (leak or forced)),
        uncounted=flag(not straight or refractory or (labels and leak)),
        no_closed_form=flag(straight and track),
    )


def flags_at_rest(flags: Flags) -> Flags:
    """Those that pixels are settled and roused by: without what only their walk goes by."""
    return flags._replace(straight=OFF, drift=OFF, track=OFF, forced=OFF, uncounted=OFF, no_closed_form=OFF)


def numbers_of(spec: DvsSpec, seed: int, camera: int) -> Numbers:
    """Numbers of the sensor in the units of the walk."""
    taus = spec.pole_taus_us
    tau1, tau2 = taus[0] * 1e3 if taus else 0.0, 0.0
    if len(taus) == 2:  # (a pole that depends on light is held apart from the other in each pixel: `separate_rates`)
        tau2 = taus[1] * 1e3
        tau1, tau2 = separate(tau1, tau2) if spec.bandwidth == "constant" else (tau1, tau2)
    return Numbers(
        seed=np.uint64(seed),
        camera=camera,
        curve=curve_of(spec.log_curve, spec.dark_level),
        threshold_on=spec.threshold_on,
        threshold_off=spec.threshold_off,
        mismatch=spec.mismatch,
        crossing_noise=spec.crossing_noise,
        refractory_ns=spec.refractory_ns(),
        frame_time=spec.timing == "frame",
        max_crossings=spec.max_crossings,
        leak_nat_per_ns=spec.leak_rate_hz * spec.threshold_on * 1e-9,
        noise_rms=spec.photoreceptor_noise,
        shot_rate_hz=spec.shot_rate_hz,
        shot_light_factor=spec.shot_light_factor,
        hot_rate_hz=spec.hot_rate_hz if spec.hot_probability > 0 else 0.0,
        bandwidth_dark=spec.bandwidth_dark,
        tau1_ns=tau1,
        tau2_ns=tau2,
    )


def planes_of(
    spec: DvsSpec, flags: Flags, num: Numbers, width: int, height: int, old: Planes | None = None
) -> tuple[Planes, np.ndarray]:
    """State of the pixels, yet without light, and the map of bad pixels (uint8: 1 hot, 2 cold).

    `old` planes of the same size and flags are used again.
    """
    pixels = width * height
    bad, wanted = bad_of(spec, num, pixels), kept_of(flags, num)
    if old is None or any(len(getattr(old, name)) != (pixels if kept else UNUSED) for name, kept in wanted.items()):
        old = blank_planes(pixels, flags, wanted)
    old.rest[...], old.count[...] = 0, 0
    draw_thresholds(old.theta, spec, num)
    return old._replace(hot=np.flatnonzero(bad == 1).astype(np.int32), shade=shade_of(spec, width, height)), bad


def draw_thresholds(theta: np.ndarray, spec: DvsSpec, num: Numbers) -> None:
    """The thresholds of the pixels into theta [float32 [n, 2], nat], where they have some of their own."""
    if num.mismatch > 0:
        fill_thresholds(theta, num.seed, num.camera, spec.threshold_on, spec.threshold_off, spec.mismatch)


def bad_of(spec: DvsSpec, num: Numbers, pixels: int) -> np.ndarray:
    """The map of bad pixels [uint8]: 1 hot, 2 cold."""
    if spec.hot_probability > 0 or spec.cold_probability > 0:
        return bad_pixel_map(pixels, num.seed, num.camera, spec.hot_probability, spec.cold_probability)
    return np.zeros(pixels, np.uint8)


def shade_of(spec: DvsSpec, width: int, height: int) -> np.ndarray:
    """The optical gain of the pixels [float32]; of all together, where it is that of none."""
    return shading_map(spec.shading, width, height).ravel() if spec.shading else np.ones(1, np.float32)


def kept_of(flags: Flags, num: Numbers) -> dict[str, bool]:
    """Which planes the slow path has an entry of each pixel in; of the others there are UNUSED entries."""
    return {
        "memory": True,
        "theta": num.mismatch > 0,
        "drawn": bool(flags.crossing_noise),
        "t_last": num.refractory_ns > 0 or bool(flags.track) or num.hot_rate_hz > 0,
        "t_reset": bool(flags.labels and flags.leak),
        "count": bool(flags.crossing_noise),
    }


def blank_planes(pixels: int, flags: Flags, wanted: dict[str, bool]) -> Planes:
    """Planes with room for the state of so many pixels."""
    blocks = -(-pixels // BLOCK)
    return Planes(
        fast=aligned(blocks * stride_of(flags), np.float32),
        rest=np.zeros(2 * PITCH * blocks if flags.poles and not flags.log_input else 0, np.float32),
        **records_of(pixels, wanted),
        hot=np.empty(0, np.int32),
        shade=np.ones(1, np.float32),
    )


def records_of(pixels: int, wanted: dict[str, bool]) -> dict[str, np.ndarray]:
    """What the slow path keeps of each pixel, as views of records: one line of memory for each that it takes.

    All planes are spread out in memory, used or not, so that their types are the same; a memory alone is not, which
    would take twice the room.
    """
    used = [(name, *field) for name, field in RECORDS.items() if wanted[name]]
    record = np.dtype(used, align=True)
    records = aligned(pixels * record.itemsize, np.uint8).view(record)
    return {
        name: records[name] if wanted[name] else np.zeros((2 * UNUSED, *shape), kind)[::2]
        for name, (kind, shape) in RECORDS.items()
    }


def interval_of(
    flags: Flags, num: Numbers, t0_ns: int, t1_ns: int, leak_since_ns: int, step: int, fresh_noise: bool
) -> Interval:
    """Numbers of the interval (t0, t1]; all weights in float64 before they are rounded once."""
    dt = float(t1_ns - t0_ns)
    first_us = t0_ns // 1000
    weights = step_weights(dt, num.tau1_ns, num.tau2_ns)
    leak0 = num.leak_nat_per_ns * (t0_ns - leak_since_ns)
    leak1 = num.leak_nat_per_ns * (t1_ns - leak_since_ns)
    # (beyond, every light is taken to be at the highest level)
    gain, shift = (math.exp(leak1), num.curve.dark * math.exp(leak1)) if leak1 < STEEPEST_LEAK_NAT else (0.0, HIGHEST)
    resolved = bool(flags.noise) and dt * RESOLVED <= num.tau2_ns
    noise = (0.0,) * 6
    if resolved:
        noise = noise_step(dt, num.tau1_ns, num.tau2_ns, num.noise_rms, fresh_noise)
    keep1, mix, keep2, s11, s21, s22 = noise
    return Interval(
        t0_ns=t0_ns,
        dt_ns=dt,
        first_us=first_us,
        offset_ns=float(t0_ns - first_us * 1000),
        last_us=max(t1_ns // 1000 - first_us, 1),
        x1=weights.x1,
        w1=weights.w1,
        x2=weights.x2,
        g=weights.g,
        w2=weights.w2,
        a=dt / num.tau1_ns if num.tau1_ns > 0 else 0.0,
        b=dt / num.tau2_ns if num.tau2_ns > 0 else 0.0,
        leak0=leak0,
        leak1=leak1,
        gain=F(gain),
        shift=F(shift),
        noise_keep1=F(keep1),
        noise_mix=F(mix),
        noise_keep2=F(keep2),
        noise_s11=F(s11),
        noise_s21=F(s21),
        noise_s22=F(s22),
        noise_resolved=resolved,
        step=step,
    )
