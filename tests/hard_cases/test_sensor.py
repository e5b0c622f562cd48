"""Sensors and clips at the edge: one pixel, one frame, noise beyond the threshold, dead longer than the clip, 8K."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from against.clips import EVERYTHING, clean, feed, per_pixel, play, start, uneven
from against.reference import Pixel, events, signal
from pydantic import ValidationError

from vid2ev.errors import UsageError
from vid2ev.sensors.dvs import Dvs, DvsSpec


def test_one_pixel():
    """ln((0.8 + 0.001)/(0.1 + 0.001)) / 0.3 = 6.9: six events."""
    sent = play(clean(threshold_on=0.3), [0, 10_000_000], np.array([[[0.1]], [[0.8]]], np.float32))
    assert len(sent) == 6 and (sent.x == 0).all() and (sent.y == 0).all() and (sent.p == 1).all()


@pytest.mark.parametrize("rate_hz", [0.0, 100.0])
def test_one_frame(rate_hz):
    dvs = start(EVERYTHING.model_copy(update={"frame_rate_hz": rate_hz}), np.empty((3, 4)))
    assert len(dvs.step(np.full((3, 4), 0.5, np.float32), 123)) == 0
    assert len(dvs.flush()) == 0
    assert sum(dvs.counts.values()) == 0
    again = start(dvs.spec, np.empty((3, 4)))
    again.restore(dvs.state())
    later = [sensor.step(np.full((3, 4), 0.9, np.float32), 50_000_123) for sensor in (again, dvs)]
    assert np.array_equal(later[0].t, later[1].t)


def test_no_frame():
    dvs = Dvs(DvsSpec(), (4, 3))
    assert len(dvs.flush()) == 0 and sum(dvs.counts.values()) == 0
    assert [len(sent) for sent in dvs.run([])] == [0]
    fresh = Dvs(DvsSpec(), (4, 3))
    fresh.restore(dvs.state())
    assert len(fresh.step(np.ones((3, 4), np.float32), 5)) == 0


@pytest.mark.parametrize("size", [(1, 4096), (4096, 1), (65535, 1)])
def test_one_row_or_column(size):
    shape = (size[1], size[0])
    light = np.stack([np.full(shape, 0.1), np.full(shape, 0.8)]).astype(np.float32)
    sent = play(clean(threshold_on=0.3), [0, 1_000_000], light)
    assert (per_pixel(sent, shape) == 6).all()


@pytest.mark.parametrize("effect", ["mismatch", "crossing_noise"])
def test_noise_larger_than_the_threshold(effect):
    """sigma 0.3, threshold 0.2: no threshold reaches zero, and the mean of the thresholds stays.

    On a ramp of 40 nat the mean threshold of a pixel is 40 / events; the clip is symmetric, 0.02 ... 0.38.
    """
    spec = uneven(threshold_on=0.2, threshold_off=0.2, **{effect: 0.3})
    light = np.exp([-20.0, 20.0]).astype(np.float32)[:, None, None] * np.ones((1, 64, 64), np.float32)
    dvs = start(spec, light)
    sent = feed(dvs, [0, 10_000_000_000], light)
    assert (sent.p == 1).all() and dvs.counts["capped"] == 0
    counts = per_pixel(sent, (64, 64))
    if effect == "mismatch":
        last = np.zeros((64, 64))
        np.maximum.at(last, (sent.y, sent.x), sent.t)
        threshold = last * 4e-6 / counts
        assert threshold.min() >= 0.02 - 1e-4 and threshold.max() <= 0.38 + 1e-4
        assert threshold.mean() == pytest.approx(0.2, abs=5 * 0.16 / 64)
    else:
        assert counts.mean() == pytest.approx(200, rel=0.02)
        assert counts.max() < 400


@pytest.mark.parametrize("kind", ["quantised", pytest.param("track", marks=pytest.mark.long)])
def test_dead_time_longer_than_the_clip(kind):
    """Each pixel sends its first crossing and no more."""
    rng = np.random.default_rng(1)
    t_ns = np.arange(20) * 3_000_000
    light = 10 ** rng.uniform(-2, 0, (20, 4, 5)).astype(np.float32)
    keys = {"photoreceptor_tau_us": 300, "follower_tau_us": 100}
    dvs = start(clean(refractory_us=1e9, refractory=kind, threshold_on=0.15, threshold_off=0.15, **keys), light)
    sent = feed(dvs, t_ns, light)
    assert (per_pixel(sent, (4, 5)) == 1).all()
    swallowed = 0
    for t, x, y, p in zip(sent.t, sent.x, sent.y, sent.p, strict=True):
        first, *rest = events(signal(Pixel(0.15, 0.15, 300, 100), t_ns, light[:, y, x]))[0]
        assert first.p == p and abs(first.t - t * 1e3) <= 1e3 + 2e-6 / first.slope
        swallowed += len(rest)
    assert dvs.counts["swallowed"] == (swallowed if kind == "quantised" else 0)


@pytest.mark.parametrize("kind", ["quantised", "track"])
def test_dead_time_of_less_than_a_nanosecond_is_none(kind):
    rng = np.random.default_rng(2)
    t_ns, light = np.arange(20) * 3_000_000, 10 ** rng.uniform(-2, 0, (20, 4, 5)).astype(np.float32)
    keys = {"photoreceptor_tau_us": 300, "follower_tau_us": 100}
    sent, whole = (
        feed(start(clean(refractory_us=period_us, refractory=kind, **keys), light), t_ns, light)
        for period_us in (1e-4, 0.0)
    )
    assert len(sent) == len(whole) > 500
    ours, theirs = (per_pixel(events, (4, 5)) for events in (sent, whole))
    np.testing.assert_array_equal(ours, theirs)
    assert np.abs(sent.t - whole.t).max() <= 1


def test_dead_time_of_days_outlives_the_state():
    """The end of the dead time is kept through `state` and `restore`."""
    spec = clean(refractory_us=5e6, photoreceptor_tau_us=300, follower_tau_us=100)
    dvs = start(spec, np.empty((1, 1)))
    assert len(feed(dvs, [0, 1_000_000], np.array([[[0.1]], [[0.9]]]))) == 1
    again = start(spec, np.empty((1, 1)))
    again.restore(dvs.state())
    assert len(feed(again, [4_900_000_000], np.array([[[0.1]]]))) == 0
    assert len(feed(again, [6_000_000_000], np.array([[[0.9]]]))) == 1


@pytest.mark.parametrize(
    "keys",
    [
        {"threshold_on": 0.0},
        {"threshold_off": -0.1},
        {"threshold_on": float("nan")},
        {"mismatch": -1e-9},
        {"refractory_us": -1},
        {"photoreceptor_tau_us": float("inf")},
        {"hot_probability": 1.5},
        {"frame_rate_hz": -30},
        {"timing": "exact"},
        {"filter": "both"},
        {"photoreceptor_noise": 0.1, "follower_tau_us": 0},
        {"treshold_on": 0.2},
    ],
)
def test_impossible_parameters_are_refused_by_name(keys):
    with pytest.raises(ValidationError, match=next(iter(keys))):
        DvsSpec(**keys)


@pytest.mark.parametrize("size", [(0, 5), (5, 0), (-1, 3), (70_000, 2), (65_535, 65_535)])
def test_impossible_sizes_are_refused(size):
    with pytest.raises(UsageError, match=f"{size[0]}x{size[1]}"):
        Dvs(clean(), size)


@pytest.mark.parametrize("options", [{"seed": -1}, {"seed": 2**64}, {"camera": -1}, {"threads": 0}])
def test_impossible_options_are_refused(options):
    name, value = next(iter(options.items()))
    with pytest.raises(UsageError, match=f"{name} {value}"):
        Dvs(clean(), (2, 2), **options)


def test_a_state_of_another_size_is_refused():
    dvs = start(clean(), np.empty((300, 300)))
    feed(dvs, [0], np.ones((1, 300, 300)))
    with pytest.raises(UsageError, match="state"):
        start(clean(), np.empty((200, 200))).restore(dvs.state())


EIGHT_K = """
import json, resource, sys
import numpy as np
from vid2ev.sensors.dvs import Dvs, DvsSpec

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

