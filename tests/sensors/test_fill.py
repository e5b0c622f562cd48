"""Straight into grids is through events: the same planes, voxels and frames to the bit, whatever the sensor.

To the bit, because each sum has the same terms in the same order: those of a pixel come in order of time either way.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev import DvsSpec, UsageError, load_sensor
from vid2ev.sensors.batch import DvsBatch
from vid2ev.sensors.dvs import Dvs
from vid2ev.stream.events import Events
from vid2ev.views.grid import NetCounts, Windows

EVER = np.iinfo(np.int64)
SIZE, FRAMES = (61, 37), 40  # (two blocks of pixels; more frames than go through the walk at a time)
SENSORS = {
    "paper": DvsSpec(),
    "v2e-noisy": load_sensor("v2e-noisy"),
    "delayed": DvsSpec(delay_us=700.0),
    "fixed rate": DvsSpec(frame_rate_hz=900.0),
}
KINDS = ("voxel:5", "voxel:1", "voxel:3,polarity,normalised", "counts", "frame:2", "time-surface", "sae")
sensors = pytest.mark.parametrize("spec", SENSORS.values(), ids=SENSORS)


def light_of(seed: int, clips: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Light [frames, clips, height, width] that jumps here and there, at times not on microseconds."""
    rng = np.random.default_rng(seed)
    light = np.exp(np.cumsum(rng.normal(0, 0.1, (FRAMES, clips, *SIZE[::-1])), axis=0)).astype(np.float32)
    return light, 5_000_123 + np.cumsum(rng.integers(10_000, 2_000_000, (FRAMES, clips)), axis=0)


def grids(events_us: np.ndarray, rng: np.random.Generator) -> list:
    """Grids of each kind, with edges and windows anywhere, on events and off, empty ones and such as overlap."""
    first, last = int(events_us.min()), int(events_us.max())
    some = [*rng.choice(events_us, 4), *rng.integers(first - 3000, last + 3000, 4)]
    edges = np.unique(some)
    windows = [[first - 1, last], [first, first], *np.sort(rng.choice(some, (3, 2)), axis=1), [last + 10, last + 20]]
    counts = [NetCounts(SIZE, edges), NetCounts(SIZE, edges, dtype=np.int16, polarity=True)]
    return [*counts, *(Windows(SIZE, kind, windows) for kind in KINDS)]


@sensors
@settings(max_examples=6)
@given(seed=st.integers(0, 2**32), threads=st.sampled_from([1, 2]), skip=st.booleans())
def test_straight_into_grids_is_through_events(spec: DvsSpec, seed: int, threads: int, skip: bool) -> None:
    light, t_ns = light_of(seed)
    alone = Dvs(spec, SIZE, seed)
    each = [alone.step(frame[0], int(t[0])) for frame, t in zip(light, t_ns, strict=True)]
    t_us = np.concatenate([events.t for events in each])
    assert len(t_us) > 1000
    sensor = Dvs(spec, SIZE, seed, threads=threads, skip=skip)
    for through, straight in zip(*(grids(t_us, np.random.default_rng(seed)) for _ in range(2)), strict=True):
        for events in each:
            through.add(events)
        sensor.renew(spec, seed)
        sensor.fill(straight, light[:15, 0], t_ns[:15, 0])
        sensor.fill(straight, light[15:, 0], t_ns[15:, 0])
        ours, theirs = straight.take(), through.take()
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)
        assert sensor.counts == alone.counts


@sensors
def test_a_batch_is_its_clips_each_with_a_sensor_of_its_own(spec: DvsSpec) -> None:
    """With other effects, too; in new arrays and in old ones, one clip at a time and two."""
    light, t_ns = light_of(3, clips=3)
    specs, seeds, cameras = [spec, DvsSpec(threshold_on=0.3), spec], [5, 2**64 - 1, 5], [0, 0, 7]
    new = DvsBatch(specs, SIZE, seeds, cameras=cameras)
    old = DvsBatch(specs[::-1], SIZE, [1, 2, 3], threads=2)
    old.steps(light[:3], t_ns[:3])
    old.renew(specs, seeds, cameras)
    for batch in (new, old):
        batch.restart(light[0], t_ns[0])
        parts = [batch.steps(light[1:9], t_ns[1:9]), batch.steps(light[9:], t_ns[9:])]
        ours = [parts[0].of(k) + parts[1].of(k) for k in range(3)]
        for k in range(3):
            alone = Dvs(specs[k], SIZE, seeds[k], camera=cameras[k])
            each = [alone.step(frame[k], int(t[k])) for frame, t in zip(light, t_ns, strict=True)][1:]
            assert sum(map(len, each)) > 1000
            for a, b in zip(ours[k], each, strict=True):
                for name in "txyp":
                    np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        assert sum(map(len, parts)) == sum(len(events) for clip in ours for events in clip)


