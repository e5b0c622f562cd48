"""Events add up: threshold_on ON - threshold_off OFF follows the comparator's input within one threshold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from against.clips import AFTER_TRACKING, clean, feed, noisy, per_pixel, play, start
from against.reference import Pixel, Response, events, log_light, signal

VIDEOS = Path(__file__).parents[2] / "../shared/data/videos"
ON, OFF = 0.13, 0.19


def drift_of_the_signal(pixel: Pixel, t_ns, light) -> np.ndarray:
    """y(end) - y(start) per pixel, float64, the filter stepped by its closed form."""
    before = pixel.filter == "before"
    u = light.astype(np.float64)
    u = u if before else log_light(pixel, u)
    y1 = y2 = u[0]
    tau1, tau2 = pixel.photoreceptor_tau_us * 1e3, pixel.follower_tau_us * 1e3
    for k in range(len(u) - 1):
        part = Response(u[k], u[k + 1], float(t_ns[k + 1] - t_ns[k]), y1, y2, tau1, tau2)
        y1, y2 = part.first(part.T), part.value(part.T)
    return log_light(pixel, y2) - log_light(pixel, u[0]) if before else y2 - u[0]


def wander() -> tuple[np.ndarray, np.ndarray]:
    """Light that wanders over four decades, at uneven times."""
    rng = np.random.default_rng(1)
    log = np.cumsum(rng.normal(0, 0.6, (120, 24, 40)), axis=0)
    light = np.exp(np.clip(log, -7, 2.5)).astype(np.float32)
    return np.cumsum(rng.integers(20_000, 20_000_000, 120)), light


def video() -> tuple[np.ndarray, np.ndarray]:
    import av

    path = VIDEOS / "intel_car-detection.mp4"
    if not path.exists():
        pytest.skip("needs intel_car-detection.mp4 of the shared data")
    frames = []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            frames.append(frame.to_ndarray(format="gray")[100:300:2, 100:500:2])
            if len(frames) == 100:
                break
    return np.arange(len(frames)) * 80_000_000, ((np.stack(frames) / 255.0) ** 2.2).astype(np.float32)


@pytest.mark.parametrize("random_phase", [False, True])
@pytest.mark.parametrize("taus", [(0.0, 0.0), (300.0, 100.0), (20_000.0, 5_000.0)])
@pytest.mark.parametrize("order", ["before", "after"])
@pytest.mark.parametrize("clip", [wander, video])
def test_events_add_up_to_the_signal(clip, order, taus, random_phase):
    t_ns, light = clip()
    pixel = Pixel(ON, OFF, *taus, filter=order)
    keys = {"photoreceptor_tau_us": taus[0], "follower_tau_us": taus[1], "filter": order}
    dvs = start(clean(threshold_on=ON, threshold_off=OFF, random_phase=random_phase, **keys), light)
    sent = feed(dvs, t_ns, light)
    on, off = (per_pixel(sent, light.shape[1:], sent.p == p) for p in (1, 0))
    left = drift_of_the_signal(pixel, t_ns, light) - (ON * on - OFF * off)
    lowest = -(ON + OFF) if random_phase else -OFF
    assert left.max() < ON + 1e-5
    assert left.min() > lowest - 1e-5
    if clip is wander:  # tight bounds: some pixel comes near each of them
        assert left.max() > 0.8 * ON and left.min() < 0.8 * lowest
    assert dvs.counts["capped"] == 0
    assert dvs.counts["on"] == on.sum() > 1000 and dvs.counts["off"] == off.sum() > 1000


@pytest.mark.parametrize("way", [1, -1])
def test_swallowed_crossings_are_counted_in(way):
    """On light that only rises (or falls) events and swallowed crossings together add up, pixel by pixel."""
    light = np.geomspace(0.002, 1, 40)[::way].astype(np.float32)
    rng = np.random.default_rng(3)
    for _ in range(10):
        t_ns = np.cumsum(rng.integers(10_000, 2_000_000, 40))
        keys = {"photoreceptor_tau_us": 300, "follower_tau_us": 100, "refractory_us": 700}
        dvs = start(clean(threshold_on=ON, threshold_off=OFF, **keys), light[:, None, None])
        sent = feed(dvs, t_ns, light[:, None, None])
        moved = drift_of_the_signal(Pixel(ON, OFF, 300, 100), t_ns, light)
        crossed = (len(sent) + dvs.counts["swallowed"]) * (ON if way > 0 else -OFF)
        assert dvs.counts["swallowed"] > 0 and len(sent) > 2
        assert -OFF - 1e-5 < moved - crossed < ON + 1e-5


def test_swallowed_crossings_are_those_of_the_reference():
    rng = np.random.default_rng(4)
    t_ns = np.cumsum(rng.integers(100_000, 3_000_000, 40))
    light = rng.uniform(0.02, 1, (40, 1, 12)).astype(np.float32)
    pixel = Pixel(ON, OFF, 300, 100, refractory_us=500)
    dvs = start(clean(threshold_on=ON, threshold_off=OFF, photoreceptor_tau_us=300, follower_tau_us=100,
                      refractory_us=500), light)  # fmt: skip
    sent = feed(dvs, t_ns, light)
    known = [events(signal(pixel, t_ns, light[:, 0, x])) for x in range(12)]
    assert len(sent) == sum(len(found) for found, _ in known)
    assert dvs.counts["swallowed"] == sum(swallowed for _, swallowed in known) > 100


def test_a_pixel_whose_memory_jumps_to_the_signal_swallows_nothing():
    """While it is blind it sees no crossing, whatever it has just sent: also an event of the photoreceptor's noise."""
    t_ns = np.arange(0, 60_000_000, 2_000_000)
    light = np.exp(np.random.default_rng(5).normal(-1.5, 0.3, (len(t_ns), 20, 30))).astype(np.float32)
    dvs = start(AFTER_TRACKING.model_copy(update={"refractory_us": 900.0}), light)
    assert len(feed(dvs, t_ns, light)) > 1_000
    assert dvs.counts["swallowed"] == 0


def test_beyond_the_work_cap_the_rest_is_taken_in_one_step():
    """A jump of 400 crossings with a cap of 50: 50 events and one for the rest, and the memory catches up."""
    light = np.array([0.01, 0.55, 0.55, 0.01], np.float32)[:, None, None]
    t_ns = np.arange(4) * 1_000_000
    spec = clean(threshold_on=0.01, threshold_off=0.01, max_crossings=50)
    dvs = start(spec, light)
    jump = [len(dvs.step(frame, int(t))) for frame, t in zip(light, t_ns, strict=True)]
    assert jump[0] == jump[2] == 0 and 0 < jump[1] <= 51 and 0 < jump[3] <= 51
    assert dvs.counts["capped"] == 2
    # Afterwards the pixel is in step with the light: the next small change gives its own events and no more.
    more = dvs.step(np.full((1, 1), 0.0122, np.float32), 10_000_000)
    assert len(more) == pytest.approx(np.log(0.0132 / 0.011) / 0.01, abs=1.5)


def test_leak_adds_to_the_signal():
    """A static clip of 20 s at leak 3 Hz: 60 ON events per pixel, less than one more or fewer."""
    t_ns = np.arange(0, 20_000_000_001, 500_000_000)
    sent = play(noisy(leak_rate_hz=3), t_ns, np.full((len(t_ns), 4, 5), 0.3, np.float32))
    counts = per_pixel(sent, (4, 5))
    assert (np.abs(counts - 60) <= 1).all() and (sent.p == 1).all()
