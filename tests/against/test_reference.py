"""The reference itself: against 60-digit arithmetic, brute-force integration and closed forms."""

import math

import mpmath
import numpy as np
import pytest

from .judge import Wrong, judge
from .reference import Pixel, Response, events, log_light, log_slope, response60, signal

POLES = [
    (0.0, 0.0),
    (300.0, 0.0),
    (0.0, 100.0),
    (300.0, 100.0),
    (100.0, 300.0),
    (100.0, 100.0),
    (100.0, 100.0 * (1 + 1e-9)),
    (100.0, 101.0),
    (1e6, 1.0),
    (1.0, 1e6),
]


@pytest.mark.parametrize("taus", POLES)
@pytest.mark.parametrize("span_us", [0.01, 1.0, 100.0, 1e4, 1e6])
def test_closed_form_equals_60_digits(taus, span_us):
    part = Response(0.3, 0.9, span_us, 0.1, 0.55, *taus)
    for t in np.concatenate([[0.0], np.geomspace(span_us * 1e-6, span_us, 13)]):
        exact = response60(part, float(t))
        # Ramp and lag cancel when the interval is short against the poles: one rounding of the lag remains.
        lag = 0.6 / span_us * sum(taus)
        if 0.0 in taus and t == 0.0 and sum(taus) == 0:
            assert part.value(t) == part.u0
        assert abs(float(part.value(t)) - float(exact)) < 4e-15 + 4e-16 * lag


@pytest.mark.parametrize("taus", POLES[1:8])
@pytest.mark.parametrize("span_us", [30.0, 1000.0])
def test_closed_form_equals_brute_force_integration(taus, span_us):
    """Runge-Kutta 4 in steps of a fiftieth of the shortest time, nothing shared with the closed form."""
    part = Response(0.3, 0.9, span_us, 0.1, 0.55, *taus)
    steps = int(span_us / min(tau for tau in (*taus, span_us) if tau > 0) * 50)
    h = span_us / steps

    def rate(t, y):
        u = 0.3 + 0.6 * t / span_us
        first = u if taus[0] == 0 else y[0]
        return np.array(
            [0.0 if taus[0] == 0 else (u - y[0]) / taus[0], 0.0 if taus[1] == 0 else (first - y[1]) / taus[1]]
        )

    y = np.array([0.1, 0.55])
    for k in range(steps):
        t = k * h
        a = rate(t, y)
        b = rate(t + h / 2, y + h / 2 * a)
        c = rate(t + h / 2, y + h / 2 * b)
        d = rate(t + h, y + h * c)
        y = y + h / 6 * (a + 2 * b + 2 * c + d)
    assert float(part.value(span_us)) == pytest.approx(y[1] if taus[1] else y[0], abs=2e-9)


def test_all_turning_points_are_found():
    """Never a slope of the other sign between the turning points found."""
    rng = np.random.default_rng(1)
    pairs = 0
    for _ in range(400):
        taus = 10 ** rng.uniform(0, 3, 2)
        part = Response(*rng.uniform(0, 1, 2), 10 ** rng.uniform(0, 4), *rng.uniform(0, 1, 2), *taus)
        turns = part.turning_points()
        assert len(turns) <= 2
        pairs += len(turns) == 2
        for a, b in zip([0.0, *turns], [*turns, part.T], strict=True):
            slope = part.slope(np.linspace(a, b, 2501)[1:-1])
            # Beyond some forty time constants the response is straight but for rounding.
            assert not (slope.min() < -1e-13 and slope.max() > 1e-13)
    assert pairs > 0


@pytest.mark.parametrize("curve", ["offset", "toe", "v2e"])
def test_log_slope_is_the_derivative_of_the_log_curve(curve):
    pixel = Pixel(log_curve=curve, dark_level=0.01)
    for light in (0.0, 0.003, 0.05, 0.09, 1.0, 50.0):
        h = 1e-7 * max(light, 0.01)
        numeric = (log_light(pixel, light + 2 * h) - log_light(pixel, light + h)) / h
        assert log_slope(pixel, light + 1.5 * h) == pytest.approx(float(numeric), rel=1e-6)


def test_events_of_a_log_ramp_are_evenly_spaced():
    light = np.exp([0.0, 3.0]) - 1e-3
    found, swallowed = events(signal(Pixel(0.25, 0.25, filter="after"), [7, 10_007], light))
    assert swallowed == 0
    assert [event.t for event in found] == pytest.approx([10_000 * k / 12 for k in range(1, len(found) + 1)], abs=1e-6)
    assert len(found) in (11, 12)  # the twelfth level is the end itself


@pytest.mark.parametrize("order", ["before", "after"])
def test_events_of_a_step_through_one_pole(order):
    """y = ln k (1 - exp(-t/tau)) after the log; ln(1 + (k - 1)(1 - exp(-t/tau))) before it."""
    pixel = Pixel(0.2, 0.2, photoreceptor_tau_us=300, filter=order, dark_level=1e-9)
    found, _ = events(signal(pixel, [0, 1, 10_000_000], [1.0, 4.0, 4.0]))
    levels = 0.2 * np.arange(1, len(found) + 1)
    share = levels / math.log(4) if order == "after" else np.expm1(levels) / 3
    assert len(found) == 6
    assert [event.t for event in found] == pytest.approx(-3e5 * np.log1p(-share), abs=2)