spec = DvsSpec(mismatch=0, crossing_noise=0, random_phase=False, refractory_us=0)
small = Dvs(spec, (64, 64))
for k in range(3):
    small.step(np.full((64, 64), 0.5, np.float32), k * 33_000_000)
light = np.full((4320, 7680), 0.1, np.float32)
before = peak()
dvs = Dvs(spec, (7680, 4320))
sent = []
for k in range(4):
    light[2160] = 0.1 if k == 0 else 0.8
    light[4319, 7679] = 0.1 * 2**k
    sent.append(dvs.step(light, k * 33_000_000))
print(json.dumps({
    "bytes_per_pixel": (peak() - before) / light.size,
    "events": [len(part) for part in sent],
    "row": int(np.count_nonzero(sent[1].y == 2160)),
    "corner": int(np.count_nonzero((sent[1].x == 7679) & (sent[1].y == 4319))),
    "counts": dvs.counts,
}))
"""


def test_8k_frame():
    """7680x4320, one row and one corner that brighten: their events, in at most 64 bytes per pixel.

    ln(0.801/0.101)/0.15 = 13.8: 13 events in each pixel of the row; the corner doubles, ln(0.201/0.101)/0.15 = 4.6.
    """
    done = subprocess.run([sys.executable, "-c", EIGHT_K], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["row"] == 13 * 7680
    assert report["corner"] == 4
    assert report["events"][1] == 13 * 7680 + 4 and report["events"][0] == 0
    assert report["counts"]["off"] == 0
    assert report["bytes_per_pixel"] < 64


@pytest.mark.parametrize(
    "hardly",
    [{"leak_rate_hz": 1e-9}, {"refractory_us": 1e-3, "refractory": "track"}, {"crossing_noise": 1e-9}],
)
def test_each_stretch_of_an_interval_has_its_own_most_crossings(hardly):
    """A signal that goes on rising after its light is gone, and then falls: as many as it may, both ways, whatever
    goes on in the pixel beside it."""
    few = {"threshold_on": 0.05, "threshold_off": 0.05, "max_crossings": 3}
    t_ns = [0, 300_000, 300_001, 3_000_000]
    light = np.array([[0.1, 2, 0.1, 0.1], [0.1, 0.1, 0.1, 1e4]], np.float32).T.reshape(4, 1, 2)
    sent = play(clean(photoreceptor_tau_us=300, follower_tau_us=100, **few, **hardly), t_ns, light)
    assert np.count_nonzero(sent.x == 1) == 4
    sent = sent.select(sent.x == 0)
    assert (np.count_nonzero(sent.p == 1), np.count_nonzero(sent.p == 0)) == (8, 4)
