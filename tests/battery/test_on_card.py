"""A sensor on a GPU is the sensor on a CPU: the same events, counts and state, to the bit.

But for the nanosecond in which a state has the last event: times are rounded to it, and a root that is found by code
compiled apart may be rounded the other way (seen once: of 633 events in the tail of a flash, the last one 1 ns later).

The GPU is numba's simulator: kernels are run thread by thread, and what they call is compiled for the CPU from the same
text, for one pixel per thread.  Compiling that takes 35 s of a CPU and more for a combination of effects, so all but
one are slow: `python -m pytest tests/battery/test_on_card.py -m slow`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.kernels.cuda.clips import Sent
from vid2ev.kernels.cuda.memory import Simulated
from vid2ev.sensors.batch_on_card import DvsBatchOnCard
from vid2ev.sensors.card_grids import NetCountsOnCard, VoxelsOnCard
from vid2ev.sensors.devices import memory_of, missing_for_cuda
from vid2ev.sensors.dvs import Dvs, DvsSpec
from vid2ev.sensors.dvs_on_card import DvsOnCard
from vid2ev.stream import Events, Frame
from vid2ev.stream.still import Still, strip_count
from vid2ev.views.grid import NetCounts, Windows
from vid2ev.views.voxel import Voxel

from .card_memories import memories
from .combinations import COMPILED
from .drawn_clips import SIZE, Clip, clips

pytestmark = pytest.mark.long

QUICK = ("paper",)


LABELS = {"paper": False, "everything": True}


def each_of(names: Iterable[str]) -> Any:
    """Sensors by name; those that are not quick are slow."""
    quick = [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in names]
    return pytest.mark.parametrize("name", quick)


specs, two_specs = each_of(COMPILED), each_of(("paper", "everything"))


def assert_same(one: list[Events], other: list[Events]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        for field in ("t", "x", "y", "p", "label"):
            np.testing.assert_array_equal(getattr(a, field), getattr(b, field), field)


def assert_same_state(one: Dvs, other: Dvs) -> None:
    ours, theirs = one.state(), other.state()
    assert ours.keys() == theirs.keys()
    for name, plane in ours.items():
        if name == "t_last":
            assert np.abs(plane - theirs[name]).max(initial=0) <= 1, name  # [ns]
        else:
            np.testing.assert_array_equal(plane, theirs[name], name)


def both(name: str, clip: Clip, memory: Any = None) -> tuple[Dvs, DvsOnCard]:
    spec, options = COMPILED[name], {"labels": LABELS.get(name, True), "transfer": "srgb"}
    card = DvsOnCard(spec, SIZE, clip.seed, memory=memory or Simulated(), **options)
    return Dvs(spec, SIZE, clip.seed, **options), card


def seen(dvs: Dvs, clip: Clip, first: int = 0) -> list[Events]:
    return [dvs.step(clip.frames[k], int(clip.t_ns[k])) for k in range(first, len(clip.t_ns))]


@specs
@settings(max_examples=8)
@given(data=st.data())
def test_events_counts_and_state_are_those_of_the_walk_on_a_cpu(name, data):
    clip = data.draw(clips(np.dtype(data.draw(st.sampled_from(["float32", "float64", "uint8"])))))
    cpu, card = both(name, clip)
    assert_same(seen(cpu, clip), card.steps(clip.frames, clip.t_ns))
    assert cpu.counts == card.counts
    assert_same_state(cpu, card)


def test_the_tail_of_a_flash_is_the_same() -> None:
    frames = np.zeros((4, *SIZE[::-1]), np.float32)
    frames[1, 3, 3] = frames[2, 3, 1] = np.inf
    clip = Clip(np.array([0, 1, 8, 7_498_950]), frames, 1, 0)
    cpu, card = both("paper", clip)
    assert_same(seen(cpu, clip), card.steps(clip.frames, clip.t_ns))
    assert cpu.counts == card.counts
    assert_same_state(cpu, card)


@memories
@two_specs
def test_a_state_is_taken_up_by_the_other(name, memory):
    rng = np.random.default_rng(3)
    frames = np.exp(rng.normal(0, 0.7, (9, *SIZE[::-1]))).astype(np.float32)
    clip = Clip(np.cumsum(rng.integers(3e5, 4e6, 9)), frames, 5, 11)
    cpu, card = both(name, clip, memory)
    first = clip._replace(t_ns=clip.t_ns[:5])
    whole = seen(cpu, clip)
    here, there = both(name, clip, memory)
    assert_same(seen(here, first), there.steps(frames[:5], clip.t_ns[:5]))
    cpu.restore(there.state())
    card.restore(here.state())
    assert_same(seen(cpu, clip, 5), whole[5:])
    assert_same(card.steps(frames[5:], clip.t_ns[5:]), whole[5:])
    assert sum(map(len, whole[5:])) > 100 and card.counts == cpu.counts
    cpu.forget_counts(), card.forget_counts()
    assert card.counts == cpu.counts and not any(card.counts.values())


def test_frames_with_cuts_and_with_what_is_still_are_run_as_on_a_cpu():
    rng = np.random.default_rng(7)
    light = list(np.exp(rng.normal(0, 0.7, (7, *SIZE[::-1]))).astype(np.float32))
    light[2] = light[1].copy()
    frames = [Frame(light[k], 10**6 * k, cut=k == 4) for k in range(7)]
    frames[2] = replace(frames[2], still=Still(light[1], np.ones(strip_count(*SIZE), bool)))
    cpu, card = both("paper", Clip(np.zeros(0), light[0], 0, 5))
    ours, theirs = list(card.run(frames)), list(cpu.run(frames))
    assert_same(ours, theirs)
    assert sum(map(len, ours)) > 100 and len(ours[4]) == 0


@memories
def test_frames_seen_together_are_those_seen_one_by_one(memory):
    """With cuts, one of them behind the first frame, in arrays of the host."""
    light = np.exp(np.random.default_rng(8).normal(0, 0.7, (23, *SIZE[::-1]))).astype(np.float32)
    frames = [Frame(light[k], 10**6 * k, cut=k in (1, 4)) for k in range(len(light))]
    cpu, card = both("paper", Clip(np.zeros(1), light, 0, 3), memory)
    assert_same([cpu.see(frame) for frame in frames], card.see_all(frames))
    assert cpu.counts == card.counts
    assert_same_state(cpu, card)


def test_frames_of_codes_seen_together_are_those_seen_one_by_one():
    codes = np.random.default_rng(8).integers(0, 256, (9, *SIZE[::-1])).astype(np.uint8)
    frames = [Frame(codes[k], 10**6 * k) for k in range(len(codes))]
    cpu, card = both("paper", Clip(np.zeros(1), codes, 0, 3))
    assert_same([cpu.see(frame) for frame in frames], card.see_all(frames))
    assert_same_state(cpu, card)


@memories
def test_a_sensor_of_one_pixel_is_that_of_a_cpu(memory):
    """At its first frame and after a cut, with the draws and the blind times that follow."""
    light = np.exp(np.random.default_rng(9).normal(0, 1.5, (12, 1, 1))).astype(np.float32)
    frames = [Frame(light[k], 10**6 * k, cut=k == 6) for k in range(len(light))]
    cpu = Dvs(COMPILED["paper"], (1, 1), 5, origin_ns=0)
    card = DvsOnCard(COMPILED["paper"], (1, 1), 5, memory=memory, origin_ns=0)
    ours, theirs = card.see_all(frames), cpu.see_all(frames)
    assert_same(ours, theirs)
    assert_same_state(cpu, card)
    assert sum(map(len, ours[7:])) > 0 and card.counts == cpu.counts


def test_frames_hours_apart_are_seen_as_on_a_cpu():
    """More of them than the key of an event has microseconds for."""
    frames = np.exp(np.random.default_rng(5).normal(0, 0.7, (7, *SIZE[::-1]))).astype(np.float32)
    clip = Clip(np.arange(7) * 4 * 3600 * 10**9, frames, 1, 3)
    cpu, card = both("paper", clip)
    assert_same(seen(cpu, clip), card.steps(clip.frames, clip.t_ns))
    assert_same_state(cpu, card)


@memories
@two_specs
def test_a_batch_is_its_clips_each_with_a_sensor_of_its_own(name, memory):
    rng, base, labels = np.random.default_rng(4), COMPILED[name].model_dump(), LABELS[name]
    more = {"shot_rate_hz": 300.0} if base["shot_rate_hz"] > 0 else {"mismatch": 0.05}
    changes = ({}, {"threshold_on": 0.3} | more, {"follower_tau_us": 900.0, "random_phase": False})
    sensors, seeds = [DvsSpec(**(base | change)) for change in changes], [5, 2**64 - 1, 0]
    frames = np.exp(rng.normal(0, 0.7, (7, 3, *SIZE[::-1]))).astype(np.float32)
    t_ns = np.cumsum(rng.integers(1e4, 4e6, (7, 3)), axis=0)
    batch = DvsBatchOnCard(sensors, SIZE, seeds, memory=memory, cameras=[0, 1, 2], labels=labels)
    batch.restart(frames[0], t_ns[0])
    parts = [batch.steps(frames[1:4], t_ns[1:4]), batch.steps(frames[4:], t_ns[4:])]
    for k, (spec, seed) in enumerate(zip(sensors, seeds, strict=True)):
        alone = Dvs(spec, SIZE, seed, camera=k, labels=labels)
        each = [alone.step(frames[j, k], int(t_ns[j, k])) for j in range(7)][1:]
        assert sum(map(len, each)) > 50
        assert_same(each, [events for part in parts for events in part.of(k)])


@memories
@two_specs
def test_a_batch_of_clips_that_differ_in_light_and_seed_alone(name, memory):
    rng, spec, labels = np.random.default_rng(6), COMPILED[name], LABELS[name]
    frames = np.exp(rng.normal(0, 0.7, (5, 2, *SIZE[::-1]))).astype(np.float32)
    t_ns = np.repeat(np.cumsum(rng.integers(1e4, 4e6, 5))[:, None], 2, axis=1)
    batch = DvsBatchOnCard([spec, spec], SIZE, [8, 9], memory=memory, labels=labels)
    batch.restart(frames[0], t_ns[0])
    parts = [batch.steps(frames[1:3], t_ns[1:3]), batch.steps(frames[3:], t_ns[3:])]
    for k in range(2):
        alone = Dvs(spec, SIZE, 8 + k, labels=labels)
        each = [alone.step(frames[j, k], int(t_ns[j, k])) for j in range(5)][1:]
        assert sum(map(len, each)) > 50
        assert_same(each, [events for part in parts for events in part.of(k)])


@memories
def test_grids_of_a_batch_are_those_of_its_clips(memory):
    """Counts to the bit; voxels to what float32 sums of up to N events are off by, N 2**-24 of their own size."""
    rng, spec, edges = np.random.default_rng(8), COMPILED["paper"], [1500, 2000, 2001, 4100, 9000]
    windows = [[0, 6000], [1999, 2001], [3000, 3000], [3000, 90_000]]
    frames = np.exp(rng.normal(0, 0.7, (7, 2, *SIZE[::-1]))).astype(np.float32)
    t_ns = np.repeat(np.arange(7)[:, None] * 1_000_300, 2, axis=1)
    for polarity in (False, True):
        for bins in (1, 5):
            batch = DvsBatchOnCard([spec] * 2, SIZE, [1, 2], memory=memory)
            batch.renew([spec] * 2, [8, 9])
            batch.restart(frames[0], t_ns[0])
            counts = NetCountsOnCard(memory, 2, SIZE, edges, polarity=polarity)
            voxels = VoxelsOnCard(memory, 2, SIZE, windows, bins, polarity=polarity)
            batch.fill(counts, frames[1:4], t_ns[1:4])
            batch.fill(counts, frames[4:], t_ns[4:])
            batch.renew([spec] * 2, [8, 9])
            batch.restart(frames[0], t_ns[0])
            batch.fill(voxels, frames[1:], t_ns[1:])
            ours = [memory.get(grid.take()) for grid in (counts, voxels)]
            for k in range(2):
                alone, planes = Dvs(spec, SIZE, 8 + k), NetCounts(SIZE, edges, polarity=polarity)
                views = Windows(SIZE, partial(Voxel, bins=bins, polarity=polarity), windows)
                for events in alone.steps(frames[:, k], t_ns[:, k]):
                    planes.add(events)
                    views.add(events)
                theirs = [planes.take(), views.take()]
                assert np.abs(theirs[0]).sum() > 50 and ours[0].dtype == theirs[0].dtype
                np.testing.assert_array_equal(ours[0][k], theirs[0])
                np.testing.assert_allclose(ours[1][k], theirs[1], rtol=0, atol=30 * 30 * 2.0**-24)
            assert not memory.get(counts.take()).any()


@memories
def test_events_that_find_no_room_are_walked_again(memory):
    rng = np.random.default_rng(5)
    clip = Clip(np.arange(1, 9) * 10**6, rng.random((8, *SIZE[::-1])).astype(np.float32), 1, 3)
    cpu, card = both("paper", clip, memory)
    card._card._sent = Sent(memory.zeros(7, np.uint64), memory.zeros(1, np.int64))
    assert_same(seen(cpu, clip), card.steps(clip.frames, clip.t_ns))
    assert len(card._card._sent.keys) > 7 and cpu.counts == card.counts
    assert_same_state(cpu, card)


@memories
def test_light_is_taken_however_it_lies(memory):
    """Upside down, of another byte order, read-only, of twice the digits; tensors of a network that learns."""
    light = np.random.default_rng(3).random((4, 5), dtype=np.float32)
    fixed = light.copy()
    fixed.flags.writeable = False
    learnt = torch.from_numpy(light.copy()).requires_grad_()
    others = [light.astype(">f4"), light.astype(np.float64), fixed, np.asfortranarray(light), light.tolist()]
    for given_light in (light, *others, learnt, 1.0 * learnt):
        np.testing.assert_array_equal(memory.get(memory.light(given_light)), light)
    np.testing.assert_array_equal(memory.get(memory.light(light[::-1])), light[::-1])
    assert np.isinf(memory.get(memory.light(np.array([[1e300]])))).all()


def test_lists_of_light_are_seen_as_on_a_cpu():
    light = np.exp(np.random.default_rng(2).normal(0, 0.7, (4, *SIZE[::-1])))
    cpu, card = both("paper", Clip(np.zeros(1), light, 0, 3))
    assert_same([cpu.step(light[0].tolist(), 0)], [card.step(light[0].tolist(), 0)])
    assert_same(cpu.steps(light[1:].tolist(), [1000, 2000, 3000]), card.steps(light[1:].tolist(), [1000, 2000, 3000]))
    assert_same_state(cpu, card)


def test_what_a_batch_refuses_it_has_not_seen():
    """Light of another shape or of codes, other numbers of times, times too late, and sensors that it cannot be."""
    spec, memory, hour_ns = COMPILED["paper"], Simulated(), 3600 * 10**9
    frames = np.exp(np.random.default_rng(6).normal(0, 0.7, (4, 2, *SIZE[::-1]))).astype(np.float32)
    t_ns = np.repeat(1_000_000 * np.arange(4)[:, None], 2, axis=1)
    light, codes = frames[1:], (100 * frames[1:]).astype(np.uint8)
    plain, tried = (DvsBatchOnCard([spec, spec], SIZE, [8, 9], memory=memory) for _ in range(2))
    for wrong, said in ((frames[0].swapaxes(1, 2), "shape"), (frames[0, :1], "shape"), (codes[0], "type uint8")):
        with pytest.raises(UsageError, match=f"light of {said}"):
            tried.restart(wrong, [5, 5])
    with pytest.raises(UsageError, match="at times of shape"):
        tried.restart(frames[0], [5])
    for batch in (plain, tried):
        batch.restart(frames[0], t_ns[0])
    for wrong in (light.swapaxes(2, 3), light[:, :1], codes, torch.from_numpy(codes), light[:2]):
        with pytest.raises(UsageError, match="light of"):
            tried.steps(wrong, t_ns[1:])
    for wrong_ns in (t_ns[1:] * 8 * hour_ns // 10**6, t_ns[1:] * 0, t_ns[1:, :1], t_ns[:0]):
        with pytest.raises(UsageError, match="times of"):
            tried.steps(light, wrong_ns)
    with pytest.raises(UsageError, match="different effects"):
        tried.renew([COMPILED["nothing"], spec], [1, 2])
    ours, theirs = (batch.steps(light, t_ns[1:]) for batch in (tried, plain))
    for k in range(2):
        assert_same(ours.of(k), theirs.of(k))
    assert len(ours) > 50


def test_what_cannot_be_is_said():
    with pytest.raises(UsageError, match="different effects"):
        DvsBatchOnCard([COMPILED["paper"], COMPILED["nothing"]], SIZE, [1, 2], memory=Simulated())
    with pytest.raises(UsageError, match="delay"):
        DvsBatchOnCard([DvsSpec(delay_us=3.0)], SIZE, [1], memory=Simulated())
    batch = DvsBatchOnCard([COMPILED["paper"]], SIZE, [1], memory=Simulated())
    light = np.ones((1, 1, *SIZE[::-1]), np.float32)
    with pytest.raises(UsageError, match="a batch without light"):
        batch.steps(light, [[5]])
    batch.restart(light[0], [5])
    with pytest.raises(UsageError, match="expected a later one"):
        batch.restart(light[0], [5])
    card = DvsOnCard(COMPILED["paper"], SIZE, 1, memory=Simulated())
    with pytest.raises(UsageError, match="light of shape"):
        card.steps(np.zeros((2, 3, 3), np.float32), [0, 1])
    with pytest.raises(UsageError, match="light of shape"):
        card.see_all([Frame(np.ones(shape, np.float32), k) for k, shape in enumerate([SIZE[::-1], SIZE[::-1], SIZE])])
    if missing_for_cuda():
        with pytest.raises(UsageError, match=r"device cuda: .*; use device cpu"):
            memory_of("cuda")