def test_events_equal_brute_force_sub_stepping():
    """Random clips through two poles against sub-stepping at 20 ns: same events, times alike to 10 ns."""
    rng = np.random.default_rng(2)
    compared = 0
    for order in ("before", "after"):
        pixel = Pixel(0.13, 0.17, 30, 10, filter=order)
        for _ in range(3):
            light = rng.uniform(0.02, 1, 8)
            t_ns = np.concatenate([[0], np.cumsum(rng.integers(5_000, 80_000, 7))])
            got, _ = events(signal(pixel, t_ns, light))
            want = _sub_stepped(pixel, t_ns, light, 20.0)
            assert [event.p for event in got] == [p for _, p in want]
            slack = [10 + 2e-6 / event.slope for event in got]
            late = np.abs(np.array([event.t for event in got]) - [t for t, _ in want])
            assert (late <= slack).all()
            compared += len(want)
    assert compared > 50


def _sub_stepped(pixel, t_ns, light, h):
    """Heun steps of h ns, comparator on straight lines between them."""
    before = pixel.filter == "before"
    u = light if before else np.log(light + pixel.dark_level)
    n = int(t_ns[-1] / h)
    drive = np.interp(np.arange(n + 1) * h, t_ns, u)
    a, b = h / (pixel.photoreceptor_tau_us * 1e3), h / (pixel.follower_tau_us * 1e3)
    y1 = y2 = drive[0]
    path = [y2]
    for k in range(n):
        r1, r2 = a * (drive[k] - y1), b * (y1 - y2)
        s1, s2 = a * (drive[k + 1] - y1 - r1), b * (y1 + r1 - y2 - r2)
        y1, y2 = y1 + (r1 + s1) / 2, y2 + (r2 + s2) / 2
        path.append(y2)
    y = np.log(np.array(path) + pixel.dark_level) if before else np.array(path)
    ref, out = y[0], []
    for k in range(n):
        while True:
            if y[k + 1] >= ref + pixel.threshold_on:
                ref, p = ref + pixel.threshold_on, 1
            elif y[k + 1] <= ref - pixel.threshold_off:
                ref, p = ref - pixel.threshold_off, 0
            else:
                break
            out.append(((k + (ref - y[k]) / (y[k + 1] - y[k])) * h, p))
    return out


def test_event_times_satisfy_the_60_digit_response():
    rng = np.random.default_rng(3)
    for taus in POLES[1:]:
        light = rng.uniform(0.1, 1, 2)
        of = signal(Pixel(0.11, 0.11, *taus), [0, 400_000], light)
        found, _ = events(of)
        part = Response(light[0], light[1], 4e5, light[0], light[0], taus[0] * 1e3, taus[1] * 1e3)
        for k, event in enumerate(found, 1):
            with mpmath.workdps(60):
                y = mpmath.log(response60(part, event.t) + mpmath.mpf(1e-3))
                level = mpmath.log(mpmath.mpf(light[0]) + mpmath.mpf(1e-3)) + k * mpmath.mpf(0.11) * (
                    1 if event.p else -1
                )
                assert abs(float(y - level)) < 1e-13 + event.slope * 1e-3


def test_dead_time_swallows_or_tracks():
    """A log ramp of 1 nat in 1 ms crosses 0.1 nat every 100 us."""
    light = np.exp([0.0, 1.04]) - 1e-3
    t_ns = [0, 1_040_000]
    sent, swallowed = events(signal(Pixel(0.1, 0.1, filter="after", refractory_us=250), t_ns, light))
    assert [round(event.t) for event in sent] == pytest.approx([100_000, 400_000, 700_000, 1_000_000], abs=1)
    assert swallowed == 6
    track = Pixel(0.1, 0.1, filter="after", refractory_us=250, refractory="track")
    sent, swallowed = events(signal(track, t_ns, light))
    assert [round(event.t) for event in sent] == pytest.approx([100_000, 450_000, 800_000], abs=1)
    assert swallowed == 0


def test_the_judge_accepts_the_truth_and_nothing_else():
    rng = np.random.default_rng(4)
    light = rng.uniform(0.05, 1, 20)
    t_ns = np.arange(20) * 1_000_000
    for order in ("before", "after"):
        of = signal(Pixel(0.2, 0.15, 300, 100, filter=order), t_ns, light)
        found, _ = events(of)
        t = np.rint(np.array([event.t for event in found]) / 1e3) * 1e3
        p = np.array([event.p for event in found])
        assert judge(of, t, p).events == len(found) > 30
        for k in range(len(t)):
            band = 2e-6 / found[k].slope
            moved = t.copy()
            moved[k] += 2e3 + 3 * band
            for wrong_t, wrong_p in (
                (np.delete(t, k), np.delete(p, k)),
                (moved, p),
                (2 * t - moved, p),
                (t, np.where(np.arange(len(p)) == k, 1 - p, p)),
                (np.insert(t, k, t[k]), np.insert(p, k, p[k])),
                (np.insert(t, k, t[k]), np.insert(p, k, 1 - p[k])),
            ):
                with pytest.raises(Wrong):
                    judge(of, wrong_t, wrong_p)


def test_the_judge_lets_tiny_excursions_be_sent_or_not():
    """A triangle that turns `beyond` above the first ON level: a coin toss under 2e-6 nat, a duty above."""
    for beyond, sent_is_right, silent_is_right in (
        (-3e-6, False, True),
        (-1e-6, True, True),
        (1e-6, True, True),
        (3e-6, True, False),
    ):
        light = np.exp([0.0, 0.2 + beyond, 0.0]) - 1e-3
        of = signal(Pixel(0.2, 0.3, filter="after"), [0, 10_000_000, 20_000_000], light)
        for t, right in (([1e7], sent_is_right), ([], silent_is_right)):
            if right:
                verdict = judge(of, np.array(t), np.ones(len(t), int))
                assert verdict.marginal == (len(t) if abs(beyond) < 2e-6 else 0)
            else:
                with pytest.raises(Wrong):
                    judge(of, np.array(t), np.ones(len(t), int))
