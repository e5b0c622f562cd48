"""Blends: the formulas of RRIN and Super SloMo, without their divisions."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional as F

from interp.blend import blend


def two(height: int = 4, width: int = 5) -> torch.Tensor:
    return torch.rand(1, 2, 3, height, width)


def shares(t: float) -> torch.Tensor:
    return torch.tensor([[1 - t, t]])


@pytest.mark.parametrize("t", [0.1, 0.5, 0.9])
def test_it_is_rrins_quotient(t: float) -> None:
    pictures, masks = two(), 3 * torch.randn(1, 2, 4, 5)
    v0, v1 = torch.sigmoid(masks.double()).unbind(1)
    expected = ((1 - t) * v0 * pictures[:, 0] + t * v1 * pictures[:, 1]) / ((1 - t) * v0 + t * v1)
    found, weights = blend(pictures, F.logsigmoid(masks), shares(t))
    torch.testing.assert_close(found.double(), expected, rtol=0, atol=1e-6)
    torch.testing.assert_close(weights.sum(1), torch.ones(1, 4, 5))


@pytest.mark.parametrize("t", [0.1, 0.5, 0.9])
def test_it_is_super_slomos_quotient(t: float) -> None:
    pictures, mask = two(), 3 * torch.randn(1, 1, 4, 5)
    v0 = torch.sigmoid(mask.double())[:, 0]
    expected = ((1 - t) * v0 * pictures[:, 0] + t * (1 - v0) * pictures[:, 1]) / ((1 - t) * v0 + t * (1 - v0))
    found, _ = blend(pictures, torch.cat([mask, torch.zeros_like(mask)], 1), shares(t))
    torch.testing.assert_close(found.double(), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("kind", [torch.float32, torch.float16, torch.bfloat16])
@pytest.mark.parametrize("t", [0.0, 1e-7, 1.0])
@pytest.mark.parametrize("logit", [-6e4, 6e4])
def test_saturated_masks_at_the_frames_divide_nothing_by_zero(kind: torch.dtype, t: float, logit: float) -> None:
    pictures = two().requires_grad_()
    # a mask that hides the one frame that is there: the quotient would be 0 / 0
    masks = torch.full((1, 2, 4, 5), logit, dtype=kind)
    masks[:, 1] *= -1
    masks.requires_grad_()
    with torch.autocast("cpu", torch.bfloat16):
        found, _ = blend(pictures, F.logsigmoid(masks), shares(t))
    found.sum().backward()
    assert found.dtype == torch.float32 and torch.isfinite(found).all()
    assert torch.isfinite(masks.grad).all() and torch.isfinite(pictures.grad).all()


def test_at_a_frame_it_is_that_frame() -> None:
    pictures, masks = two(), torch.randn(1, 2, 4, 5)
    assert torch.equal(blend(pictures, masks, shares(0.0))[0], pictures[:, 0])
    torch.testing.assert_close(blend(pictures, masks, shares(1.0))[0], pictures[:, 1])


def test_pictures_that_are_alike_are_the_blend_to_the_bit() -> None:
    picture = torch.rand(1, 1, 3, 30, 40)
    found, _ = blend(picture.expand(-1, 3, -1, -1, -1), 5 * torch.randn(1, 3, 30, 40), torch.tensor([[0.3, 0.7, 1.0]]))
    assert torch.equal(found, picture[:, 0])


def test_what_has_no_share_has_no_weight_whatever_its_mask_says() -> None:
    pictures, masks = torch.rand(2, 3, 3, 4, 5), torch.randn(2, 3, 4, 5)
    masks[:, 2] = 50
    found, weights = blend(pictures, masks, torch.tensor([[0.5, 0.5, 0.0], [0.5, 0.5, 1.0]]))
    assert (weights[0, 2] == 0).all() and (weights[1, 2] > 0.99).all()
    torch.testing.assert_close(found[:1], blend(pictures[:1, :2], masks[:1, :2], shares(0.5))[0])
