"""Representations: each is what its formula says, over slices they add up, and no event is lost."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from voxel_grid import voxel_grid

from vid2ev.commands.convert import convert
from vid2ev.errors import UsageError
from vid2ev.pictures.colours import GROUND, OFF, ON, in_8_bits
from vid2ev.stream.events import Events
from vid2ev.views.counts import Counts
from vid2ev.views.frame import Frame
from vid2ev.views.representation import Kind, represent, slices_of
from vid2ev.views.requests import REPRESENTATIONS, SLICINGS, parse_representation, parse_slicing
from vid2ev.views.slices import Area, Count, Duration, Slicing
from vid2ev.views.time_surface import NEVER, ActiveEvents, TimeSurface, decayed
from vid2ev.views.voxel import Voxel

from .recordings import SIZE, events_at, recording_of

WIDTH, HEIGHT = SIZE
TEXTS = [
    "counts",
    "frame:3",
    "voxel:5",
    "voxel:4,polarity",
    "voxel:5,normalised",
    "voxel:1",
    "time-surface:30ms",
    "sae",
]


def histogram(events: Events) -> np.ndarray:
    """Counts [OFF ON, H, W] by numpy."""
    edges = [np.arange(side + 1) - 0.5 for side in (2, HEIGHT, WIDTH)]
    return np.histogramdd(np.stack([events.p, events.y, events.x], axis=1).astype(float), bins=edges)[0]


def grid_by_formula(events: Events, bins: int, start: float, stop: float, sign: np.ndarray) -> np.ndarray:
    """V(b, y, x) = sum s max(0, 1 - |b - t*|), each term on its own, in float64."""
    at = (bins - 1) * (events.t - start) / (stop - start) if stop > start else np.zeros(len(events))
    grid = np.zeros((bins, HEIGHT, WIDTH))
    for b in range(bins):
        np.add.at(grid[b], (events.y, events.x), sign * np.maximum(0, 1 - np.abs(b - at)))
    return grid


def signs(events: Events) -> np.ndarray:
    return 2.0 * events.p - 1


# ------------------------------------------------------------------------------------------------------- counts, frame


def counts_of(events: Events) -> np.ndarray:
    counts = Counts(SIZE)
    counts.add(events)
    return counts.take()


def test_counts_are_those_of_a_histogram() -> None:
    events = events_at(np.arange(5000))
    counts = counts_of(events)
    assert counts.dtype == np.uint16 and counts.shape == (2, HEIGHT, WIDTH)
    np.testing.assert_array_equal(counts, histogram(events))
    assert counts.sum() == len(events)


def test_counts_stop_at_the_most_that_they_can_hold() -> None:
    n = 70_000
    same = Events(np.arange(n), np.full(n, 3, np.uint16), np.full(n, 2, np.uint16), np.ones(n, np.uint8))
    counts = counts_of(same)
    assert counts[1, 2, 3] == 65535 and counts.sum() == 65535


@pytest.mark.parametrize("slicing", [Duration(Fraction(333)), Duration(Fraction(10**6)), Count(99), Area(20, 5)])
def test_counts_add_up_over_slices(slicing: Slicing) -> None:
    events = events_at(np.arange(5000) // 3)
    slices = list(represent(recording_of(events), slicing, Counts(SIZE)))
    np.testing.assert_array_equal(sum(array.astype(int) for _, array in slices), histogram(events))
    assert [part.events for part, _ in slices] == [int(array.sum()) for _, array in slices]
    assert [part for part, _ in slices] == list(slices_of(recording_of(events), slicing))


def test_frames_are_gray_where_nothing_happens_and_clipped_where_much_does() -> None:
    events = events_at(np.arange(3000))
    frame = Frame(SIZE, full_scale=3)
    frame.add(events)
    counts = histogram(events)
    expected = (np.clip(counts[1] - counts[0], -3, 3) + 3) / 6
    taken = frame.take()
    np.testing.assert_array_equal(taken, expected.astype(np.float32))
    assert taken.dtype == np.float32 and {taken.min(), taken.max()} == {0.0, 1.0}
    assert (frame.take() == 0.5).all()  # the next slice begins anew


@pytest.mark.parametrize("full_scale", [2**31 - 2, 10**15 - 1])
def test_frames_may_have_any_full_scale_that_can_be_asked_for(full_scale: int) -> None:
    frame = parse_representation(f"frame:{full_scale}")(SIZE)
    at = np.zeros(4, np.uint16)
    frame.add(Events(np.arange(4), at, at, np.ones(4, np.uint8)), 0, 4)
    assert (frame.take() == 0.5).all()  # four events are nothing there, of counts that have 32 bits


def test_frames_do_not_depend_on_how_events_come() -> None:
    # 5 ON and then 3 OFF make 2 in one packet or in two; clipped in between they would not.
    p = np.array([1] * 5 + [0] * 3, np.uint8)
    at = np.zeros(8, np.uint16)
    events = Events(np.arange(8), at, at, p)
    whole, parts = Frame(SIZE), Frame(SIZE)
    whole.add(events)
    for k in (slice(0, 5), slice(5, 8)):
        parts.add(events.select(k))  # type: ignore[arg-type]
    assert whole.take()[0, 0] == parts.take()[0, 0] == 1.0


# --------------------------------------------------------------------------------------------------------- voxel grids


@settings(max_examples=60)
@given(
    gaps=st.lists(st.integers(0, 30), max_size=60), bins=st.integers(1, 9), start=st.integers(-5, 2**45),
    edges=st.tuples(st.integers(0, 40), st.integers(0, 40)),
)  # fmt: skip
def test_voxel_grids_are_as_the_formula_says(gaps: list[int], bins: int, start: int, edges: tuple[int, int]) -> None:
    events = events_at(start + edges[0] + np.cumsum(gaps, dtype=np.int64))
    stop = (int(events.t[-1]) if gaps else start) + edges[1]
    grid = voxel_grid(events, SIZE, bins, start, stop)
    assert grid.shape == (bins, HEIGHT, WIDTH) and grid.dtype == np.float32
    np.testing.assert_allclose(grid, grid_by_formula(events, bins, start, stop, signs(events)), atol=1e-5)
    counts = histogram(events)
    np.testing.assert_allclose(grid.sum(axis=0), counts[1] - counts[0], atol=1e-5)  # each event is shared out whole
    apart = voxel_grid(events, SIZE, bins, start, stop, polarity=True)
    np.testing.assert_allclose(apart[1] - apart[0], grid, atol=1e-5)
    np.testing.assert_allclose(apart.sum(axis=1), counts, atol=1e-5)


def test_voxel_grids_run_from_the_first_to_the_last_event_unless_told_otherwise() -> None:
    # as the authors' code: t* = (B - 1) (t - t_first) / (t_last - t_first)
    events = events_at(np.array([100, 130, 200, 300]))
    expected = grid_by_formula(events, 5, 100, 300, signs(events))
    np.testing.assert_allclose(voxel_grid(events, SIZE), expected, atol=1e-6)
    assert not voxel_grid(Events.empty(), SIZE).any()
    same = events_at(np.array([7, 7, 7]))
    assert not voxel_grid(same, SIZE)[1:].any() and voxel_grid(same, SIZE)[0].sum() == signs(same).sum()


def test_voxel_grids_of_parts_of_a_slice_add_up() -> None:
    events = events_at(np.arange(1000))
    parts = [voxel_grid(events.select(np.arange(a, a + 250)), SIZE, 5, 0, 1000) for a in range(0, 1000, 250)]
    np.testing.assert_allclose(sum(parts), voxel_grid(events, SIZE, 5, 0, 1000), atol=1e-4)
    ((_, whole),) = represent(recording_of(events, stop_us=1000), Duration(Fraction(1000)), Voxel(SIZE))
    np.testing.assert_allclose(whole, voxel_grid(events, SIZE, 5, 0, 1000), atol=1e-4)


def test_an_event_half_way_is_shared_by_two_bins() -> None:
    one = Events(np.array([625]), np.array([4], np.uint16), np.array([5], np.uint16), np.array([0], np.uint8))
    grid = voxel_grid(one, SIZE, 5, 0, 1000)
    assert grid[:, 5, 4].tolist() == [0, 0, -0.5, -0.5, 0]


@settings(max_examples=200, deadline=None)
@given(bins=st.integers(2, 12), start=st.integers(-(10**9), 10**15), step=st.integers(1, 10**6))
@example(bins=7, start=0, step=2949)
def test_an_event_right_at_a_bin_is_in_no_other(bins: int, start: int, step: int) -> None:
    """Not even a 2e15th of it, which normalisation would take for a value."""
    events = events_at(start + step * np.arange(bins))
    grid = voxel_grid(events, SIZE, bins, start, start + (bins - 1) * step)
    expected = np.zeros_like(grid)
    expected[np.arange(bins), events.y, events.x] = signs(events)
    np.testing.assert_array_equal(grid, expected)


def test_normalised_grids_have_mean_0_and_deviation_1_where_they_are_not_0() -> None:
    events = events_at(np.arange(100))
    plain, normalised = voxel_grid(events, SIZE), voxel_grid(events, SIZE, normalised=True)
    there = plain != 0
    assert not normalised[~there].any()
    values = normalised[there].astype(float)
    assert abs(values.mean()) < 1e-6 and abs(values.std() - 1) < 1e-6
    assert np.corrcoef(values, plain[there])[0, 1] > 1 - 1e-9
    one = events.select(np.array([0]))
    assert np.abs(voxel_grid(one, SIZE, normalised=True)).sum() == 1
    assert not voxel_grid(Events.empty(), SIZE, normalised=True).any()


# ------------------------------------------------------------------------------------------------------- time surfaces


def test_time_surfaces_are_as_the_formula_says() -> None:
    late = 2**52  # where float32 and even float64 seconds would have lost the microseconds
    events = events_at(late + np.arange(0, 90_000, 100))
    surface, sae = TimeSurface(SIZE, tau_us=20_000), ActiveEvents(SIZE)
    newest = np.full((2, HEIGHT, WIDTH), NEVER)
    np.maximum.at(newest, (events.p, events.y, events.x), events.t)
    for part in (events.select(np.arange(300)), events.select(np.arange(300, len(events)))):
        surface.add(part)
        sae.add(part)
        surface.take(int(part.t[-1]))  # pixels remember over slices
    np.testing.assert_array_equal(sae.take(0), newest)
    end = late + 100_000
    expected = np.where(newest == NEVER, 0, np.exp(-(end - np.where(newest == NEVER, end, newest)) / 20_000))
    np.testing.assert_allclose(surface.take(end), expected, rtol=1e-6)
    assert surface.take(end).dtype == np.float32
    np.testing.assert_array_equal(surface.take(end), decayed(newest, end, 20_000))


def test_time_surfaces_decay_by_e_in_tau_and_start_at_1() -> None:
    one = Events(np.array([5000]), np.array([4], np.uint16), np.array([5], np.uint16), np.array([1], np.uint8))
    surface = TimeSurface(SIZE, tau_us=1000)
    surface.add(one)
    assert surface.take(5000)[1, 5, 4] == 1 and surface.take(5000).sum() == 1
    assert surface.take(6000)[1, 5, 4] == pytest.approx(np.exp(-1), rel=1e-6)


# ----------------------------------------------------------------------------------------------------------------- all


@pytest.mark.parametrize("text", TEXTS)
def test_every_representation_has_the_shape_it_says_and_a_picture(text: str) -> None:
    kind: Kind = parse_representation(text)
    view = kind(SIZE)
    view.add(events_at(np.arange(500)), 0, 500)
    array = view.take(500)
    assert array.shape == view.shape and array.dtype == view.dtype
    for shown in (array, np.zeros(view.shape, view.dtype), kind(SIZE).take(0)):
        picture = view.picture(shown)
        columns, rows = view.tiles
        assert picture.dtype == np.uint8
        assert picture.shape == (rows * (HEIGHT + 1) - 1, columns * (WIDTH + 1) - 1, 3)


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize(("x", "y"), [(WIDTH, 0), (0, HEIGHT), (65535, 65535)])
def test_events_outside_of_the_sensor_are_refused(text: str, x: int, y: int) -> None:
    outside = Events(np.array([5]), np.array([x], np.uint16), np.array([y], np.uint16), np.array([1], np.uint8))
    with pytest.raises(ValueError, match="outside of the 20x14 sensor"):
        parse_representation(text)(SIZE).add(outside, 0, 10)


@pytest.mark.parametrize("text", TEXTS)
def test_arrays_that_differ_in_length_or_point_before_the_first_pixel_are_refused(text: str) -> None:
    """Compiled code would read beyond the shorter ones, and count the others at the far edge."""
    whole = {"t": np.arange(5), "x": np.zeros(5, int), "y": np.zeros(5, int), "p": np.ones(5, int)}
    view = parse_representation(text)(SIZE)
    for name, array in whole.items():
        with pytest.raises(ValueError, match="expected one length"):
            view.add(Events(**whole | {name: array[:3]}), 0, 10)
    for name in "xy":
        with pytest.raises(ValueError, match="outside of the 20x14 sensor"):
            view.add(Events(**whole | {name: whole[name] - 1}), 0, 10)
    np.testing.assert_array_equal(view.take(10), parse_representation(text)(SIZE).take(10))


@pytest.mark.parametrize("text", ["counts", "voxel:2", "time-surface:30ms", "sae"])
def test_polarities_have_their_colours(text: str) -> None:
    many = 40
    x, y = np.repeat([2, 9], many).astype(np.uint16), np.full(2 * many, 3, np.uint16)
    view = parse_representation(text)(SIZE)
    view.add(Events(np.zeros(2 * many, np.int64), x, y, (x == 2).astype(np.uint8)), 0, 100)
    picture = view.picture(view.take(0))
    for column, colour in ((2, ON), (9, OFF), (5, GROUND)):
        np.testing.assert_allclose(picture[3, column], in_8_bits(colour), atol=1)


@pytest.mark.parametrize(
    ("said", "parse", "option"),
    [(REPRESENTATIONS, parse_representation, "frames_as"), (SLICINGS, parse_slicing, "frames_by")],
)
def test_what_a_refusal_names_is_understood_and_stands_in_the_help(said: str, parse: Any, option: str) -> None:
    named = re.split(", | or ", said)
    shown = next(each.help for each in convert.params if each.name == option)
    for text in named:
        parse(text)
        assert text.partition(":")[0] in shown


def test_all_that_a_refusal_names_are_tried() -> None:
    named, tried = (
        {text.partition(":")[0] for text in texts} for texts in (re.split(", | or ", REPRESENTATIONS), TEXTS)
    )
    assert named == tried


@pytest.mark.parametrize(
    "text",
    ["", "count", "counts:3", "frame:0", "frame:x", "frame:1.5", "voxel:0", "voxel:5,6", "voxel:5,signed", "voxel:1001",
     "time-surface:0", "time-surface:slow", "time-surface:-1ms", "sae:1", "histogram"],
)  # fmt: skip
def test_texts_that_cannot_be_meant(text: str) -> None:
    with pytest.raises(UsageError, match=r"^representation '") as raised:
        parse_representation(text)
    assert "\n" not in str(raised.value)


def test_texts_leave_out_what_is_usual() -> None:
    for short, long in (("frame", "frame:2"), ("voxel", "voxel:5"), ("time-surface", "time-surface:0.03")):
        one, other = parse_representation(short)(SIZE), parse_representation(long)(SIZE)
        for view in (one, other):
            view.add(events_at(np.arange(0, 50_000, 1000)), 0, 50_000)
        np.testing.assert_array_equal(one.take(50_000), other.take(50_000))
