"""Counts per sub-interval: no event lost or counted twice, and the voxels of `vid2ev.views.voxel` of any window."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from exact_voxels import exact_voxels
from hypothesis import given
from hypothesis import strategies as st
from pairs import counts, events
from voxel_grid import voxel_grid

from interp.representation.bins import bin_weights
from interp.representation.event_counts import PER_VOXEL_NATS, EventCounts, as_voxels, count_events
from vid2ev import Events, UsageError

SIZE = (6, 4)  # width, height
START, STOP = 5_000_000_000, 5_000_032_000  # us: more than float32 can tell apart


def nats(some: EventCounts) -> torch.Tensor:
    """Change of log light in each sub-interval, [B, S, H, W]."""
    off, on = some.off_on.float().unbind(1)
    down, up = some.contrast[..., None, None, None].unbind(1)
    return on * up - off * down


def windows(*edges: float) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.tensor([edges[0::2]]), torch.tensor([edges[1::2]])


@given(st.floats(0, 1), st.floats(0, 1), st.integers(1, 9), st.integers(1, 40))
def test_a_sub_interval_counts_as_much_as_lies_in_the_window(a: float, b: float, bins: int, steps: int) -> None:
    start, stop = torch.tensor([min(a, b)]), torch.tensor([max(a, b)])
    weights = bin_weights(start, stop, bins, steps)[0]
    edges = torch.arange(steps + 1, dtype=torch.float64) / steps
    within = steps * edges.clamp(float(start), float(stop)).diff()
    assert weights.shape == (bins, steps) and (weights >= -1e-6).all()
    torch.testing.assert_close(weights.double().sum(0), within, rtol=0, atol=2e-6)  # float32 weights up to 1, 9 of them


@pytest.mark.parametrize("bins", [1, 2, 5])
def test_an_empty_window_has_nothing_in_it(bins: int) -> None:
    for at in (0.0, 0.3, 1.0):
        assert (bin_weights(*windows(at, at), bins, 8) == 0).all()


@pytest.mark.parametrize("window", [(0.0, 1.0), (0.0, 0.5), (0.25, 0.5), (0.5, 1.0)])
def test_voxels_are_those_of_vid2ev_where_events_are_in_the_middle_of_sub_intervals(
    window: tuple[float, float],
) -> None:
    # and bins meet at their edges: the mean of a line over a sub-interval is its value in the middle
    middles = START + 500 + 1000 * np.random.default_rng(1).integers(0, 32, 400)
    some = events(middles, SIZE)
    start, stop = (START + round(32_000 * share) for share in window)
    kept = some.select((some.t > start) & (some.t <= stop))
    expected = voxel_grid(kept, SIZE, 5, start, stop) * np.float32(0.15 / PER_VOXEL_NATS)
    found = count_events(some, SIZE, START, STOP, 32).voxels(*windows(*window), 5)[0, 0]
    np.testing.assert_allclose(found, expected, atol=1e-5)  # sums of some 20 terms in float32
    np.testing.assert_allclose(exact_voxels(some, SIZE, start, stop), expected, atol=1e-5)


def test_more_sub_intervals_come_nearer_to_the_exact_voxels() -> None:
    some = events(np.random.default_rng(2).integers(START + 1, STOP + 1, 600), SIZE)
    exact = exact_voxels(some, SIZE, START, START + 20_000)
    errors = []
    for steps in (8, 32, 128, 512):
        found = count_events(some, SIZE, START, STOP, steps).voxels(*windows(0.0, 0.625), 5)[0, 0]
        errors.append(float((found - exact).abs().mean()))
    assert errors[3] < errors[2] < errors[1] < errors[0]
    assert errors[3] < 0.1 * errors[1]  # an event is off by up to 1 / S of the time


def test_an_event_at_an_edge_is_in_the_earlier_sub_interval_and_none_is_in_two() -> None:
    t = np.array([START, START + 1, START + 8000, START + 8001, STOP, STOP + 1])
    some = Events(t, *(np.zeros(6, np.uint16) for _ in range(2)), np.ones(6, np.uint8))
    found = count_events(some, (1, 1), START, STOP, 4).off_on
    assert found[0, 1, :, 0, 0].tolist() == [2, 1, 0, 1]  # those at START and after STOP are of other intervals
    assert found[0, 0].sum() == 0


def test_an_interval_of_no_length_has_no_events() -> None:
    some = events(np.full(5, START), SIZE)
    found = count_events(some, SIZE, START, START, 4)
    assert found.off_on.sum() == 0 and (exact_voxels(some, SIZE, START, START) == 0).all()


@pytest.mark.parametrize("kind", [np.bool_, np.uint8, np.int8, np.int64])
def test_polarity_may_be_of_any_type(kind: type) -> None:
    some = events(np.arange(START + 1, START + 200), SIZE)
    other = dataclasses.replace(some, p=some.p.astype(kind))
    found = count_events(other, SIZE, START, STOP)
    assert torch.equal(found.off_on, count_events(some, SIZE, START, STOP).off_on)
    assert found.off_on.sum((0, 2, 3, 4)).tolist() == [int((some.p == 0).sum()), int((some.p == 1).sum())]


def test_more_events_than_a_byte_holds_are_all_counted() -> None:
    t = np.full(70_000, START + 1)
    some = Events(t, *(np.zeros(70_000, np.uint16) for _ in range(2)), np.ones(70_000, np.uint8))
    found = count_events(some, (1, 1), START, STOP, 2)
    assert int(found.off_on.sum()) == 70_000
    assert float(found.change(*windows(0.0, 1.0))) == pytest.approx(0.15 * 70_000)


def test_events_outside_of_the_sensor_and_no_sub_intervals_are_refused() -> None:
    some = events(np.arange(START + 1, START + 50), SIZE)
    with pytest.raises(UsageError, match="outside of the 3x4 sensor"):
        count_events(some, (3, 4), START, STOP)
    for number in (0, 2.5, True, None):
        with pytest.raises(UsageError, match="at least 1"):
            count_events(some, SIZE, START, STOP, number)  # type: ignore[arg-type]


def test_changes_of_windows_in_a_row_add_up() -> None:
    some = counts(2, (5, 7))
    edges = torch.tensor([[0.0, 0.13, 0.5, 0.51, 1.0], [0.0, 0.3, 0.4, 0.9, 1.0]])
    parts = some.change(edges[:, :-1], edges[:, 1:])
    torch.testing.assert_close(parts.sum(1), nats(some).sum(1), rtol=0, atol=1e-5)
    number = some.number(edges[:, :-1], edges[:, 1:]).sum(1)
    torch.testing.assert_close(number, some.off_on.float().sum((1, 2)), rtol=0, atol=1e-5)


def test_time_backwards_swaps_the_halves() -> None:
    some = EventCounts(counts(2, (5, 7)).off_on, torch.tensor([[0.1, 0.2], [0.3, 0.15]]))
    times = torch.tensor([[0.2, 0.5], [0.0, 0.9]])
    forth = some.halves(times, 3)
    back = EventCounts(some.off_on.flip(1, 2), some.contrast.flip(1)).halves(1 - times, 3)  # (time runs backwards)
    torch.testing.assert_close(back, torch.cat([forth[:, :, 3:], forth[:, :, :3]], 2), rtol=0, atol=1e-5)


def test_each_pair_has_its_own_times_and_thresholds() -> None:
    some = EventCounts(counts(2, (5, 7)).off_on, torch.tensor([[0.1, 0.2], [0.3, 0.15]]))
    times = torch.tensor([[0.2, 0.5], [0.7, 0.9]])
    alone = [EventCounts(some.off_on[k : k + 1], some.contrast[k : k + 1]) for k in (0, 1)]
    together = torch.cat([one.halves(times[k : k + 1], 5) for k, one in enumerate(alone)])
    torch.testing.assert_close(some.halves(times, 5), together, rtol=0, atol=1e-6)
    change = some.change(torch.zeros(2, 1), torch.ones(2, 1))[1, 0]
    torch.testing.assert_close(change, nats(some)[1].sum(0), rtol=0, atol=1e-5)


def test_the_gain_is_fixed_and_held() -> None:
    nats = torch.tensor([0.0, 0.15, 0.3, -0.3, 1e9, -1e9])
    assert as_voxels(nats).tolist() == pytest.approx([0, 1 / 3, 2 / 3, -2 / 3, 10, -10])


@pytest.mark.parametrize("kind", [torch.float16, torch.bfloat16])
def test_autocast_does_not_reach_into_sums_of_events(kind: torch.dtype) -> None:
    some = counts(1, (5, 7), 64, 3.0)
    expected = some.whole(5)
    with torch.autocast("cpu", kind):
        assert torch.equal(some.whole(5), expected)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_normalised_voxels_of_hardly_any_events_are_finite(number: int) -> None:
    some = events(np.full(number, START + 7), SIZE)
    assert np.isfinite(voxel_grid(some, SIZE, 5, normalised=True)).all()


def test_larger_pixels_count_the_means_of_theirs() -> None:
    some = counts(1, (4, 6))
    pooled = some.pooled(2)
    torch.testing.assert_close(pooled.off_on.sum() * 4, some.off_on.float().sum())
    assert pooled.off_on.shape == (1, 2, 16, 2, 3)
    padded = some.padded(3, 1)
    assert padded.off_on.shape[-2:] == (5, 9) and padded.off_on.sum() == some.off_on.sum()


@pytest.mark.parametrize(("side", "factor"), [(641, 2), (89, 9), (7, 10)])
def test_pixels_at_the_edge_of_a_sensor_count_where_they_do_not_fill_a_larger_one(side: int, factor: int) -> None:
    one = EventCounts.none(1, (4 * factor, side))
    one.off_on[..., -1] = 1
    pooled = one.pooled(factor).off_on
    assert pooled.shape[-2:] == (4, -(-side // factor))
    torch.testing.assert_close(pooled[..., -1], torch.full_like(pooled[..., -1], 1 / (side % factor or factor)))
