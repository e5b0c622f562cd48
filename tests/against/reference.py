"""A slow, plainly written DVS pixel: the authority that the sensor's event times are held to.

One pixel at a time, float64 throughout, no code shared with vid2ev.  The filter's response to an input that
is linear between frames is a closed form; crossings are found on its monotone pieces, which are found from
the sign changes of its slope on a dense grid.  `response60` is the same response in 60-digit arithmetic, by
partial fractions instead of the divided difference used here.

Times are nanoseconds (float64, from the first frame unless said otherwise), levels and signals are nats.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import mpmath
import numpy as np
from scipy.optimize import brentq

LIGHT_MAX = 1e30
KNEE = 20 / 255


@dataclass(frozen=True)
class Pixel:
    """What the reference knows of a sensor: the deterministic keys of `DvsSpec`, with their names."""

    threshold_on: float = 0.2
    threshold_off: float = 0.2
    photoreceptor_tau_us: float = 0.0
    follower_tau_us: float = 0.0
    filter: str = "before"
    log_curve: str = "offset"
    dark_level: float = 1e-3
    timing: str = "response"
    refractory_us: float = 0.0
    refractory: str = "quantised"


def lit(light: float) -> float:
    """Light as the pixel takes it: NaN and negative are dark, infinite is very bright."""
    return 0.0 if not light > 0 else min(light, LIGHT_MAX)


def log_light(pixel: Pixel, light: float | np.ndarray) -> float | np.ndarray:
    """The log curve L(I) [nat]: ln(I + dark_level), or below 20/255 a C1 line (toe) or v2e's line."""
    if pixel.log_curve == "offset":
        return np.log(light + pixel.dark_level)
    if pixel.log_curve == "toe":
        return np.where(light < KNEE, light / KNEE - 1 + math.log(KNEE), np.log(np.maximum(light, KNEE)))
    straight = light * (math.log(20) / KNEE)
    return np.where(light < KNEE, straight, np.log(255 * np.maximum(light, KNEE)))


def log_slope(pixel: Pixel, light: float) -> float:
    """dL/dI at `light`."""
    if pixel.log_curve == "offset":
        return 1 / (light + pixel.dark_level)
    if pixel.log_curve == "toe":
        return 1 / max(light, KNEE)
    return math.log(20) / KNEE if light < KNEE else 1 / light


@dataclass(frozen=True)
class Response:
    """The two-pole low-pass over one interval: tau1 y1' = u - y1, tau2 y2' = y1 - y2, u from u0 to u1 in T.

    A pole with tau = 0 passes its input on.  `t` may be an array.
    """

    u0: float
    u1: float
    T: float
    y1: float
    y2: float
    tau1: float
    tau2: float

    def input(self, t):
        return self.u0 + (self.u1 - self.u0) * (t / self.T)

    def first(self, t):
        """Output of the first pole."""
        if self.tau1 == 0:
            return self.input(t)
        ramp = (self.u1 - self.u0) / self.T
        lag = ramp * self.tau1
        return self.input(t) - lag + (self.y1 - self.u0 + lag) * np.exp(-t / self.tau1)

    def value(self, t):
        """Output of the second pole."""
        if self.tau2 == 0:
            return self.first(t)
        if self.tau1 == 0:
            lag = (self.u1 - self.u0) / self.T * self.tau2
            return self.input(t) - lag + (self.y2 - self.u0 + lag) * np.exp(-t / self.tau2)
        ramp = (self.u1 - self.u0) / self.T
        lag = ramp * (self.tau1 + self.tau2)
        slow, fast = max(self.tau1, self.tau2), min(self.tau1, self.tau2)
        x = t * ((slow - fast) / (slow * fast))
        phi = np.where(x == 0, 1.0, -np.expm1(-x) / np.where(x == 0, 1.0, x))
        passed_on = (t / self.tau2) * np.exp(-t / slow) * phi
        free = (self.y2 - self.u0 + lag) * np.exp(-t / self.tau2)
        return self.input(t) - lag + free + (self.y1 - self.u0 + ramp * self.tau1) * passed_on

    def slope(self, t):
        """Rate of change of `value` [1/ns]."""
        if self.tau2 > 0:
            return (self.first(t) - self.value(t)) / self.tau2
        if self.tau1 > 0:
            return (self.input(t) - self.first(t)) / self.tau1
        return (self.u1 - self.u0) / self.T + 0 * t

    def turning_points(self) -> list[float]:
        """Instants strictly inside the interval where the slope changes sign."""
        taus = [tau for tau in (self.tau1, self.tau2) if tau > 0]
        if not taus:
            return []
        near = np.geomspace(min(taus) * 1e-4, max(taus) * 50, 160)
        grid = np.unique(np.concatenate([np.linspace(0, self.T, 65), near[near < self.T]]))
        slope = np.asarray(self.slope(grid))
        # Both turning points of a pair may lie in one cell: split it where the slope is nearest to zero.
        lowest = np.flatnonzero((np.abs(slope[1:-1]) < np.abs(slope[:-2])) & (np.abs(slope[1:-1]) < np.abs(slope[2:])))
        for i in lowest + 1:
            fine = np.linspace(grid[i - 1], grid[i + 1], 129)
            grid = np.concatenate([grid, fine])
        grid = np.unique(grid)
        sign = np.sign(np.asarray(self.slope(grid)))
        found = []
        for i in np.flatnonzero(sign[:-1] * sign[1:] < 0):
            found.append(brentq(self.slope, grid[i], grid[i + 1], xtol=1e-9, rtol=1e-15))
        found.extend(grid[1:-1][(sign[1:-1] == 0) & (sign[:-2] * sign[2:] < 0)])
        return sorted(float(t) for t in found)


