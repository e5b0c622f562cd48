"""Events of a camera that stands elsewhere are brought to where the frames have seen the same change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from interp.candidates.calibrated import calibrated
from interp.candidates.registered import registered, unexplained
from interp.light import luminance, to_light
from interp.representation.carried import Look, over, places_over
from interp.representation.event_counts import EventCounts

SIZE = 96, 128  # height, width
C = 0.1


def texture(seed: int, size: tuple[int, int]) -> torch.Tensor:
    """Smooth codes [1, 1, H, W] with details of some pixels."""
    coarse = torch.rand(1, 1, size[0] // 6, size[1] // 6, generator=torch.Generator().manual_seed(seed))
    return 0.1 + 0.8 * F.interpolate(coarse, size, mode="bicubic", align_corners=False).clamp(0, 1)


def seen(seed: int, shift: tuple[int, int], coarser: int = 1) -> tuple[torch.Tensor, torch.Tensor, EventCounts]:
    """Two frames of a texture that moves by 3 px, and what an ideal sensor counts that is `shift` px beside."""
    wide = texture(seed, (SIZE[0] + 60, SIZE[1] + 60)).expand(1, 3, -1, -1)
    first, last = (wide[..., 30 : 30 + SIZE[0], 30 + by : 30 + by + SIZE[1]] for by in (0, 3))
    x, y = 30 - shift[0], 30 - shift[1]
    linear = [wide[:, :1, y : y + SIZE[0], x + by : x + by + SIZE[1]] ** 2.2 for by in (0, 3)]
    before, after = (torch.log(F.avg_pool2d(light, coarser) + 1e-3)[:, 0] for light in linear)
    net = ((after - before) / C).round()
    off_on = torch.stack([(-net).clamp(min=0), net.clamp(min=0)], 1)[:, :, None]
    return first, last, EventCounts(off_on, torch.full((1, 2), C))


def brought(first: torch.Tensor, last: torch.Tensor, counts: EventCounts) -> EventCounts:
    """Counts at the pixels of the frames."""
    return over(registered(first, last, counts), (first.shape[2], first.shape[3]))


def apart(one: EventCounts, other: EventCounts) -> float:
    """Mean difference of counts away from the border."""
    return float((one.off_on.float() - other.off_on.float()).abs()[..., 16:-16, 16:-16].mean())


@pytest.mark.parametrize("coarser", [1, 3])
@pytest.mark.parametrize("shift", [(7, 0), (-5, 4), (0, 10)])
def test_what_is_beside_comes_to_its_place(shift: tuple[int, int], coarser: int) -> None:
    size = (SIZE[0] // coarser * coarser, SIZE[1] // coarser * coarser)
    first, last, beside = seen(1, shift, coarser)
    first, last = (each[..., : size[0], : size[1]] for each in (first, last))
    here = over(seen(1, (0, 0), coarser)[2], size)
    assert apart(brought(first, last, beside), here) < 0.35 * apart(over(beside, size), here)


@pytest.mark.parametrize("coarser", [1, 2, 3, 4])
def test_places_are_found_to_a_tenth_of_a_pixel_whatever_the_size_of_those_of_the_sensor(coarser: int) -> None:
    for seed, shift in enumerate([(7, 0), (-7, 0), (0, 6), (-6, -6)]):
        first, last, beside = seen(seed, shift, coarser)
        size = (SIZE[0] // coarser * coarser, SIZE[1] // coarser * coarser)
        first, last = (each[..., : size[0], : size[1]] for each in (first, last))
        places = registered(first, last, beside).places
        assert places is not None
        found = coarser * (places.where[0] - places_over(beside, size))[20:-20, 20:-20]
        moved = found[found.abs().amax(-1) > 1]
        assert len(moved) > found.shape[0] * found.shape[1] / 2
        np.testing.assert_allclose(moved.median(0).values, shift, atol=0.1)


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6))
def test_what_is_in_its_place_stays_there(seed: int) -> None:
    first, last, counts = seen(seed, (0, 0))
    assert apart(brought(first, last, counts), counts) < 0.02 * float(counts.off_on.mean())


def test_each_of_a_batch_is_moved_by_itself() -> None:
    made = [seen(seed, shift) for seed, shift in ((1, (6, 0)), (2, (0, -6)))]
    first, last = (torch.cat([each[k] for each in made]) for k in (0, 1))
    off_on, contrast = (torch.cat([getattr(each[2], name) for each in made]) for name in ("off_on", "contrast"))
    both = brought(first, last, EventCounts(off_on, contrast))
    for k, each in enumerate(made):
        assert torch.equal(both.off_on[k : k + 1], brought(*each).off_on)


def test_what_nobody_saw_change_is_not_moved() -> None:
    flat = torch.full((1, 3, *SIZE), 0.5)
    noise = EventCounts(torch.poisson(torch.full((1, 2, 4, *SIZE), 0.02)), torch.full((1, 2), C))
    assert torch.equal(brought(flat, flat, noise).off_on, noise.off_on)
    assert brought(flat, flat, EventCounts.none(1, (32, 43))).off_on.abs().max() == 0


def test_pictures_too_small_for_flow_are_laid_over() -> None:
    tiny = torch.rand(1, 3, 8, 8)
    counts = EventCounts(torch.randint(0, 3, (1, 2, 4, 4, 4)), torch.full((1, 2), C))
    assert torch.equal(brought(tiny, tiny, counts).off_on, over(counts, (8, 8)).off_on)


@pytest.mark.parametrize("shift", [(0, 0), (8, 0)])
def test_thresholds_that_nobody_knows_are_fitted_where_the_events_belong(shift: tuple[int, int]) -> None:
    first, last, counts = seen(3, shift)
    found = calibrated((first[0], last[0]), replace(counts, contrast=torch.full((1, 2), 0.15)), None, apart=True)
    np.testing.assert_allclose(found.contrast.numpy(), C, rtol=0.1)
    known = calibrated((first[0], last[0]), counts, (0.2, 0.3), apart=False)
    assert known.contrast.tolist() == [pytest.approx([0.2, 0.3])] and torch.equal(known.off_on, counts.off_on)


@pytest.mark.parametrize("contrast", [(C, C), None])
def test_places_that_are_known_are_where_it_is_looked_from(contrast: tuple[float, float] | None) -> None:
    """A camera that is turned upside down, and stands a little beside: no flow finds that by itself."""
    first, last, beside = seen(2, (6, 0))
    turned = replace(beside, off_on=beside.off_on.flip(-1, -2))
    rows, columns = torch.meshgrid(*(torch.arange(side - 1.0, -1.0, -1.0) for side in SIZE), indexing="ij")
    places = torch.stack([columns, rows], -1)
    here = seen(2, (0, 0))[2]
    frames, found = (first[0], last[0]), []
    for known in ([], [Look(places, exact=False)]):
        found.append(apart(over(calibrated(frames, turned, contrast, True, known), SIZE), here))
    assert found[1] < 0.35 * apart(beside, here) and found[1] < 0.5 * found[0], found
    wrong = Look(places.roll(13, 1), exact=False)
    for looks in ([wrong, Look(places, exact=False)], [Look(places, exact=False), wrong]):
        assert apart(over(calibrated(frames, turned, contrast, True, looks), SIZE), here) == found[1]
    exact = calibrated(frames, turned, contrast, True, [Look(places, exact=True)])
    assert torch.equal(over(exact, SIZE).off_on, beside.off_on)  # (nobody doubts them, whatever the frames show)
    assert torch.equal(
        calibrated(frames, beside, (C, C), False, [Look(places, exact=True)]).off_on, beside.off_on
    )  # (nothing is apart)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_events_explain_is_the_square_of_their_correlation(sign: int) -> None:
    """Also where they say that what got brighter got darker, and thresholds of both signs are not alike."""
    generator = torch.Generator().manual_seed(4)
    first, last = torch.rand(2, 1, 3, 30, 40, generator=generator)
    d = (torch.log(luminance(to_light(each, "srgb")) + 1e-3)[0, 0].numpy() for each in (last, first))
    change = np.subtract(*d)
    net = torch.from_numpy(sign * change / 0.2).round() + torch.randint(-3, 4, (30, 40), generator=generator)
    off_on = torch.stack([(-net).clamp(min=0), net.clamp(min=0)])[None, :, None]
    seen = 0.3 * off_on[0, 1, 0] - 0.1 * off_on[0, 0, 0]
    explained = np.corrcoef(change.ravel(), seen.numpy().ravel())[0, 1] ** 2
    counts = EventCounts(off_on, torch.tensor([[0.1, 0.3]]))
    assert unexplained(first, last, counts) == pytest.approx(1 - explained, abs=1e-5) and explained > 0.1
    assert unexplained(first, last, EventCounts.none(1, (30, 40))) == 1


def test_a_contrast_that_is_known_is_kept_wherever_the_events_are_brought() -> None:
    first, last, beside = seen(1, (7, 0))
    contrast = (0.07, 0.13)
    for elsewhere in (True, False):
        found = calibrated((first[0], last[0]), beside, contrast, elsewhere)
        assert found.contrast.tolist() == [pytest.approx(contrast)]
        assert (found.places is not None) == elsewhere


def test_noise_is_not_matched_with_noise() -> None:
    frames = torch.rand(2, 1, 3, *SIZE)
    noise = EventCounts(torch.poisson(torch.full((1, 2, 4, *SIZE), 0.05)), torch.full((1, 2), C))
    assert torch.equal(brought(*frames, noise).off_on, noise.off_on)


@pytest.mark.parametrize("wider", [(1, 2), (2, 1)])
@pytest.mark.parametrize("shift", [(6, 0), (0, 6)])
def test_pixels_that_are_longer_one_way_are_moved_as_far_as_others(
    wider: tuple[int, int], shift: tuple[int, int]
) -> None:
    """A sensor whose pixels are two of the frames' high, or two wide."""
    size = (SIZE[0] // 2 * 2, SIZE[1] // 2 * 2)

    def coarser(counts: EventCounts) -> EventCounts:
        parts = counts.off_on[..., : size[0], : size[1]].flatten(1, 2)
        return EventCounts(F.avg_pool2d(parts, wider).unflatten(1, (2, -1)), counts.contrast)

    first, last, beside = seen(1, shift)
    first, last = (each[..., : size[0], : size[1]] for each in (first, last))
    here = over(coarser(seen(1, (0, 0))[2]), size)
    made = brought(first, last, coarser(beside))
    assert apart(made, here) < 0.4 * apart(over(coarser(beside), size), here)
