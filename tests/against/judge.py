"""Holds a sensor's events to the reference: each one due, none missing, none early or late.

The tolerance is 1 us (integer microseconds) plus the time that y takes through 2e-6 nat around the level,
which is 2e-6 / |slope| wherever y is straight.  So an event is right if y is within 2e-6 nat of the level, or
beyond it, at some instant within 1 us of the event, and if y went no more than 2e-6 nat beyond either level
earlier.  An event whose excursion stays under 2e-6 nat may be sent or not: the judge follows the sensor and
counts it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .reference import Pixel, Signal, events, signal

SLACK_NAT = 2e-6
SLACK_NS = 1e3


class Wrong(AssertionError):
    """The sensor's events are not those of the pixel."""


@dataclass(frozen=True)
class Verdict:
    """What was judged: events, and those that hang on an excursion of less than 2e-6 nat."""

    events: int
    marginal: int


def judge(of: Signal, t: np.ndarray, p: np.ndarray, ref: float | None = None, slack: float = SLACK_NAT) -> Verdict:
    """Walk along the sensor's events (t in ns after the first frame) of one pixel without dead time.

    `ref` is the level that the pixel starts from (y at the first frame), `slack` the excursion that may be
    sent or not.  Raises `Wrong` at the first fault.
    """
    pixel = of.pixel
    ref = of.y0 if ref is None else ref
    now, marginal = 0.0, 0
    for k, (when, polarity) in enumerate(zip(t.tolist(), p.tolist(), strict=True)):
        on, off = ref + pixel.threshold_on, ref - pixel.threshold_off
        level = on if polarity else off
        where = f"event {k} ({'ON' if polarity else 'OFF'}, {when / 1e3:.3f} us)"
        due = of.next_crossing(now, on + slack, off - slack, before=when)
        if due is not None and when - due.t > SLACK_NS:
            way = "ON" if due.p else "OFF"
            raise Wrong(f"{where}: {way} was due at {due.t / 1e3:.3f} us, slope {due.slope * 1e9:.3g} nat/s")
        band = (level - slack, -np.inf) if polarity else (np.inf, level + slack)
        met = of.next_crossing(max(now, when - SLACK_NS), *band, before=when + SLACK_NS)
        if met is None:
            away = [of.at(min(max(when + d, 0.0), of.end)) - level for d in (-SLACK_NS, 0, SLACK_NS)]
            late = of.next_crossing(now, *band)
            raise Wrong(f"{where}: y - level = {away} nat within 1 us; level met at {late}")
        beyond = (level + slack, off - slack) if polarity else (on + slack, level - slack)
        surely = of.next_crossing(met.t, *beyond)
        if surely is None or surely.p != polarity:
            marginal += 1
        now, ref = met.t, level
    due = of.next_crossing(now, ref + pixel.threshold_on + slack, ref - pixel.threshold_off - slack)
    if due is not None:
        raise Wrong(f"after {len(t)} events: {'ON' if due.p else 'OFF'} was due at {due.t / 1e3:.3f} us")
    return Verdict(len(t), marginal)


def judge_clip(pixel: Pixel, t_ns: Sequence[int], light: np.ndarray, sent, ref: np.ndarray | None = None) -> Verdict:
    """Judge every pixel of a clip: `light` [F, H, W], `sent` its Events, `ref` [H, W] start levels."""
    total = marginal = 0
    height, width = light.shape[1:]
    at = sent.y.astype(np.int64) * width + sent.x
    order = np.argsort(at, kind="stable")
    bounds = np.searchsorted(at[order], np.arange(height * width + 1))
    for i in range(height * width):
        mine = order[bounds[i] : bounds[i + 1]]
        of = signal(pixel, t_ns, light[:, i // width, i % width])
        start = None if ref is None else float(ref.flat[i])
        try:
            verdict = judge(of, sent.t[mine] * 1000.0 - float(t_ns[0]), sent.p[mine], start)
        except Wrong as fault:
            raise Wrong(f"pixel ({i % width}, {i // width}): {fault}") from None
        total, marginal = total + verdict.events, marginal + verdict.marginal
    return Verdict(total, marginal)


def assert_one_to_one(pixel: Pixel, t_ns: Sequence[int], light: np.ndarray, sent, ref=None) -> int:
    """Every pixel's events pair off in order with the reference's, dead time included; returns how many.

    Tolerance 1 us + 2e-6 nat / |slope|; with `track`, an error of the time moves the level that is taken at
    the end of the dead time, and the tolerance grows by what that moves the next crossing.
    """
    total = 0
    width = light.shape[2]
    for i in range(light.shape[1] * width):
        x, y = i % width, i // width
        of = signal(pixel, t_ns, light[:, y, x])
        want, _ = events(of, None if ref is None else float(ref[y, x]))
        mine = (sent.x == x) & (sent.y == y)
        got_t, got_p = sent.t[mine] * 1000.0 - float(t_ns[0]), sent.p[mine]
        where = f"pixel ({x}, {y})"
        assert [event.p for event in want] == got_p.tolist(), f"{where}: {len(want)} expected, {len(got_p)} got"
        drift = 0.0
        for event, t in zip(want, got_t.tolist(), strict=True):
            doubt = (SLACK_NAT + drift) / event.slope if event.slope > 0 else np.inf
            late = t - event.t
            assert abs(late) <= SLACK_NS + doubt, f"{where}: {late} ns off at {event}"
            if pixel.refractory == "track" and pixel.refractory_us > 0:
                end = min(event.t + pixel.refractory_us * 1e3, of.end)
                drift = of.slope_at(end) * doubt
        total += len(want)
    return total