def response60(part: Response, t: float) -> mpmath.mpf:
    """`Response.value` in 60-digit arithmetic, by partial fractions."""
    with mpmath.workdps(80):  # 20 guard digits: poles 1e-9 apart cost 9
        mp = mpmath.mpf
        u0, ramp, t = mp(part.u0), (mp(part.u1) - mp(part.u0)) / mp(part.T), mp(t)
        tau1, tau2, y1, y2 = mp(part.tau1), mp(part.tau2), mp(part.y1), mp(part.y2)
        steady = u0 + ramp * (t - tau1 - tau2)
        if tau1 == 0 and tau2 == 0:
            return steady
        if tau1 == 0 or tau2 == 0:
            tau, start = (tau1, y1) if tau2 == 0 else (tau2, y2)
            return steady + (start - u0 + ramp * tau) * mpmath.exp(-t / tau)
        k1 = y1 - u0 + ramp * tau1
        k2 = y2 - u0 + ramp * (tau1 + tau2)
        if tau1 == tau2:
            return steady + (k2 + k1 * t / tau1) * mpmath.exp(-t / tau1)
        a = k1 * tau1 / (tau1 - tau2)
        return steady + a * mpmath.exp(-t / tau1) + (k2 - a) * mpmath.exp(-t / tau2)


@dataclass(frozen=True)
class Interval:
    """The comparator's input y between two frames."""

    start: float
    stop: float
    y: Callable[[float], float]  # of the time since `start`
    slope: Callable[[float], float]
    reach: tuple[float, float]  # y stays within
    turns: Callable[[], list[float]]

    @cached_property
    def pieces(self) -> list[tuple[float, float, float, float]]:
        """Monotone pieces (from, to, y from, y to), times since `start`."""
        at = [0.0, *self.turns(), self.stop - self.start]
        y = [float(self.y(t)) for t in at]
        return list(zip(at[:-1], at[1:], y[:-1], y[1:], strict=True))

    def crossing(self, after: float, on: float, off: float) -> tuple[float, int] | None:
        """The first time since `start`, not before `after`, at which y >= on (1) or y <= off (0)."""
        for a, b, ya, yb in self.pieces:
            if b < after:
                continue
            if a < after:
                a, ya = after, float(self.y(after))
            for level, p, there, passed in ((on, 1, ya >= on, yb >= on), (off, 0, ya <= off, yb <= off)):
                if there:
                    return a, p
                if passed:
                    return self._root(level, a, b), p
        return None

    def _root(self, level: float, a: float, b: float) -> float:
        return brentq(lambda t: float(self.y(t)) - level, a, b, xtol=1e-9, rtol=1e-15)


@dataclass(frozen=True)
class Crossing:
    """y meets a level: when [ns], which way (1 ON, 0 OFF), and how fast it moves there [nat/ns, >= 0]."""

    t: float
    p: int
    slope: float
    interval: int


@dataclass
class Signal:
    """The comparator's input of one pixel over a clip: y(t), 0 <= t <= end [ns after the first frame]."""

    pixel: Pixel
    times: list[float]
    intervals: list[Interval]
    y0: float
    levels: list[float] = field(default_factory=list)  # y at the frames

    @property
    def end(self) -> float:
        return self.times[-1]

    def at(self, t: float) -> float:
        k = self.index(t)
        part = self.intervals[k]
        return float(part.y(min(t, part.stop) - part.start))

    def slope_at(self, t: float) -> float:
        part = self.intervals[self.index(t)]
        return abs(float(part.slope(min(t, part.stop) - part.start)))

    def index(self, t: float) -> int:
        """The interval (start, stop] that holds t."""
        return max(0, min(bisect_right(self.times, t) - 1, len(self.intervals) - 1))

    def next_crossing(self, after: float, on: float, off: float, before: float = math.inf) -> Crossing | None:
        """The first time from `after` to `before` at which y >= on (ON) or y <= off (OFF)."""
        for k in range(self.index(after), len(self.intervals)):
            part = self.intervals[k]
            if part.start > before:
                return None
            if part.reach[1] < on and part.reach[0] > off:
                continue
            found = part.crossing(after - part.start, on, off)
            if found is not None:
                t, p = found
                met = Crossing(part.start + t, p, abs(float(part.slope(t))), k)
                return met if met.t <= before else None
        return None


