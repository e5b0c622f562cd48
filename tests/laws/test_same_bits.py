"""The same bits for any number of threads, any cut of the recording, and whatever the other pixels do."""

from __future__ import annotations

import io

import numpy as np
import pytest
from against.clips import AFTER_TRACKING, EVERYTHING, clean, feed, per_pixel, play, start

from vid2ev.sensors.dvs import Dvs, DvsSpec
from vid2ev.sensors.presets import load_sensor
from vid2ev.stream import Events, Frame

SHAPE = (53, 71)  # neither side nor the product is a round number

SENSORS = {
    "default": DvsSpec(),
    "clean": clean(),
    "everything": EVERYTHING,
    "after, tracking": AFTER_TRACKING,
    "fixed rate": EVERYTHING.model_copy(update={"frame_rate_hz": 700.0}),
}
MORE = {
    "frame timing": EVERYTHING.model_copy(update={"timing": "frame"}),
    "linear timing": EVERYTHING.model_copy(update={"timing": "linear", "filter": "after"}),
    "v2e-noisy": load_sensor("v2e-noisy"),
}
RARE = ["after, tracking"]  # (nobody else's kernel)
sensors = pytest.mark.parametrize(
    "spec",
    [
        *(pytest.param(spec, marks=[pytest.mark.long] * (name in RARE)) for name, spec in SENSORS.items()),
        *(pytest.param(spec, marks=pytest.mark.slow) for spec in MORE.values()),
    ],
    ids=[*SENSORS, *MORE],
)