def test_what_a_batch_refuses_no_clip_has_seen() -> None:
    """Where times of one clip alone go back; light may be a list."""
    light, t_ns = light_of(3, clips=2)
    plain, tried = (DvsBatch([DvsSpec()] * 2, SIZE, [1, 2]) for _ in range(2))
    plain.restart(light[0], t_ns[0])
    tried.restart(light[0].tolist(), t_ns[0].tolist())
    wrong_ns = t_ns.copy()
    wrong_ns[5, 1] = wrong_ns[4, 1]
    grids_of_clips = [NetCounts(SIZE, t_ns[:, k] // 1000) for k in range(2)]
    for refused in (
        lambda: tried.steps(light[1:], wrong_ns[1:]),
        lambda: tried.fill(grids_of_clips, light[1:], wrong_ns[1:]),
        lambda: tried.restart(light[1], [int(t_ns[1, 0]), 0]),
    ):
        with pytest.raises(UsageError, match="expected a later one"):
            refused()
    ours, theirs = (batch.steps(light[1:], t_ns[1:]) for batch in (tried, plain))
    for k in range(2):
        for a, b in zip(ours.of(k), theirs.of(k), strict=True):
            np.testing.assert_array_equal(a.t, b.t)


def test_a_batch_is_renewed_by_as_many_sensors_or_stays_what_it_was() -> None:
    light, t_ns = light_of(3, clips=2)
    plain, tried = (DvsBatch([DvsSpec()] * 2, SIZE, [1, 2]) for _ in range(2))
    for batch in (plain, tried):
        batch.restart(light[0], t_ns[0])
    for many in (1, 3):
        with pytest.raises(UsageError, match="for a batch of 2 sensors: expected as many"):
            tried.renew([DvsSpec()] * many, range(many))
    ours, theirs = (batch.steps(light[1:], t_ns[1:]) for batch in (tried, plain))
    for k in range(2):
        for a, b in zip(ours.of(k), theirs.of(k), strict=True):
            np.testing.assert_array_equal(a.t, b.t)


def test_a_batch_fills_a_grid_of_each_clip() -> None:
    light, t_ns = light_of(4, clips=2)
    batch = DvsBatch([DvsSpec()] * 2, SIZE, [1, 2])
    filled = [NetCounts(SIZE, t_ns[:, k] // 1000) for k in range(2)]
    batch.fill(filled, light, t_ns)
    for k, grid in enumerate(filled):
        expected, alone = NetCounts(SIZE, t_ns[:, k] // 1000), Dvs(DvsSpec(), SIZE, 1 + k)
        for events in alone.steps(light[:, k], t_ns[:, k]):
            expected.add(events)
        planes = grid.take()
        np.testing.assert_array_equal(planes, expected.take())
        counts = alone.counts
        assert planes.sum(dtype=np.int64) == counts["on"] - counts["off"] and planes.dtype == np.int8
        assert not grid.take().any()


def test_many_blocks_of_pixels_are_filled_with_the_events_of_each_frame() -> None:
    size = (160, 128)  # ten blocks: more than go through all frames together
    light = np.exp(np.cumsum(np.random.default_rng(0).normal(0, 0.2, (5, *size[::-1])), axis=0)).astype(np.float32)
    t_ns = 3_000_000 * np.arange(1, 6)
    straight, through = (NetCounts(size, t_ns // 1000) for _ in range(2))
    Dvs(DvsSpec(), size).fill(straight, light, t_ns)
    for events in Dvs(DvsSpec(), size).steps(light, t_ns):
        through.add(events)
    np.testing.assert_array_equal(straight.take(), through.take())


def test_counts_stay_at_the_end_of_their_type() -> None:
    spec = load_sensor("ideal", ["threshold_on=0.01", "threshold_off=0.01"])
    for factor, end in ((1e4, 127), (1e-4, -128)):
        sensor, grid = Dvs(spec, (2, 1)), NetCounts((2, 1), [0, 1000])
        sensor.fill(grid, np.array([[[1.0, 1.0]], [[factor, 1.0]]]), [0, 1_000_000])
        np.testing.assert_array_equal(grid.take(), [[[end, 0]]])


def test_the_newest_event_is_the_newest_after_a_flash_of_many_decades() -> None:
    """Of light that falls by 30 decades little more than rounding is left: the levels reached in it have no times of
    their own, but an order."""
    changed = ["timing=response", "photoreceptor_tau_us=300", "follower_tau_us=100", "dark_level=1", "filter=before"]
    spec = load_sensor("ideal", [*changed, "threshold_on=0.15", "threshold_off=0.15", "max_crossings=4096"])
    t_ns = [34048913, 34048914, 34048915, 37211192, 37211193, 45870836, 145870836]
    light = np.float32([0, 1, 1e30, 1, 0, 1, 1])[:, None, None]
    events = Events.concatenate(Dvs(spec, (1, 1)).steps(light, t_ns))
    assert len(events) > 900 and len(np.unique(events.t[-20:])) < 10
    ends = np.unique(events.t)
    grid = Windows((1, 1), "sae", [[0, end] for end in ends])
    Dvs(spec, (1, 1)).fill(grid, light, t_ns)
    np.testing.assert_array_equal(grid.take().max(axis=(1, 2, 3)), ends)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_taken_is_no_more_in_a_window(kind: str) -> None:
    rng, windows = np.random.default_rng(0), [[0, 400], [300, 900]]
    old = Windows(SIZE, kind, windows)
    for count in (50, 30, 0):
        new, t = Windows(SIZE, kind, windows), np.sort(rng.integers(0, 1000, count))
        x, y, p = (rng.integers(0, most, count).astype(np.uint16) for most in (*SIZE, 2))
        for grid in (old, new):
            grid.add(Events(t, x, y, p.astype(np.uint8)))
        np.testing.assert_array_equal(old.take(), new.take())


def test_all_of_time_can_be_one_interval() -> None:
    counts = NetCounts(SIZE, [EVER.min, 0, EVER.max])
    t = np.array([-5, 0, 1, EVER.max])
    counts.add(Events(t, np.arange(4, dtype=np.uint16), np.zeros(4, np.uint16), np.array([1, 1, 1, 0], np.uint8)))
    assert counts.take().sum(axis=(1, 2)).tolist() == [2, 0]


def test_what_cannot_be_is_said() -> None:
    batch = DvsBatch([DvsSpec()] * 2, SIZE, [1, 2])
    light, t_ns = light_of(0, clips=2)
    for threads in (0, -1, 1.5, "2"):
        with pytest.raises(UsageError, match=r"threads .*expected a whole number of at least 1"):
            DvsBatch([DvsSpec()] * 2, SIZE, [1, 2], threads=threads)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="1 grid for 2 clips"):
        batch.fill([NetCounts(SIZE, [0, 1])], light, t_ns)
    with pytest.raises(UsageError, match="expected \\(frames, 2, 37, 61\\)"):
        batch.steps(light[:, :1], t_ns)
    with pytest.raises(UsageError, match="expected a later one"):
        batch.steps(light[::-1], t_ns[::-1])
    with pytest.raises(UsageError, match="expected a whole number of nanoseconds"):
        batch.steps(light, t_ns + 0.5)
    for edges_us in ([0, 5, 5], [EVER.max, EVER.min]):
        with pytest.raises(UsageError, match="each after the one before"):
            NetCounts(SIZE, edges_us)
    for times_us in (
        [0.5, 1.5],
        [0, math.nan],
        [-math.inf, 0],
        [0, 1 << 70],
        ["0", "1"],
        ["a", "b"],
        [0, [1]],
        [None, 1],
    ):
        with pytest.raises(UsageError, match="expected whole numbers of microseconds"):
            NetCounts(SIZE, times_us)  # type: ignore[arg-type]
        with pytest.raises(UsageError, match="expected whole numbers of microseconds"):
            Windows(SIZE, "counts", [times_us])  # type: ignore[list-item]
    with pytest.raises(UsageError, match="expected int8 or int16"):
        NetCounts(SIZE, [0, 5], dtype=np.uint8)
    with pytest.raises(UsageError, match="a start and a later stop"):
        Windows(SIZE, "counts", [[3, 2]])
    with pytest.raises(UsageError, match="expected counts, frame:2, voxel:5"):
        Windows(SIZE, "voxels", [[2, 3]])


def test_a_time_for_each_frame_or_nothing_is_seen() -> None:
    """Frames without a time, times without a frame, and a time that runs back after many good ones."""
    light, t_ns = light_of(0)[0][:, 0], np.arange(FRAMES) * 1_000_000
    sensor, same = Dvs(DvsSpec(), SIZE), Dvs(DvsSpec(), SIZE)
    for each in (sensor, same):
        each.step(light[0], -1_000_000)
    for some, times in ((light[:20], t_ns), (light, t_ns[:20])):
        with pytest.raises(UsageError, match=f"{len(times)} times for {len(some)} frames"):
            sensor.steps(some, times)
        with pytest.raises(UsageError, match=f"{len(times)} times for {len(some)} frames"):
            sensor.fill(NetCounts(SIZE, [0, 1]), some, times)
        with pytest.raises(UsageError, match="one for each frame and clip"):
            DvsBatch([DvsSpec()] * 2, SIZE, [1, 2]).steps(np.stack([some] * 2, 1), np.stack([times] * 2, 1))
    with pytest.raises(UsageError, match="expected a later one"):
        sensor.steps(light, [*t_ns[:-1], 0])
    with pytest.raises(UsageError, match="rows and columns"):
        sensor.steps(np.stack([light] * 2, 1), t_ns)
    for ours, others in zip(sensor.steps(light, t_ns), same.steps(light, t_ns), strict=True):
        for name in ("t", "x", "y", "p"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(others, name))
