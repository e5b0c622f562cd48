"""Putting events in order: whatever parts, groups and frames they are in, the answer is that of a stable sort."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vid2ev.sensors.sent as sent
from vid2ev.sensors.sent import Keys, Sent, even_cuts, in_turn

WIDTH = 53
PIXELS_OF_GROUP = 40


@given(
    groups=st.lists(st.integers(1, 3), min_size=1, max_size=4),
    last_us=st.lists(st.sampled_from([0, 1, 40, 65_535, 65_536, 3_000_000, (1 << 44) // 1000]), min_size=1, max_size=5),
    mean=st.sampled_from([0, 1, 30, 300]),
    crowded=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
    worth=st.sampled_from([(1 << 16, 1 << 18, 1 << 16), (0, 0, 200), (0, 200, 50), (0, 1 << 18, 1)]),
)
@settings(max_examples=300)
def test_ordered_by_time_row_column(groups, last_us, mean, crowded, seed, worth):
    """Events by few or many threads, frame by frame, all together or in runs of frames beside each other."""
    rng = np.random.default_rng(seed)
    first_us = rng.integers(0, 1 << 40, len(last_us))
    parts, want, begun = [], [[] for _ in last_us], 0
    for count in groups:
        runs = [[keys_of(begun + g, at_most, mean, crowded, rng) for at_most in last_us] for g in range(count)]
        ends = np.cumsum([len(run) for group in runs for run in group]).reshape(count, -1)
        others = rng.integers(0, 1 << 63, rng.integers(0, 3), np.uint64)  # behind those that are meant
        parts.append(Keys(np.concatenate([*(run for group in runs for run in group), others]), ends))
        for group in runs:
            for k, run in enumerate(group):
                want[k].append(run)
        begun += count
    with pytest.MonkeyPatch.context() as patch:
        for name, value in zip(("WORTH_WAKING", "WORTH_WAKING_THRICE", "IN_CACHE"), worth, strict=True):
            patch.setattr(sent, name, value)
        got = Sent(parts, first_us, np.array(last_us), WIDTH, labels=True).ordered(in_turn(len(parts)))
    assert len(got) == len(want)
    for events, keys, since in zip(got, map(np.concatenate, want), first_us, strict=True):
        keys = keys[np.argsort(keys >> np.uint64(3), kind="stable")].astype(np.int64)
        assert np.array_equal(events.t, since + (keys >> 28))
        assert np.array_equal(events.y * np.int64(WIDTH) + events.x, keys >> 3 & 0x1FFFFFF)
        assert np.array_equal(events.p, keys >> 2 & 1)
        assert np.array_equal(events.label, keys & 3)


@pytest.mark.timeout(100)
@pytest.mark.parametrize("last_us", [1, 70_000])
def test_however_far_out_of_order_pixels_are_it_does_not_take_long(last_us):
    """Crossings of many pixels, round after round, all in the last microsecond or two; in a square of their number this
    would take minutes."""
    pixels, rounds = 1000, 2000
    time = last_us - np.repeat([1, 0], pixels * rounds // 2)
    pixel, p = np.tile(np.arange(pixels)[::-1], rounds), np.repeat(np.arange(rounds) % 2, pixels)
    keys = (time << 28 | pixel << 3 | p << 2).astype(np.uint64)
    sent = Sent([Keys(keys, np.array([[len(keys)]]))], np.zeros(1, np.int64), np.array([last_us]), WIDTH, labels=False)
    (events,) = sent.ordered(in_turn(1))
    want = np.lexsort((pixel, time))  # (stable: of a pixel the rounds stay in order)
    assert np.array_equal(events.t, time[want]) and np.array_equal(events.p, p[want])
    assert np.array_equal(events.y * np.int64(WIDTH) + events.x, pixel[want])


def keys_of(group, last_us, mean, crowded, rng):
    """Keys of one frame of a group: ascending pixels, each with its events in order of time."""
    size = rng.poisson(mean)
    pixel = PIXELS_OF_GROUP * group + np.sort(rng.integers(0, PIXELS_OF_GROUP, size))
    time = rng.integers(0, min(last_us, 3) + 1 if crowded else last_us + 1, size)
    time = time[np.lexsort((time, pixel))]
    return (time << 28 | pixel << 3 | rng.integers(0, 8, size)).astype(np.uint64)


@given(st.lists(st.integers(0, 1000), min_size=1, max_size=20), st.integers(1, 12))
def test_even_cuts(sizes, runs):
    """Cuts are of whole frames, each run has one at the least, and none has more than its share and a frame."""
    starts = [0, *np.cumsum(sizes).tolist()]
    cuts = even_cuts(starts, runs)
    assert cuts[0] == 0 and cuts[-1] == len(sizes) and len(cuts) <= runs + 1
    assert all(a < b for a, b in pairwise(cuts))
    assert max(starts[b] - starts[a] for a, b in pairwise(cuts)) <= sum(sizes) / runs + max(sizes)