def signal(pixel: Pixel, t_ns: Sequence[int], light: Sequence[float]) -> Signal:
    """y(t) of a pixel that sees `light` (linear between the instants `t_ns`, settled on the first)."""
    times = [float(int(t) - int(t_ns[0])) for t in t_ns]
    before = pixel.filter == "before"
    clean = [lit(float(value)) for value in light]
    u = clean if before else [float(log_light(pixel, value)) for value in clean]
    tau1, tau2 = pixel.photoreceptor_tau_us * 1e3, pixel.follower_tau_us * 1e3
    y1 = y2 = u[0]

    def compared(filtered):
        return log_light(pixel, np.maximum(filtered, 0.0)) if before else filtered

    intervals, levels = [], [float(compared(u[0]))]
    for k in range(len(u) - 1):
        part = Response(u[k], u[k + 1], times[k + 1] - times[k], y1, y2, tau1, tau2)
        reach = (min(part.u0, part.u1, y1, y2), max(part.u0, part.u1, y1, y2))
        y1, y2 = float(part.first(part.T)), float(part.value(part.T))
        levels.append(float(compared(y2)))
        if pixel.timing == "response":
            intervals.append(_curved(pixel, part, times[k], times[k + 1], reach, compared))
        else:
            intervals.append(_straight(levels[-2], levels[-1], times[k], times[k + 1]))
    return Signal(pixel, times, intervals, levels[0], levels)


def _curved(pixel: Pixel, part: Response, start: float, stop: float, reach, compared) -> Interval:
    def slope(t):
        gain = log_slope(pixel, max(float(part.value(t)), 0.0)) if pixel.filter == "before" else 1.0
        return gain * part.slope(t)

    lowest, highest = (float(compared(edge)) for edge in reach)
    return Interval(
        start,
        stop,
        lambda t: compared(part.value(t)),
        slope,
        (lowest - 1e-9, highest + 1e-9),
        part.turning_points,
    )


def _straight(ya: float, yb: float, start: float, stop: float) -> Interval:
    rate = (yb - ya) / (stop - start)
    return Interval(start, stop, lambda t: ya + rate * t, lambda t: rate, (min(ya, yb), max(ya, yb)), list)


@dataclass(frozen=True)
class Event:
    """One event: exact time [ns after the first frame], polarity, |slope| [nat/ns], and its interval."""

    t: float
    p: int
    slope: float
    interval: int


def events(of: Signal, ref: float | None = None) -> tuple[list[Event], int]:
    """The pixel's events, and how many crossings fell into the dead time; `ref` is y at the first frame."""
    pixel = of.pixel
    ref = of.y0 if ref is None else ref
    dead_ns = pixel.refractory_us * 1e3
    ready, now = -math.inf, 0.0
    out: list[Event] = []
    swallowed = 0
    while True:
        met = of.next_crossing(now, ref + pixel.threshold_on, ref - pixel.threshold_off)
        if met is None:
            return out, swallowed
        now = met.t
        ref += pixel.threshold_on if met.p else -pixel.threshold_off
        sent = of.intervals[met.interval].stop if pixel.timing == "frame" else met.t
        if sent < ready:
            swallowed += 1
            continue
        out.append(Event(sent, met.p, met.slope, met.interval))
        ready = sent + dead_ns
        if dead_ns > 0 and pixel.refractory == "track":
            if ready >= of.end:
                return out, swallowed
            now, ref = ready, of.at(ready)


def esim(t_ns: np.ndarray, log_frames: np.ndarray, threshold_on: float, threshold_off: float) -> np.recarray:
    """ESIM (Rebecq et al. 2018): log light linear between frames, exact times, no filter, no noise.

    `log_frames` is float64 [F, N].  Returns records (pixel, t [ns after the first frame], p, gap) ordered by
    pixel and time; gap [nat] is how far beyond the level the signal is at the end of the interval.
    """
    ref = log_frames[0].copy()
    found = np.empty(0, [("pixel", "i8"), ("t", "f8"), ("p", "i8"), ("gap", "f8")])
    rounds = [found]
    for k in range(1, len(log_frames)):
        start, stop = log_frames[k - 1], log_frames[k]
        t0, dt = float(t_ns[k - 1] - t_ns[0]), float(t_ns[k] - t_ns[k - 1])
        for p, step in ((1, threshold_on), (0, -threshold_off)):
            while True:
                level = ref + step
                met = (stop > start) & (stop >= level) if p else (stop < start) & (stop <= level)
                hit = np.flatnonzero(met)
                if not len(hit):
                    break
                new = np.empty(len(hit), found.dtype)
                share = (level[hit] - start[hit]) / (stop[hit] - start[hit])
                new["pixel"], new["p"] = hit, p
                new["t"] = t0 + dt * np.clip(share, 0, 1)
                new["gap"] = np.abs(stop[hit] - level[hit])
                rounds.append(new)
                ref[hit] = level[hit]
    found = np.concatenate(rounds)
    return found[np.lexsort((found["t"], found["pixel"]))].view(np.recarray)
