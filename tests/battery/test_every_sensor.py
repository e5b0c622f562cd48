"""What holds of every sensor, whatever its options, its timing and the type of its light: the battery.

Each law is tried on clips that hypothesis draws: light from nothing to 1e30, steps from 1 ns to 0.1 s.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.sensors.dvs import Dvs, DvsSpec
from vid2ev.stream import Events

from .combinations import Sensor, everyday, slow_ones
from .drawn_clips import SIZE, Clip, clips

pytestmark = pytest.mark.long

NAT = 4e-6  # what float32 lets a level be off, and the margin of the scan
sensors = pytest.mark.parametrize("sensor", everyday(), ids=lambda sensor: sensor.name)


def made(sensor: Sensor, clip: Clip, **options) -> Dvs:
    return Dvs(sensor.spec, SIZE, clip.seed, labels=sensor.labels, transfer="srgb", **options)


def most_events(spec: DvsSpec, interval_ns: int) -> float:
    """Bound on the events of a pixel in an interval: three monotone stretches of `max_crossings` and the step that
    takes the rest, each; and, at ten times their rates, those that come by chance."""
    stretches = 3.0 * (spec.max_crossings + 1)
    rates_hz = spec.shot_rate_hz + spec.hot_rate_hz + spec.leak_rate_hz
    if spec.photoreceptor_noise > 0:
        rates_hz += 1e6 / np.sqrt(spec.photoreceptor_tau_us * spec.follower_tau_us)
    forced = 30.0 + 10.0 * rates_hz * interval_ns * 1e-9
    return stretches * (1.0 + forced) if spec.shot_rate_hz > 0 or spec.photoreceptor_noise > 0 else stretches + forced


def check_events(sent: Events, spec: DvsSpec, since_ns: int, until_ns: int) -> None:
    """In the frame, in order of (t, y, x), in the interval, and no more than can be."""
    width, height = SIZE
    assert (sent.x < width).all() and (sent.y < height).all() and (sent.p <= 1).all()
    place = sent.y.astype(np.int64) * width + sent.x
    if spec.delay_us > 0:  # (which lets out several intervals at once, and they may be shorter than a microsecond)
        place[:] = 0
    assert (np.diff(sent.t - sent.t[:1]) * width * height + np.diff(place) >= 0).all()
    assert sent.label is None or (len(sent.label) == len(sent) and (sent.label <= 3).all())
    if spec.delay_us == 0 and spec.frame_rate_hz == 0 and len(sent):
        first_us = since_ns // 1000
        assert sent.t[0] > first_us and sent.t[-1] <= max(until_ns // 1000, first_us + 1)
        assert np.bincount(place).max() <= most_events(spec, until_ns - since_ns)


def check_state(dvs: Dvs, spec: DvsSpec) -> None:
    """No number is missing, and each pixel that can send stands between its levels."""
    for name, plane in dvs.state().items():
        assert not np.isnan(np.asarray(plane, np.float64)).any(), name
    maps, pixels = dvs.maps(), np.arange(SIZE[0] * SIZE[1])
    filtered, signal, on, off = dvs.inside(pixels)
    assert np.isfinite(filtered).all() and np.isfinite(signal).all() and (on > off).all()
    assert (maps["threshold_on"] > 0).all() and (maps["threshold_off"] > 0).all()
    if not (spec.refractory_us > 0 and spec.refractory == "track"):  # (which sees no crossing while it is dead)
        sends = ~(maps["cold"] | maps["hot"]).ravel()
        assert (signal < on + NAT)[sends].all() and (signal > off - NAT)[sends].all()


def play(dvs: Dvs, clip: Clip, first: int = 0, last: int | None = None) -> Events:
    steps = zip(clip.frames[first:last], clip.t_ns[first:last].tolist(), strict=True)
    return Events.concatenate([dvs.step(frame, t) for frame, t in steps])


def assert_same(one: Events, other: Events) -> None:
    for name in ("t", "x", "y", "p", "label"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def hold(sensor: Sensor, clip: Clip) -> None:
    """All of it for one clip."""
    dvs, parts = made(sensor, clip), []
    for k, (frame, t_ns) in enumerate(zip(clip.frames, clip.t_ns.tolist(), strict=True)):
        parts.append(dvs.step(frame, t_ns))
        check_events(parts[-1], sensor.spec, int(clip.t_ns[max(k - 1, 0)]), t_ns)
        check_state(dvs, sensor.spec)
    parts.append(dvs.flush())
    whole = Events.concatenate(parts)
    assert dvs.counts["on"] + dvs.counts["off"] == len(whole)
    hold_bits(sensor, clip, whole, dvs)


def hold_bits(sensor: Sensor, clip: Clip, whole: Events, dvs: Dvs) -> None:
    """The same bits without sleep, and cut in two for a sensor of more threads that resumes."""
    awake = made(sensor, clip, skip=False)
    assert_same(whole, Events.concatenate([play(awake, clip), awake.flush()]))
    before, after = made(sensor, clip, threads=2), made(sensor, clip, threads=3)
    early = play(before, clip, 0, clip.cut)
    after.restore(before.state())
    assert_same(whole, Events.concatenate([early, play(after, clip, clip.cut), after.flush()]))
    assert after.counts == dvs.counts
    ours, theirs = after.state(), dvs.state()
    assert all(array.tobytes() == theirs[name].tobytes() for name, array in ours.items())


@sensors
@settings(max_examples=12, derandomize=True)
@given(data=st.data())
def test_every_sensor_stays_finite_ordered_bounded_and_the_same_to_the_bit(sensor, data):
    hold(sensor, data.draw(clips(sensor.light)))


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("sensor", slow_ones(), ids=lambda sensor: sensor.name)
@settings(max_examples=40, derandomize=True)
@given(data=st.data())
def test_every_pair_of_options_does_so_too(sensor, data):
    hold(sensor, data.draw(clips(sensor.light)))
