"""Laws of single pixels are the same some rows at a time, and never see more of a picture."""

from __future__ import annotations

import pytest
import torch

from interp import rows
from interp.candidates.ramps import risen
from interp.light import to_codes, to_light
from interp.representation.event_counts import EventCounts
from interp.rows import by_rows

SIZE = 96, 64  # height, width


@pytest.mark.parametrize("shape", [(3, *SIZE), (1, 2, 3, *SIZE), (2, 1, 64)])
def test_rows_side_by_side_are_the_whole(monkeypatch: pytest.MonkeyPatch, shape: tuple[int, ...]) -> None:
    values, at_once = torch.rand(shape), 5 * values_of_a_row(shape)
    whole = by_rows(lambda part: part.sum(0, keepdim=True), values)
    monkeypatch.setattr(rows, "AT_ONCE", at_once)
    seen: list[int] = []

    def law(part: torch.Tensor) -> torch.Tensor:
        seen.append(part.numel())
        return part.sum(0, keepdim=True)

    assert torch.equal(by_rows(law, values), whole)
    assert max(seen) <= at_once and sum(seen) == values.numel()


def values_of_a_row(shape: tuple[int, ...]) -> int:
    return int(torch.tensor(shape).prod()) // shape[-2]


def test_light_codes_and_events_are_those_of_the_whole_to_the_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    codes, times = 1.4 * torch.rand(3, *SIZE) - 0.2, torch.tensor([[0.1, 0.5, 0.93]])
    counts = EventCounts(torch.poisson(torch.full((1, 2, 8, *SIZE), 0.2)).byte(), torch.tensor([[0.15, 0.2]]))

    def made() -> list[torch.Tensor]:
        found, start = risen(counts, times), torch.zeros_like(times)
        light = to_light(codes, "srgb")
        voxels, summed = counts.voxels(start, times, 3), counts.summed().off_on
        return [light, to_codes(light, "srgb"), voxels, summed, found.change, found.left, found.number, found.more]

    whole = made()
    monkeypatch.setattr(rows, "AT_ONCE", 16 * 3 * SIZE[1])  # 16 rows of the codes, and 3 of the counts
    for one, other in zip(whole, made(), strict=True):
        assert torch.equal(one, other)


def test_gradients_go_through_as_they_did(monkeypatch: pytest.MonkeyPatch) -> None:
    codes = torch.rand(3, *SIZE, requires_grad=True)
    (whole,) = torch.autograd.grad(to_light(codes, "srgb").sum(), codes)
    monkeypatch.setattr(rows, "AT_ONCE", SIZE[1])
    (made,) = torch.autograd.grad(to_light(codes, "srgb").sum(), codes)
    assert torch.equal(made, whole)
    share = torch.rand((), requires_grad=True)
    by_rows(lambda part: share * part, codes.detach()).sum().backward()
    torch.testing.assert_close(share.grad, codes.detach().sum())
