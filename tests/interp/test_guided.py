"""Key frames carried to where the light of events is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from pairs import counts
from torch.nn import functional as F

from interp.around import mean_around
from interp.candidates.bridge import DARK
from interp.candidates.guided import (
    AROUND_PX,
    DARKEST,
    DOUBT_PX,
    GAMMA,
    SHARP,
    agreement,
    averaged,
    carried_off_by,
    flows_to,
    guided,
    motion_between,
    nearer,
    off_by,
    part_of,
    recoloured,
    shown_of,
)
from interp.candidates.ramps import in_doubt, ramps, risen
from interp.light import luminance, to_light
from interp.methods import Gap, open_method
from interp.networks import make
from interp.networks.gate import gate_of
from interp.networks.guide import Guide
from interp.representation.event_counts import EventCounts

SIDE, MARGIN, STEPS, C = 64, 16, 32, 0.15


def texture(colours: int = 3) -> torch.Tensor:
    generator = torch.Generator().manual_seed(3)
    coarse = torch.rand(1, colours, 14, 14, generator=generator)
    return F.interpolate(coarse, size=(SIDE + 2 * MARGIN,) * 2, mode="bicubic").clamp(0.05, 0.95)


def shifted(by: float) -> torch.Tensor:
    """The texture, so many pixels to the left; [1, 3, SIDE, SIDE]."""
    whole, part = math.floor(by), by - math.floor(by)
    picture = texture()

    def cut(first: int) -> torch.Tensor:
        return picture[..., MARGIN : MARGIN + SIDE, MARGIN + first : MARGIN + first + SIDE]

    return (1 - part) * cut(whole) + part * cut(whole + 1)


def moving(path: list[float]) -> EventCounts:
    """The events of an ideal sensor that sees the texture move; of places at the ends of equal steps."""
    logs = [torch.log(luminance(to_light(shifted(by), "srgb")) + DARK)[0, 0].numpy() for by in path]
    level, off_on = logs[0].copy(), np.zeros((1, 2, len(path) - 1, SIDE, SIDE), np.int32)
    for step, light in enumerate(logs[1:]):
        for polarity, sign in ((0, -1), (1, 1)):
            events = np.floor(np.clip(sign * (light - level) / C, 0, None)).astype(np.int32)
            off_on[0, polarity, step] = events
            level = level + sign * C * events
    return EventCounts(torch.from_numpy(off_on), torch.full((1, 2), C))


def test_frames_alike_stay_to_the_bit() -> None:
    frame = torch.rand(2, 3, 40, 48)
    found = guided(frame, frame, frame[:, None].expand(-1, 2, -1, -1, -1))
    times = torch.tensor([[0.25, 0.75]] * 2)
    assert not found.flows.any()
    torch.testing.assert_close(found.blend(times), frame[:, None].expand(-1, 2, -1, -1, -1), atol=0, rtol=0)


def test_it_finds_motion_that_turns_back_and_keeps_colours() -> None:
    # 6 px to the left and back: key frames are alike, and say nothing of what was in between
    path = [6 * math.sin(math.pi * k / STEPS) for k in range(STEPS + 1)]
    first, last, truth = shifted(path[0]), shifted(path[-1]), shifted(6)
    events, times = moving(path), torch.tensor([[0.5]])
    seen = ramps(first, last, events, times)
    made = guided(first, last, seen)
    inner = (..., slice(8, -8), slice(8, -8))
    assert float((made.flows[0, 0, 0::2] - 6)[inner].abs().median()) < 0.75  # (what is seen at x was 6 px to the right)
    assert float(made.flows[0, 0, 1::2][inner].abs().median()) < 0.25
    wrong = (seen[:, 0] - truth)[inner].square().mean()
    assert float((made.blend(times)[:, 0] - truth)[inner].square().mean()) < 0.3 * float(wrong)
    coloured = recoloured(seen, made.blend(times))
    assert float((coloured[:, 0] - truth)[inner].square().mean()) < 0.7 * float(wrong)
    light, kept = (luminance(to_light(each, "srgb")) for each in (seen, coloured))
    torch.testing.assert_close(kept, light, atol=2e-3, rtol=0)  # (colours beyond black are cut off)


def test_motion_is_the_same_whoever_looks_for_it() -> None:
    first, last = shifted(0.0), shifted(5.0)
    between = torch.stack([shifted(by) for by in (1.0, 2.5, 4.0)], 1)
    threads, found = torch.get_num_threads(), []
    try:
        for some in (1, 4):
            torch.set_num_threads(some)
            found.append(
                flows_to(first.expand(2, -1, -1, -1), last.expand(2, -1, -1, -1), between.expand(2, -1, -1, -1, -1))
            )
    finally:
        torch.set_num_threads(threads)
    assert torch.equal(*found) and found[0].shape == (2, 3, 4, SIDE, SIDE)
    inner = found[0][0, :, :, 16:-16, 16:-16].mean((-1, -2))
    assert torch.allclose(inner[:, 2] - inner[:, 0], torch.tensor(-5.0), atol=0.3)  # (from the first to the second)


def test_what_does_not_agree_counts_little() -> None:
    target = torch.full((1, 1, 3, 20, 20), 0.5)
    logits = agreement(torch.stack([target, target + 0.2], 2), shown_of(target))
    torch.testing.assert_close(logits[:, :, 0], torch.zeros(1, 1, 20, 20))
    torch.testing.assert_close(logits[:, :, 1], torch.full((1, 1, 20, 20), -40 * 0.2))


@pytest.mark.parametrize("footprint", [1, 3])
def test_of_two_pictures_the_one_counts_that_is_nearer_to_noisy_light(footprint: int) -> None:
    torch.manual_seed(0)
    truth = torch.full((1, 1, 1, 60, 60), 0.5)
    seen, off = truth + 0.03 * torch.randn_like(truth), truth.clone()
    off[..., 30:] += 0.05
    for first, second in ((truth, off), (off, truth)):
        made, agreed = nearer(first, second, shown_of(seen), footprint=footprint)
        away = (made - truth).abs()
        assert float(away[..., 45:].max()) < 0.002 > float(away[..., :15].max())
        torch.testing.assert_close(agreed, agreement(made[:, :, None], shown_of(seen), footprint=footprint))
    alike, _ = nearer(seen, seen, shown_of(truth), footprint=footprint)
    assert torch.equal(alike, seen)


def test_what_frames_say_alone_counts_where_events_are_noise() -> None:
    """Even motion, which the key frames know, and as many events of noise as of motion."""
    first, last, truth = shifted(0), shifted(4), torch.cat([shifted(1), shifted(2), shifted(3)])
    seen, times = moving([4 * k / STEPS for k in range(STEPS + 1)]), torch.tensor([0.25, 0.5, 0.75])
    noise = torch.rand(seen.off_on.shape, generator=torch.Generator().manual_seed(0)) < seen.off_on.float().mean()
    gap = Gap(first[0], last[0], replace(seen, off_on=seen.off_on + noise.int()))
    made = {name: open_method(name).between(gap, times) for name in ("flow", "bridge", "guided")}
    error = {name: float((of - truth)[..., 8:-8, 8:-8].square().mean()) for name, of in made.items()}
    assert error["flow"] < 1e-5 and error["guided"] < 0.09 * error["bridge"]  # (of frames carried by events alone .115)


def share_of(logits: torch.Tensor, pictures: torch.Tensor, doubt: torch.Tensor, footprint: int = 1) -> torch.Tensor:
    wrong, seen_wrong = off_by(shown_of(pictures), doubt, footprint=footprint)
    return part_of(wrong, carried_off_by(logits, seen_wrong, footprint))


@pytest.mark.parametrize(("doubt", "wrong"), [(0.2, 0.0), (0.2, 0.05), (0.05, 0.1), (0.02, 0.2)])
def test_the_mix_is_the_best_of_two_whose_errors_are_independent(doubt: float, wrong: float) -> None:
    """Light that is off by normal noise of a known size, and a carried picture that is off by another."""
    torch.manual_seed(0)
    truth = torch.full((1, 1, 1, 200, 200), 0.5)
    seen, carried = truth + doubt * truth / GAMMA * torch.randn_like(truth), truth + wrong * torch.randn_like(truth)
    share = share_of(agreement(carried[:, :, None], shown_of(seen)), seen, torch.full_like(seen, doubt))

    def off(share: torch.Tensor | float) -> float:
        return float((seen + share * (carried - seen) - truth).square().mean())

    # (e^2 is of 25 pixels that are around, which know it to a third: that costs a tenth of what the filter takes away)
    assert off(share) < 1.2 * min(off(k / 50) for k in range(51)) + 0.1 * off(0)


def test_what_is_certain_is_kept_and_what_agrees_is_carried() -> None:
    target = torch.full((1, 1, 1, 40, 40), 0.5)
    agrees, apart = torch.zeros(1, 1, 2, 40, 40), torch.full((1, 1, 2, 40, 40), -SHARP * 0.2)
    certain, doubted = torch.zeros_like(target), torch.full_like(target, 0.15)
    assert not share_of(apart, target, certain).any()  # flicker: both frames know nothing of it
    assert float(share_of(agrees, target, doubted).min()) > 0.98
    assert float(share_of(apart, target, doubted).max()) < 0.03


def test_a_pixel_with_an_event_of_noise_is_carried_and_those_around_it_are_as_sure_as_before() -> None:
    """One that tells what no key frame knows, where all others agree: the doubt is its own."""
    target, doubt = torch.full((1, 1, 1, 41, 41), 0.5), torch.full((1, 1, 1, 41, 41), 0.01)
    lone = doubt.clone()
    lone[..., 20, 20] = 0.2
    noisy = target.clone()
    noisy[..., 20, 20] += 0.05
    agreed = agreement(target[:, :, None], shown_of(noisy))
    before, after = (share_of(agreed, noisy, each) for each in (doubt, lone))
    assert float(before[0, 0, 0, 20, 20]) < 0.5 < 0.95 < float(after[0, 0, 0, 20, 20])
    torch.testing.assert_close(after[0, 0, 0, 0], before[0, 0, 0, 0])


def test_light_of_coarse_pixels_is_in_doubt_by_what_it_does_not_show() -> None:
    target = torch.full((1, 1, 1, 60, 60), 0.5)
    stripes = 0.3 * (torch.arange(60) % 2 * 2 - 1.0).expand_as(target)  # as fine as pixels: nothing is left of 2 x 2
    agrees = torch.zeros(1, 1, 2, 60, 60)
    apart = agrees - SHARP / 2**0.5 * 0.02
    fine, coarse = (share_of(apart, target, stripes, footprint=each).mean() for each in (1, 2))
    assert 0.6 < float(fine) <= 1 and float(coarse) > 0.85
    even = share_of(apart, target, torch.full_like(target, 0.02), footprint=2)
    assert float(even.max()) < 0.1


def over_squares(maps: np.ndarray, reach: int) -> np.ndarray:
    """Means over the squares of so many pixels on each side of each of a map; at edges over what there is."""
    padded = np.pad(maps.astype(np.float64), reach, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1,) * 2)
    return np.nanmean(windows, axis=(2, 3))


@given(k=st.integers(1, 9), side=st.tuples(st.integers(1, 12), st.integers(1, 12)))
def test_means_of_coarse_pixels_are_around_each_and_lean_to_no_side(k: int, side: tuple[int, int]) -> None:
    values = torch.rand(2, 1, *side, generator=torch.Generator().manual_seed(k))
    torch.testing.assert_close(averaged(values.flip(-1, -2), k), averaged(values, k).flip(-1, -2))
    torch.testing.assert_close(averaged(values.mT, k), averaged(values, k).mT)
    slope = torch.arange(40.0).expand(1, 3, 40)
    torch.testing.assert_close(averaged(slope, k)[..., k:-k], slope[..., k:-k])


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_what_is_off_and_what_is_believed_is_as_the_docstring_has_it(k: int) -> None:
    """Where a pixel of the event camera is k pixels of the frames wide; of grey codes, some of them black."""
    draw = np.random.default_rng(k)
    picture = np.where(draw.random((40, 50)) < 0.2, 0, draw.random((40, 50)))
    carried = picture + draw.normal(0, [[[0.02]], [[0.06]]], (2, 40, 50)).clip(0)
    doubt = draw.normal(0, 0.3, (40, 50))

    def alike(maps: np.ndarray) -> np.ndarray:  # (k pixels from the middle of each on: those at the ends may be halves)
        share = np.ones(k) if k % 2 else np.r_[0.5, np.ones(k - 1), 0.5]
        padded = np.pad(maps, len(share) // 2, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (len(share),) * 2)
        return (windows * np.outer(share, share)).sum((2, 3)) / k**2

    def around(maps: np.ndarray, across_px: int) -> np.ndarray:  # (an odd number of pixels, about k times as many)
        reach = across_px * k // 2
        return over_squares(maps, reach)

    logits = [-SHARP / k**0.5 * around(np.abs(alike(each - picture)), AROUND_PX) for each in carried]
    per_nat = (np.maximum(picture, DARKEST) / GAMMA) ** 2  # code ~ light ** (1 / GAMMA), as light is seen
    wrong = per_nat * np.max([around(doubt**2, each) for each in (1, AROUND_PX, DOUBT_PX)], axis=0)
    seen_wrong = per_nat * around(alike(doubt) ** 2, DOUBT_PX)
    apart = math.pi / 2 * (np.maximum(*logits) / SHARP) ** 2 * k
    off = np.maximum(apart - seen_wrong, 0)
    seen, both, doubts = (
        torch.from_numpy(each).float()[None, None] for each in (picture[None], carried[:, None], doubt[None])
    )
    found = agreement(both, shown_of(seen), footprint=k)
    np.testing.assert_allclose(found[0, 0], logits, atol=1e-4)
    said = off_by(shown_of(seen), doubts, footprint=k)
    for mine, theirs in zip((wrong, seen_wrong), said, strict=True):
        np.testing.assert_allclose(mine, theirs[0, 0, 0], rtol=1e-3)
    np.testing.assert_allclose(carried_off_by(found, said[1], k)[0, 0, 0], off, atol=1e-6)
    share = part_of(said[0], carried_off_by(found, said[1], k))[0, 0, 0]
    np.testing.assert_allclose(share, wrong / (wrong + off + 0.003**2), atol=1e-3)


def test_a_network_says_how_much_to_believe_and_what_is_missing_where_events_are() -> None:
    """I = C' + m (J - C') + 3 s tanh(r), m = c^2 / (c^2 + j^2 e^-n), 1/s^2 = 1/c^2 + 1/j^2; elsewhere r and n are 0."""
    c2, j2 = 1e-4 + torch.rand(2, 1, 2, 1, 7, 9)
    n, near = 4 * torch.randn(1, 2, 1, 7, 9), torch.rand(1, 1, 1, 7, 9).round()
    start, carried, r = torch.rand(3, 1, 2, 3, 7, 9)
    unused = torch.zeros(0)
    found = risen(EventCounts.none(1, (7, 9)), torch.tensor([[0.5, 0.6]]))
    guide = Guide("srgb", unused, unused, found, unused, unused, c2, near, near, c2, 1)
    made = guide.image(start, carried, j2, torch.cat([r, n], 2))
    m = c2 / (c2 + j2 * torch.exp(-(n * near).clamp(-10, 10)) + 0.003**2)
    s = (c2 * j2 / (c2 + j2 + 0.003**2)).sqrt()
    torch.testing.assert_close(made, start + m * (carried - start) + 3 * s * torch.tanh(r * near))
    torch.testing.assert_close(guide.offs(j2), SHARP * torch.cat([c2, j2], 2).sqrt())


def test_a_gate_opens_with_the_mean_of_events_around() -> None:
    """1 - exp(-4 mean), over 5 x 5 pixels; of what was not seen nothing is held back."""
    some, frame = counts(1, (9, 12), steps=3, rate=0.05), torch.rand(1, 3, 9, 12)
    network = make("rrin_events_guided")
    pair = replace(network.padded(frame, frame, some), events=some, frame_0=frame)
    number = np.pad(some.off_on.float().sum((0, 1, 2)).numpy(), 2)
    mean = np.lib.stride_tricks.sliding_window_view(number, (5, 5)).mean((2, 3))
    np.testing.assert_allclose(gate_of(pair)[0, 0], 1 - np.exp(-4 * mean), atol=1e-6)
    assert (gate_of(network.padded(frame, frame)) == 1).all()


def test_motion_of_coarse_light_is_that_of_means() -> None:
    """Of codes in 256ths, of which the means over 3 x 3 are never halfway between two."""
    first, between, last = (((255 * shifted(by)[:, :1]).round() / 255) for by in (0.0, 2.0, 5.0))
    means = [F.avg_pool2d(F.pad(each, (1, 1, 1, 1), mode="replicate"), 3, 1) for each in (first, last, between)]
    found = flows_to(first, last, between[:, None], footprint=3)
    expected = flows_to(means[0], means[1], means[2][:, None])
    torch.testing.assert_close(found, expected, atol=1e-3, rtol=0)
    assert not torch.equal(found, flows_to(first, last, between[:, None]))


def test_motion_between_is_of_the_first_and_then_of_the_second() -> None:
    found = motion_between(shifted(0.0), shifted(4.0))[0, :, 16:-16, 16:-16].mean((-1, -2))
    torch.testing.assert_close(found, torch.tensor([-4.0, 0.0, 4.0, 0.0]), atol=0.3, rtol=0)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("rrin", {"first_flow": "dis"}),
        ("rrin_slomo_events", {"flow": "dis"}),
        ("rrin_slomo_events", {"flow": "guided"}),
    ],
)
def test_motion_is_that_of_the_light_however_frames_are_coded(name: str, options: dict[str, str]) -> None:
    codes = 0.1 * shifted(0.0), 0.1 * shifted(4.0)
    by_codes = make(name, **options, transfer="srgb").prepare(*codes)
    by_light = make(name, **options, transfer="linear").prepare(*(to_light(each, "srgb") for each in codes))
    assert by_codes.flows.abs().amax() > 1 and torch.equal(by_light.flows, by_codes.flows)


@pytest.mark.parametrize("size", [(8, 30), (15, 40), (1, 1), (16, 16)])
def test_any_size_will_do(size: tuple[int, int]) -> None:
    """There is no motion in pictures that are too small for optical flow; light that moves is found in others."""
    pattern = torch.rand(1, 1, size[0], size[1] + 2)
    first, last = pattern[..., :-2], pattern[..., 2:]
    flows = guided(first, last, first[:, None]).flows
    assert flows.shape == (1, 1, 4, *size)
    assert flows.any() == (min(size) >= 16)


@pytest.mark.parametrize("coarser", [1, 2, 3])
@pytest.mark.parametrize(("name", "options"), [("rrin_events_guided", {}), ("rrin_slomo_events", {"flow": "guided"})])
def test_a_fresh_guided_network_is_the_closed_form(name: str, options: dict[str, str], coarser: int) -> None:
    """However coarse events are."""
    first, last = (each[..., :48, :48] for each in (shifted(0), shifted(5)))
    fine = moving([5 * k / STEPS for k in range(STEPS + 1)])
    events = EventCounts(fine.off_on[..., :48, :48], fine.contrast).pooled(coarser)
    times = torch.tensor([0.25, 0.5])
    with torch.no_grad():
        images = make(name, **options)(first, last, times, events).images[0]
    expected = open_method("guided").between(Gap(first[0], last[0], events), times)
    torch.testing.assert_close(images, expected, atol=1e-5, rtol=0)


def test_what_is_certain_stays_whatever_was_learnt() -> None:
    """Key frames are alike and events between them cancel: nobody is in doubt what light was in between."""
    frame = texture(1)[..., :SIDE, :SIDE]
    off_on = torch.zeros(1, 2, STEPS, SIDE, SIDE, dtype=torch.int32)
    off_on[:, 1, 8], off_on[:, 1, 10], off_on[:, 0, 20], off_on[:, 0, 22] = 1, 1, 1, 1
    events, times = EventCounts(off_on, torch.full((1, 2), C)), torch.tensor([0.3, 0.67])  # (not while light turns)
    torch.manual_seed(0)
    network = make("rrin_events_guided", colours=1, zero_heads=False)
    sure = ramps(frame, frame, events, times[None])
    half = risen(events, times[None])
    assert float(in_doubt(frame, frame, half, times[None]).abs().max()) < C / 2
    with torch.no_grad():
        off = (network(frame, frame, times, events).images - sure).abs()
    assert float((sure - frame[:, None]).abs().mean()) > 0.03 > 3 * float(off.mean())


def test_it_stands_light_that_is_not_finite() -> None:
    first, last = torch.rand(2, 1, 3, 32, 32)
    last[..., 3:5, 4] = torch.nan
    assert guided(first, last, last[:, None]).flows.isfinite().all()
    assert make("rrin_events_guided")(first, first, [0.5], counts(1, (32, 32), rate=20.0)).images.isfinite().all()


def test_coarse_events_do_not_blur_what_moves_as_a_whole() -> None:
    """Events of pixels nine times as large say where things go; how they look is in the key frames."""
    path = [6 * k / STEPS for k in range(STEPS + 1)]
    first, last, truth = shifted(0), shifted(6), torch.cat([shifted(1.5), shifted(3), shifted(4.5)])
    side = SIDE // 3 * 3
    gap = [each[0, :, :side, :side] for each in (first, last)]
    fine = moving(path)
    coarse = EventCounts(fine.off_on[..., :side, :side], fine.contrast).pooled(3)
    error = {
        name: float((open_method(name).between(Gap(*gap, coarse), torch.tensor([0.25, 0.5, 0.75]))
                     - truth[..., :side, :side])[..., 8:-8, 8:-8].square().mean())
        for name in ("bridge", "guided")
    }  # fmt: skip
    assert error["guided"] < error["bridge"] / 4


def test_the_combined_system_starts_from_what_is_guided() -> None:
    """Heads that are zero leave the closed form as it is, with the UNet of the residue or without it."""
    first, second, seen = shifted(0), shifted(3), moving([0, 1, 2, 3])
    times = torch.tensor([1 / 3, 2 / 3])
    wanted = open_method("guided").between(Gap(first[0], second[0], seen), times)
    torch.manual_seed(0)
    for refine in ("unet", "none"):
        made = make("rrin_slomo_events", flow="guided", refine=refine)(first, second, times, seen)
        torch.testing.assert_close(made.images[0], wanted, atol=1e-6, rtol=0)
    still = make("rrin_slomo_events", flow="dis")(first, second, times, seen)
    assert not torch.allclose(still.images[0], wanted, atol=1e-2)


@pytest.mark.parametrize("across", [1, 5, 51])
def test_means_around_are_of_the_squares(across: int) -> None:
    maps = torch.rand(2, 3, 40, 70, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    whole = F.avg_pool2d(maps, across, 1, across // 2, count_include_pad=False)
    torch.testing.assert_close(mean_around(maps, across), whole, rtol=1e-12, atol=0)
