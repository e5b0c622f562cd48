"""A label says why an event was sent; asking for it changes nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import clean, hold, noisy, play

from vid2ev.sensors.dvs import Dvs
from vid2ev.stream.events import Label

SHAPE = (24, 24)
REST = hold(0.3, np.arange(0, 1_000_000_001, 20_000_000), SHAPE)


def moving() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    return np.arange(30) * 5_000_000, 10 ** rng.uniform(-2, 0, (30, *SHAPE)).astype(np.float32)


@pytest.mark.parametrize(
    ("keys", "label"),
    [
        ({"leak_rate_hz": 10}, Label.LEAK),
        ({"leak_rate_hz": 10, "random_phase": True}, Label.LEAK),
        pytest.param({"leak_rate_hz": 10, "timing": "linear"}, Label.LEAK, marks=pytest.mark.long),
        ({"leak_rate_hz": 200, "timing": "frame"}, Label.LEAK),  # (four at once)
        ({"shot_rate_hz": 10}, Label.SHOT),
        ({"hot_probability": 0.2, "hot_rate_hz": 100}, Label.HOT),
    ],
)
def test_at_rest_every_event_has_the_label_of_its_only_cause(keys, label):
    sent = play(noisy(**keys), *REST, labels=True)
    assert len(sent) > 1_000
    assert (sent.label == label).all() and sent.label.dtype == np.uint8


def test_leak_sends_no_off_event_and_no_second_one_at_once():
    """Light rises, and falls again, in a millisecond after rests in which the leak has sent events of its own: it may
    have made most of the way to the first ON event of a pixel, and of no other one of these."""
    levels = np.repeat([0.3, 1.2, 0.3], 40)
    t_ns = np.arange(levels.size) * 20_000_000
    t_ns[[40, 80]] = t_ns[[39, 79]] + 1_000_000
    light = np.broadcast_to(levels[:, None, None].astype(np.float32), (levels.size, *SHAPE))
    sent = play(noisy(leak_rate_hz=10, random_phase=True), t_ns, light, labels=True)
    rise, fall = (sent.select((sent.t * 1000 > t_ns[k - 1]) & (sent.t * 1000 <= t_ns[k])) for k in (40, 80))
    _, first = np.unique(rise.y * SHAPE[1] + rise.x, return_index=True)
    assert set(np.delete(rise.label, first)) == {Label.SIGNAL} and (rise.p == 1).all()
    assert set(fall.label) == {Label.SIGNAL} and (fall.p == 0).all()
    assert np.count_nonzero(sent.label == Label.LEAK) > 1_000


def test_events_of_moving_light_are_signal():
    sent = play(noisy(), *moving(), labels=True)
    assert len(sent) > 10_000
    assert (sent.label == Label.SIGNAL).all()


@pytest.mark.long
@pytest.mark.parametrize("refractory", ["quantised", "track"])
def test_hot_pixels_send_only_hot_events(refractory):
    """Also once they have been blind."""
    spec = noisy(hot_probability=1.0, hot_rate_hz=1000, refractory_us=200, refractory=refractory)
    sent = play(spec, *moving(), labels=True)
    assert (sent.label == Label.HOT).all()


def test_shot_events_in_moving_light_are_labelled_at_their_rate():
    """The shot events of a moving scene are those of the law: rate by light, signal events aside."""
    t_ns, light = moving()
    sent = play(noisy(shot_rate_hz=2000), t_ns, light, labels=True)
    mean_light = (light[1:] + light[:-1]).mean(dtype=np.float64) / 2
    expected = 2000 * (1 - 0.75 * mean_light) * t_ns[-1] * 1e-9 * light[0].size
    assert abs(np.count_nonzero(sent.label == Label.SHOT) - expected) < 5 * np.sqrt(expected)
    assert np.count_nonzero(sent.label == Label.SIGNAL) > 1_000


@pytest.mark.parametrize("rate_hz", [0.0, 500.0])
def test_labels_change_nothing_else(rate_hz):
    spec = noisy(leak_rate_hz=5, shot_rate_hz=50, hot_probability=0.05, hot_rate_hz=500, frame_rate_hz=rate_hz)
    plain, labelled = play(spec, *moving()), play(spec, *moving(), labels=True)
    assert plain.label is None and len(labelled.label) == len(labelled) == len(plain) > 5_000
    assert all(np.array_equal(getattr(plain, name), getattr(labelled, name)) for name in "txyp")
    assert {Label.SIGNAL, Label.SHOT, Label.HOT} <= set(np.unique(labelled.label))


@pytest.mark.parametrize("rate_hz", [0, 1000])
def test_no_events_are_labelled_too(rate_hz):
    dvs = Dvs(clean(frame_rate_hz=rate_hz), (3, 2), labels=True)
    still = [dvs.step(np.ones((2, 3), np.float32), k * 1_000_000) for k in range(3)]
    assert all(events.label is not None for events in [*still, dvs.flush(), dvs.flush()])


@pytest.mark.long
@pytest.mark.parametrize("timing", ["response", "linear"])
def test_what_leaks_in_a_blind_time_is_gone_when_the_memory_jumps_to_the_signal(timing):
    """A leak of a threshold a second, and 0.9 s in which the pixel is blind: 10 ms later light is the cause."""
    blind = {"refractory": "track", "refractory_us": 900_000}
    spec = clean(photoreceptor_tau_us=300, leak_rate_hz=1, threshold_on=0.2, threshold_off=0.2, timing=timing, **blind)
    light = np.array([1, 1, 1.4, 1.4, 1.4, 2], np.float32)[:, None, None]
    t_ns = [0, 10_000_000, 20_000_000, 920_000_000, 921_000_000, 931_000_000]
    sent = play(spec, t_ns, light, labels=True)
    assert sent.p.tolist() == [1, 1] and sent.label.tolist() == [Label.SIGNAL, Label.SIGNAL]
