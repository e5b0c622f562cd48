"""Warps: the very bits where nothing moves, whole shifts for whole numbers, never a place outside of the picture."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from interp.warp import flows_at, pixel_places, warp

SIZES = [(1, 1), (1, 9), (7, 1), (2, 3), (37, 53), (64, 64), (129, 257), (260, 346)]


def still(images: torch.Tensor) -> torch.Tensor:
    return images.new_zeros(len(images), 2, *images.shape[-2:])


def shifted(images: torch.Tensor, x: float, y: float, cubic: bool = False) -> torch.Tensor:
    return warp(images, still(images) + torch.tensor([x, y])[:, None, None], cubic=cubic)


def plain(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Bilinear light [H, W] at places, by the book, float64."""
    height, width = image.shape
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    a, b = x - left, y - top
    above = (1 - a) * image[top, left] + a * image[top, right]
    return (1 - b) * above + b * ((1 - a) * image[bottom, left] + a * image[bottom, right])


def plain_cubic(image: np.ndarray, x: np.ndarray, y: np.ndarray, a: float = -0.75) -> np.ndarray:
    """Light of cubic convolution, held between the four nearest pixels, by the book, float64."""
    height, width = image.shape
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)

    def weight(away: np.ndarray) -> np.ndarray:
        d = np.abs(away)
        near, far = (a + 2) * d**3 - (a + 3) * d**2 + 1, a * (d**3 - 5 * d**2 + 8 * d - 4)
        return np.where(d <= 1, near, np.where(d < 2, far, 0))

    def at(j: int, i: int) -> np.ndarray:
        return image[np.clip(top + j, 0, height - 1), np.clip(left + i, 0, width - 1)]

    four = range(-1, 3)
    light = sum(weight(y - top - j) * weight(x - left - i) * at(j, i) for j in four for i in four)
    nearest = [at(j, i) for j in (0, 1) for i in (0, 1)]
    return np.clip(light, np.min(nearest, 0), np.max(nearest, 0))


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("size", SIZES)
def test_no_flow_gives_the_very_bits(size: tuple[int, int], cubic: bool) -> None:
    images = torch.randn(2, 3, *size) * torch.logspace(-6, 6, 3)[:, None, None]
    assert torch.equal(warp(images, still(images), cubic=cubic), images)


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("shift", [(1, 0), (0, -2), (-3, 5)])
def test_whole_flow_shifts_whole_pixels(size: tuple[int, int], shift: tuple[int, int], cubic: bool) -> None:
    images = torch.rand(1, 2, *size)
    rows = (torch.arange(size[0]) + shift[1]).clamp(0, size[0] - 1)
    columns = (torch.arange(size[1]) + shift[0]).clamp(0, size[1] - 1)
    assert torch.equal(shifted(images, *shift, cubic), images[:, :, rows][..., columns])


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("size", [(31, 45), (32, 64), (1, 3), (2, 1)])
def test_any_flow_is_by_the_book(size: tuple[int, int], cubic: bool) -> None:
    random = np.random.default_rng(3)
    image, flow = random.random(size), random.normal(0, 9, (2, *size))
    y, x = np.mgrid[: size[0], : size[1]]
    found = warp(torch.tensor(image)[None, None].float(), torch.tensor(flow)[None].float(), cubic=cubic)[0, 0]
    # float32: places to 64 * 2^-24 px, codes to 2^-24, differences of codes up to 1
    expected = (plain_cubic if cubic else plain)(image, x + flow[0], y + flow[1])
    np.testing.assert_allclose(found, expected, atol=4e-5 if cubic else 2e-5)  # (cubic slopes are up to twice as steep)


def test_cubic_light_does_not_ring_beside_a_lamp() -> None:
    lamp = torch.full((1, 1, 9, 40), 0.1)
    lamp[..., 20:] = 100.0
    for shift in np.linspace(-1, 1, 21):
        seen = shifted(lamp, float(shift), 0.3, cubic=True)
        assert float(seen.min()) >= 0.1 and float(seen.max()) <= 100.0


@pytest.mark.parametrize("cubic", [False, True])
def test_many_flows_of_one_picture_are_each_as_alone(cubic: bool) -> None:
    images, flows = torch.rand(2, 3, 11, 14), 4 * torch.randn(2, 5, 2, 11, 14)
    together = warp(images, flows, cubic=cubic)
    assert together.shape == (2, 5, 3, 11, 14)
    for k in range(5):
        torch.testing.assert_close(together[:, k], warp(images, flows[:, k], cubic=cubic), rtol=0, atol=1e-6)


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("corner", [(0, 0), (3, 5), (11, 20)])
def test_a_part_is_that_of_the_whole(corner: tuple[int, int], cubic: bool) -> None:
    images, flow = torch.rand(1, 3, 17, 29), 2 * torch.randn(1, 2, 17, 29)
    (top, left), whole = corner, warp(images, flow, cubic=cubic)
    part = warp(images, flow[..., top : top + 6, left : left + 9], corner, cubic=cubic)
    torch.testing.assert_close(part, whole[..., top : top + 6, left : left + 9], rtol=0, atol=4e-6)


def test_flow_may_be_of_another_size_than_the_picture() -> None:
    images = torch.rand(1, 1, 8, 9)
    assert torch.equal(warp(images, torch.zeros(1, 2, 5, 20))[..., :9], images[:, :, :5])


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), 1e30])
def test_flow_that_cannot_be_stays_within_the_picture(wrong: float, cubic: bool) -> None:
    images = torch.rand(1, 3, 20, 30, requires_grad=True)
    flow = torch.zeros(1, 2, 20, 30)
    flow[:, :, 3:9] = wrong
    flow.requires_grad_()
    found = warp(images, flow, cubic=cubic)
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


@pytest.mark.parametrize("cubic", [False, True])
def test_gradients_are_those_of_the_function(cubic: bool) -> None:
    images = torch.rand(1, 2, 5, 6, dtype=torch.float64, requires_grad=True)
    # places away from the pixels, where slopes have a step, and from the border
    flow = (0.2 + 0.6 * torch.rand(1, 2, 5, 6, dtype=torch.float64)).neg().requires_grad_()
    assert torch.autograd.gradcheck(lambda i, f: warp(i, f, cubic=cubic)[..., 1:, 1:], (images, flow))


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
