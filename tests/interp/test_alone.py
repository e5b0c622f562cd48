"""What key frames say of the time between them, without events."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional as F

from interp.candidates.alone import alone, between
from interp.light import Transfer, to_light


def moved(by: int, colours: int = 3) -> torch.Tensor:
    """A texture, so many pixels to the left; [1, C, 48, 64]."""
    coarse = torch.rand(1, colours, 12, 18, generator=torch.Generator().manual_seed(1))
    whole = F.interpolate(coarse, size=(48, 80), mode="bicubic").clamp(0.05, 0.95)
    return whole[..., by : by + 64]


def test_it_is_on_its_way() -> None:
    made = alone(moved(0), moved(6), torch.tensor([[1 / 3, 2 / 3]]))
    for image, by in zip(made[0], (2, 4), strict=True):
        away = (image - moved(by)[0])[..., 8:-8, 8:-16].square().mean()
        assert float(away) < 0.05 * float((moved(0) - moved(by))[..., 8:-8, 8:-16].square().mean())


@pytest.mark.parametrize("colours", [1, 3])
def test_each_pair_is_by_itself_and_times_come_in_any_order(colours: int) -> None:
    first, last = torch.cat([moved(0, colours), moved(9, colours)]), torch.cat([moved(5, colours), moved(4, colours)])
    times = torch.tensor([[0.5, 1.0, 0.0, 0.5, 0.25], [0.9, 0.1, 0.3, 0.2, 0.6]])
    made = alone(first, last, times)
    for pair in range(2):
        for place, time in enumerate(times[pair]):
            expected = next(between(first[pair], last[pair], time[None]))
            assert torch.equal(made[pair, place], expected[0])
    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(3 if threads == 1 else 1)
        assert torch.equal(alone(first, last, times), made)
    finally:
        torch.set_num_threads(threads)
    torch.testing.assert_close(made[0, 1:3], torch.stack([last[0], first[0]]), atol=1e-6, rtol=0)


def test_codes_of_either_kind_stand_for_the_same_light() -> None:
    def of(transfer: Transfer) -> torch.Tensor:
        codes = [each if transfer == "srgb" else to_light(each, "srgb") for each in (moved(0), moved(6))]
        made = alone(*codes, torch.tensor([[0.3, 0.5]]), transfer)
        return to_light(made, transfer)

    torch.testing.assert_close(of("srgb"), of("linear"), atol=1e-5, rtol=0)


def test_it_has_no_gradients() -> None:
    first = moved(0).requires_grad_()
    assert not alone(first, moved(6), torch.tensor([[0.5]])).requires_grad