def clip(frames: int = 20, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A wandering random texture at uneven times, some intervals short enough to resolve the noise."""
    rng = np.random.default_rng(seed)
    texture = np.exp(rng.normal(-1.5, 1, (SHAPE[0], SHAPE[1] + 2 * frames)))
    light = np.stack([texture[:, 2 * k : 2 * k + SHAPE[1]] for k in range(frames)])
    dt = np.where(np.arange(frames) % 5 == 0, 7_000, rng.integers(500_000, 9_000_000, frames))
    return 3_333_333 + np.cumsum(dt), light.astype(np.float32)


def assert_same(a: Events, b: Events) -> None:
    assert len(a) == len(b)
    for name in ("t", "x", "y", "p"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert (a.label is None) == (b.label is None)
    assert a.label is None or np.array_equal(a.label, b.label)


@sensors
def test_threads_and_tiles(spec):
    t_ns, light = clip()
    one = play(spec, t_ns, light, seed=5)
    assert len(one) > 10_000
    for threads in (2, 3):
        assert_same(one, play(spec, t_ns, light, seed=5, threads=threads))


@sensors
def test_state_and_restore_through_a_file(spec):
    t_ns, light = clip()
    whole = start(spec, light, seed=5)
    want = Events.concatenate([feed(whole, t_ns, light), whole.flush()])
    parts = []
    saved: dict[str, np.ndarray] = {}
    for first, last, threads in ((0, 1, 1), (1, 9, 2), (9, 10, 1), (10, 20, 3)):
        dvs = start(spec, light, seed=5, threads=threads)
        dvs.restore(saved)
        parts.append(feed(dvs, t_ns[first:last], light[first:last]))
        file = io.BytesIO()
        np.savez(file, **dvs.state())
        file.seek(0)
        saved = dict(np.load(file, allow_pickle=False))
    parts.append(dvs.flush())
    assert_same(want, Events.concatenate(parts))
    assert dvs.counts == whole.counts


def test_a_state_is_a_copy():
    t_ns, light = clip(12)
    dvs = start(EVERYTHING, light)
    feed(dvs, t_ns[:6], light[:6])
    saved = dvs.state()
    again = {name: value.copy() for name, value in saved.items()}
    first = feed(dvs, t_ns[6:], light[6:])
    assert all(np.array_equal(saved[name], again[name], equal_nan=True) for name in again)
    dvs.restore(saved)
    assert_same(first, feed(dvs, t_ns[6:], light[6:]))


@pytest.mark.parametrize("threads", [1, 2])
def test_a_sensor_that_takes_up_a_state_forgets_its_own(threads):
    """Also what it has counted, in all of its threads."""
    t_ns, light = clip(8)
    seen, other = (start(SENSORS["fixed rate"], light, seed=5, threads=threads) for _ in range(2))
    early = feed(seen, t_ns[:4], light[:4])
    saved = seen.state()
    feed(other, t_ns, light[::-1] * 3)
    other.restore(saved)
    assert other.counts == seen.counts and len(early) > 0
    assert_same(feed(seen, t_ns[4:], light[4:]), feed(other, t_ns[4:], light[4:]))
    assert other.counts == seen.counts


@pytest.mark.parametrize("cut", [1, 2, 3, 4])
def test_noise_of_the_photoreceptor_goes_on_where_a_state_is_taken_up(cut):
    """Whether the intervals before and after resolve it or not."""
    _, light = clip(6)
    t_ns = np.cumsum([0, 5_000_000, 7_000, 7_000, 5_000_000, 7_000])
    whole, first, second = (start(EVERYTHING, light, seed=2) for _ in range(3))
    early = feed(first, t_ns[:cut], light[:cut])
    second.restore(first.state())
    both = [early, feed(second, t_ns[cut:], light[cut:])]
    assert_same(feed(whole, t_ns, light), Events.concatenate(both))
    assert all(np.array_equal(value, second.state()[name]) for name, value in whole.state().items())


@sensors
def test_run_is_step(spec):
    t_ns, light = clip()
    frames = [Frame(frame, int(t)) for t, frame in zip(t_ns, light, strict=True)]
    assert_same(play(spec, t_ns, light), Events.concatenate(start(spec, light).run(frames)))


def test_a_sensor_again_is_the_same_sensor_and_another_seed_or_camera_is_not():
    t_ns, light = clip()
    one = play(EVERYTHING, t_ns, light, seed=9)
    assert_same(one, play(EVERYTHING, t_ns, light, seed=9))
    for other in ({"seed": 10}, {"seed": 9, "camera": 1}, {"seed": 9 + 2**32}):
        assert len(play(EVERYTHING, t_ns, light, **other)) != len(one)


def test_two_sensors_at_once_do_not_disturb_each_other():
    t_ns, light = clip()
    want = play(EVERYTHING, t_ns, light, seed=1), play(SENSORS["fixed rate"], t_ns, light, seed=2)
    a, b = start(EVERYTHING, light, seed=1), start(SENSORS["fixed rate"], light, seed=2)
    parts: tuple[list, list] = ([], [])
    for t, frame in zip(t_ns, light, strict=True):
        parts[0].append(a.step(frame, int(t)))
        parts[1].append(b.step(frame, int(t)))
    parts[1].append(b.flush())
    assert_same(want[0], Events.concatenate(parts[0]))
    assert_same(want[1], Events.concatenate(parts[1]))


@sensors
def test_other_pixels_change_nothing(spec):
    """One pixel in five keeps its light; the others go from still to wild: its events stay to the bit."""
    t_ns, light = clip()
    rng = np.random.default_rng(2)
    kept = rng.random(SHAPE) < 0.2
    calm, wild = light.copy(), light.copy()
    calm[:, ~kept] = 0.1
    wild[:, ~kept] = 10 ** rng.uniform(-3, 3, (len(light), int((~kept).sum())))

    def of_the_kept(sent: Events) -> Events:
        return sent.select(kept[sent.y, sent.x])

    one = of_the_kept(play(spec, t_ns, calm, seed=3))
    assert len(one) > 1_000
    assert_same(one, of_the_kept(play(spec, t_ns, wild, seed=3)))


def test_nor_do_they_count_to_the_crossings_that_are_solved_of_a_pixel():
    """Also where its signal turns: each stretch has as many, whatever others had in the one before."""
    test_other_pixels_change_nothing(DvsSpec(max_crossings=60))


def test_a_clean_pixel_alone_sends_what_it_sends_among_others():
    t_ns, light = clip()
    spec = clean(photoreceptor_tau_us=300, follower_tau_us=100)
    sent = play(spec, t_ns, light)
    for x, y in ((0, 0), (70, 52), (31, 15), (14, 14)):
        alone = play(spec, t_ns, light[:, y : y + 1, x : x + 1])
        mine = sent.select((sent.x == x) & (sent.y == y))
        assert np.array_equal(alone.t, mine.t) and np.array_equal(alone.p, mine.p)


def test_layout_and_type_of_the_light_do_not_matter():
    t_ns, light = clip(12)
    padded = np.zeros((12, SHAPE[0], 2 * SHAPE[1]), np.float32)
    padded[..., ::2] = light
    want = play(clean(), t_ns, light)
    for same in (light.astype(np.float64), np.asfortranarray(light), padded[..., ::2], light.astype(">f4")):
        dvs = start(clean(), light)
        assert_same(want, Events.concatenate([dvs.step(f, int(t)) for t, f in zip(t_ns, same, strict=True)]))
    dvs = start(clean(), light)
    halved = [frame.astype(np.float16) for frame in light]
    sent = Events.concatenate([dvs.step(f, int(t)) for t, f in zip(t_ns, halved, strict=True)])
    assert_same(sent, play(clean(), t_ns, np.stack(halved)))


def test_the_byte_order_of_codes_does_not_matter():
    codes = np.random.default_rng(0).integers(0, 1 << 16, (6, *SHAPE)).astype(np.uint16)
    sent = []
    for same in (codes, codes.astype(">u2")):
        dvs = Dvs(clean(), SHAPE[::-1], transfer="srgb")
        sent.append(Events.concatenate(dvs.steps(same, [1_000_000 * k for k in range(6)])))
    assert len(sent[0]) > 1000
    assert_same(*sent)


def test_the_light_given_is_not_touched_nor_kept():
    t_ns, light = clip(12)
    want = play(EVERYTHING, t_ns, light)
    buffer = np.empty(SHAPE, np.float32)
    dvs = start(EVERYTHING, light)
    parts = []
    for t, frame in zip(t_ns, light, strict=True):
        buffer[...] = frame
        parts.append(dvs.step(buffer, int(t)))
        assert np.array_equal(buffer, frame)
        buffer[...] = np.nan
    assert_same(want, Events.concatenate(parts))


@sensors
def test_times_lie_in_their_interval_and_in_order(spec):
    """t in (t0, t1], ordered by (t, y, x); in fixed-rate mode only the order."""
    t_ns, light = clip()
    dvs = start(spec, light)
    before, last = None, -1
    for t, frame in zip(t_ns.tolist(), light, strict=True):
        sent = dvs.step(frame, t)
        assert sent.t.dtype == np.int64 and sent.x.dtype == sent.y.dtype == np.uint16 and sent.p.dtype == np.uint8
        if before is None:
            assert len(sent) == 0
        elif len(sent):
            key = (sent.t * SHAPE[0] + sent.y) * SHAPE[1] + sent.x
            assert (np.diff(key) >= 0).all()
            assert sent.t[0] >= last
            if spec.frame_rate_hz == 0:
                assert (sent.t * 1000 > before).all() and (sent.t * 1000 <= t).all()
            last = sent.t[-1]
        before = t


def test_seeds_up_to_64_bits_are_distinct():
    t_ns, light = clip(6)
    counts = {
        seed: per_pixel(play(DvsSpec(), t_ns, light, seed=seed), SHAPE).tobytes()
        for seed in (0, 1, 2**31, 2**32, 2**63, 2**64 - 1)
    }
    assert len(set(counts.values())) == len(counts)


def test_threads_beyond_the_pixels_are_fine():
    assert len(play(clean(), [0, 1_000_000], np.array([[[0.1]], [[1.0]]], np.float32), threads=64)) == 15
    assert isinstance(Dvs(clean(), (1, 1), threads=64), Dvs)


@pytest.mark.parametrize(
    "name", ["default", "clean", "everything", pytest.param("after, tracking", marks=pytest.mark.long)]
)
def test_after_a_restart_a_sensor_owes_nothing_to_what_was_before(name: str) -> None:
    _, (first, second, third) = clip(3)
    old, new = (start(SENSORS[name], first, seed=3, origin_ns=0) for _ in range(2))
    old.step(first, 0)
    assert len(old.step(second, 10**7)) > 0
    for dvs in (old, new):
        assert len(dvs.restart(third, 2 * 10**7)) == 0
    one, other = (dvs.step(first, 3 * 10**7) for dvs in (old, new))
    assert len(one) > 0
    assert_same(one, other)
