"""Warps: the very bits where nothing moves, whole shifts for whole numbers, never a place outside of the picture."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from interp.warp import flows_at, pixel_places, warp

SIZES = [(1, 1), (1, 9), (7, 1), (2, 3), (37, 53), (64, 64), (129, 257), (260, 346)]


def still(images: torch.Tensor) -> torch.Tensor:
    return images.new_zeros(len(images), 2, *images.shape[-2:])


def shifted(images: torch.Tensor, x: float, y: float) -> torch.Tensor:
    return warp(images, still(images) + torch.tensor([x, y])[:, None, None])


def plain(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Bilinear light [H, W] at places, by the book, float64."""
    height, width = image.shape
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    a, b = x - left, y - top
    above = (1 - a) * image[top, left] + a * image[top, right]
    return (1 - b) * above + b * ((1 - a) * image[bottom, left] + a * image[bottom, right])


@pytest.mark.parametrize("size", SIZES)
def test_no_flow_gives_the_very_bits(size: tuple[int, int]) -> None:
    images = torch.randn(2, 3, *size) * torch.logspace(-6, 6, 3)[:, None, None]
    assert torch.equal(warp(images, still(images)), images)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("shift", [(1, 0), (0, -2), (-3, 5)])
def test_whole_flow_shifts_whole_pixels(size: tuple[int, int], shift: tuple[int, int]) -> None:
    images = torch.rand(1, 2, *size)
    rows = (torch.arange(size[0]) + shift[1]).clamp(0, size[0] - 1)
    columns = (torch.arange(size[1]) + shift[0]).clamp(0, size[1] - 1)
    assert torch.equal(shifted(images, *shift), images[:, :, rows][..., columns])


def test_any_flow_is_bilinear() -> None:
    random = np.random.default_rng(3)
    image, flow = random.random((31, 45)), random.normal(0, 9, (2, 31, 45))
    y, x = np.mgrid[:31, :45]
    found = warp(torch.tensor(image)[None, None].float(), torch.tensor(flow)[None].float())[0, 0]
    # float32: places to 64 * 2^-24 px, codes to 2^-24, differences of codes up to 1
    np.testing.assert_allclose(found, plain(image, x + flow[0], y + flow[1]), atol=2e-5)


def test_many_flows_of_one_picture_are_each_as_alone() -> None:
    images, flows = torch.rand(2, 3, 11, 14), 4 * torch.randn(2, 5, 2, 11, 14)
    together = warp(images, flows)
    assert together.shape == (2, 5, 3, 11, 14)
    for k in range(5):
        torch.testing.assert_close(together[:, k], warp(images, flows[:, k]), rtol=0, atol=1e-6)


def test_flow_may_be_of_another_size_than_the_picture() -> None:
    images = torch.rand(1, 1, 8, 9)
    assert torch.equal(warp(images, torch.zeros(1, 2, 5, 20))[..., :9], images[:, :, :5])


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), 1e30])
def test_flow_that_cannot_be_stays_within_the_picture(wrong: float) -> None:
    images = torch.rand(1, 3, 20, 30, requires_grad=True)
    flow = torch.zeros(1, 2, 20, 30)
    flow[:, :, 3:9] = wrong
    flow.requires_grad_()
    found = warp(images, flow)
    found.sum().backward()
    assert images.grad is not None and flow.grad is not None
    assert torch.isfinite(found).all() and torch.isfinite(images.grad).all() and torch.isfinite(flow.grad).all()
    assert found.detach().min() >= images.detach().min() and found.detach().max() <= images.detach().max()
    if np.isnan(wrong):
        assert torch.equal(found, images)


@pytest.mark.parametrize("kind", [torch.float16, torch.bfloat16])
def test_autocast_does_not_reach_into_a_warp(kind: torch.dtype) -> None:
    images, flow = torch.rand(1, 1, 4, 1280), 0.25 * torch.ones(1, 2, 4, 1280)
    expected = warp(images, flow)
    with torch.autocast("cpu", kind):
        found = warp(images, flow.to(kind))
    # a normalised place in bfloat16 would be off by 2.5 px here
    assert found.dtype == torch.float32 and torch.equal(found, expected)


def test_gradients_are_those_of_the_function() -> None:
    images = torch.rand(1, 2, 5, 6, dtype=torch.float64, requires_grad=True)
    # places away from the pixels, where slopes have a step, and from the border
    flow = (0.2 + 0.6 * torch.rand(1, 2, 5, 6, dtype=torch.float64)).neg().requires_grad_()
    assert torch.autograd.gradcheck(lambda i, f: warp(i, f)[..., 1:, 1:], (images, flow))


def test_places_are_across_and_then_down() -> None:
    places = pixel_places(2, 3)
    assert places.tolist() == [[[0, 1, 2], [0, 1, 2]], [[0, 0, 0], [1, 1, 1]]]


def test_flows_at_a_time_are_those_of_straight_motion() -> None:
    forth = torch.tensor([6.0, -4.0])
    flows = torch.cat([forth, -forth])[None, :, None, None].expand(1, 4, 2, 2)
    for t in (0.0, 0.25, 0.5, 1.0):
        at = flows_at(flows, torch.tensor([[t]]))[0, 0, :, 0, 0]
        # what moves evenly by d is d t away from where it was, and d (1 - t) from where it will be
        torch.testing.assert_close(at, torch.cat([-t * forth, (1 - t) * forth]))
