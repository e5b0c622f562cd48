"""Slices: every event is in exactly one, edges are where the text says, and blocks do not matter."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events
from vid2ev.views.requests import parse_slicing
from vid2ev.views.slices import Area, Count, Duration, Slicing, Source

from .recordings import SIZE, events_at, recording_of

gaps = st.lists(st.integers(0, 40) | st.sampled_from([0, 0, 1, 1000]), max_size=80)
slicings = st.one_of(
    st.fractions(1, 300, max_denominator=7).map(Duration),
    st.integers(1, 30).map(Count),
    st.builds(Area, st.integers(1, 6), st.integers(1, 25)),
    st.just(Source()),
)


def cut(slicing: Slicing, recording: Recording) -> list[tuple[int, int, Events]]:
    """The slices, whole."""
    slices: list[tuple[int, int, Events]] = []
    parts: list[Events] = []
    for piece in slicing.pieces(recording):
        parts.append(piece.events)
        if piece.last:
            slices.append((piece.start_us, piece.stop_us, Events.concatenate(parts)))
            parts = []
    assert not parts
    return slices


@settings(max_examples=300)
@given(gaps=gaps, start=st.integers(-50, 2**45), early=st.integers(0, 9), late=st.integers(0, 300), slicing=slicings,
       block=st.integers(1, 90), frames=st.lists(st.integers(-100, 5000), max_size=9))  # fmt: skip
def test_every_event_is_in_one_slice_and_slices_have_no_gaps(
    gaps: list[int], start: int, early: int, late: int, slicing: Slicing, block: int, frames: list[int]
) -> None:
    t = start + early + np.cumsum(gaps, dtype=np.int64)
    events = events_at(t)
    stop = (int(t[-1]) if gaps else start) + late
    instants = [start + at for at in frames]
    slices = cut(slicing, recording_of(events, start, stop, block=block, frame_us=instants))
    whole = Events.concatenate([part for *_, part in slices])
    for name in "txyp":
        np.testing.assert_array_equal(getattr(whole, name), getattr(events, name))
    assert slices[0][0] == start
    assert all(one[1] == other[0] for one, other in pairwise(slices))
    by_time = isinstance(slicing, Duration | Source)
    for k, (start_us, stop_us, part) in enumerate(slices):
        assert start_us < stop_us or (start_us == stop_us and (not by_time or stop == start))
        if len(part):
            assert part.t[-1] <= stop_us and part.t[0] >= start_us
            assert not by_time or part.t[0] > start_us or k == 0
    if not isinstance(slicing, Duration) and sum(len(part) for *_, part in slices[-1:]) and by_time:
        assert slices[-1][1] == stop
    same = cut(slicing, recording_of(events, start, stop, block=1000, frame_us=instants))
    assert [(a, b, part.t.tolist()) for a, b, part in slices] == [(a, b, part.t.tolist()) for a, b, part in same]


@settings(max_examples=100)
@given(gaps=gaps, us=st.fractions(1, 300, max_denominator=9))
def test_durations_have_the_edges_they_should(gaps: list[int], us: Fraction) -> None:
    t = np.cumsum(gaps, dtype=np.int64)
    slices = cut(Duration(us), recording_of(events_at(t)))
    edges = [k * us.numerator // us.denominator for k in range(len(slices) + 1)]
    assert [(start, stop) for start, stop, _ in slices] == list(pairwise(edges))
    last = int(t[-1]) if gaps else 0
    assert edges[-1] >= last and (len(slices) == 1 or edges[-2] < last)  # the last, incomplete one is there; no more
    expected, _ = np.histogram(t, bins=np.array([edges[0] - 0.5, *(edge + 0.5 for edge in edges[1:])]))
    assert [len(part) for *_, part in slices] == expected.tolist()


def test_an_event_at_an_edge_is_in_the_slice_that_ends_there() -> None:
    slices = cut(Duration(Fraction(10)), recording_of(events_at([0, 10, 10, 11, 20, 20]), stop_us=20))
    assert [(start, stop, part.t.tolist()) for start, stop, part in slices] == [
        (0, 10, [0, 10, 10]),
        (10, 20, [11, 20, 20]),
    ]


def test_silence_is_given_as_empty_slices() -> None:
    slices = cut(Duration(Fraction(10)), recording_of(events_at([35]), stop_us=71))
    assert [len(part) for *_, part in slices] == [0, 0, 0, 1, 0, 0, 0, 0]
    assert [len(part) for *_, part in cut(Duration(Fraction(10)), recording_of(events_at([]), stop_us=30))] == [0, 0, 0]


def test_frames_of_the_source_make_one_slice_less() -> None:
    # Events of an interval that are sent with the frame at its end, as with `timing = frame`, belong to the interval.
    recording = recording_of(events_at([10, 20, 20, 31]), 0, 31, frame_us=[0, 10, 20, 31])
    assert [(start, stop, len(part)) for start, stop, part in cut(Source(), recording)] == [
        (0, 10, 1),
        (10, 20, 2),
        (20, 31, 1),
    ]


def test_what_lies_outside_of_the_frames_is_a_slice_as_well() -> None:
    recording = recording_of(events_at([3, 15, 25]), 0, 40, frame_us=[20, 10, 10, 90])
    assert [(start, stop, len(part)) for start, stop, part in cut(Source(), recording)] == [
        (0, 10, 1),
        (10, 20, 1),
        (20, 40, 1),
    ]


def test_areas_refuse_events_outside_of_the_sensor() -> None:
    outside = events_at([1, 2, 3], size=(9999, 9999))
    with pytest.raises(ValueError, match="outside of the 20x14 sensor"):
        list(Area(5, 4).pieces(recording_of(outside)))


def test_a_damaged_time_does_not_make_slices_without_end() -> None:
    with pytest.raises(UsageError, match="11,574 days have 100,000,000,000 of them"):
        Duration(Fraction(10_000)).pieces(recording_of(events_at([0, 10**15])))


def test_source_needs_frames() -> None:
    with pytest.raises(UsageError, match="duration:10ms"):
        list(Source().pieces(recording_of(events_at([1]))))


@settings(max_examples=60)
@given(gaps=gaps, most=st.integers(1, 30), late=st.integers(0, 9))
def test_counts_are_exact(gaps: list[int], most: int, late: int) -> None:
    t = np.cumsum(gaps, dtype=np.int64)
    stop = (int(t[-1]) if gaps else 0) + late
    slices = cut(Count(most), recording_of(events_at(t), stop_us=stop))
    whole, rest = divmod(len(t), most)
    assert [len(part) for *_, part in slices] == [most] * whole + [rest] * (rest > 0 or whole == 0)
    assert [end for _, end, _ in slices[:whole]] == t[most - 1 :: most].tolist()
    assert rest == 0 or slices[-1][1] == stop


@settings(max_examples=100)
@given(n=st.integers(0, 300), most=st.integers(1, 9), side=st.integers(1, 25), seed=st.integers(0, 99))
def test_areas_are_full_when_a_plain_count_says_so(n: int, most: int, side: int, seed: int) -> None:
    events = events_at(np.arange(n), seed=seed)
    lengths, counts, length = [], {}, 0
    for x, y in zip((events.x // side).tolist(), (events.y // side).tolist(), strict=True):
        length, counts[x, y] = length + 1, counts.get((x, y), 0) + 1
        if counts[x, y] == most:
            lengths.append(length)
            counts, length = {}, 0
    expected = lengths + [length] * (length > 0 or not lengths)
    assert [len(part) for *_, part in cut(Area(most, side), recording_of(events))] == expected


@pytest.mark.parametrize("slicing", [Duration(Fraction(10**9)), Duration(Fraction(1000)), Count(100_000), Area(500, 8)])
def test_memory_does_not_grow_with_the_recording(slicing: Slicing) -> None:
    def blocks(n: int) -> Iterator[Events]:
        for k in range(n):
            yield events_at(np.arange(k * 100_000, (k + 1) * 100_000) // 10, seed=k % 3)

    def peak(n: int) -> int:
        recording = Recording(SIZE, 0, n * 10_000, n * 100_000, lambda: blocks(n))
        tracemalloc.start()
        for _ in slicing.pieces(recording):
            pass
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(2)  # compiles
    assert peak(40) < 1.3 * peak(6) + 1e6


@pytest.mark.parametrize(
    ("text", "slicing"),
    [
        ("duration:10ms", Duration(Fraction(10_000))),
        ("duration:0.01", Duration(Fraction(10_000))),
        ("duration: 2.5 ms ", Duration(Fraction(2500))),
        ("duration:1e-2", Duration(Fraction(10_000))),
        ("duration:1/30", Duration(Fraction(10**6, 30))),
        ("duration:7us", Duration(Fraction(7))),
        ("duration:2s", Duration(Fraction(2 * 10**6))),
        ("count:50000", Count(50_000)),
        ("area:500,32", Area(500, 32)),
        ("source", Source()),
    ],
)
def test_texts_mean_what_they_say(text: str, slicing: Slicing) -> None:
    assert parse_slicing(text) == slicing
    assert parse_slicing(str(slicing)) == slicing


@pytest.mark.parametrize(
    "text",
    ["", "10ms", "duration", "duration:", "duration:0", "duration:-1", "duration:nan", "duration:inf", "duration:1/0",
     "duration:0.1us", "duration:10min", "duration:1e999999999", "duration:1e20", "duration:1000000001s", "count",
     "count:0", "count:-5", "count:1.5", "count:many", "count:9999999999999999", "area:500", "area:500,", "area:,32",
     "area:0,32", "area:500,0", "area:500,32,1", "source:3", "frames"],
)  # fmt: skip
def test_texts_that_cannot_be_meant(text: str) -> None:
    with pytest.raises(UsageError, match=r"duration:|area:|count:|10ms") as raised:
        parse_slicing(text)
    assert "\n" not in str(raised.value)
