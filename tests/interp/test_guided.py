"""Key frames carried to where the light of events is."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from pairs import counts
from torch.nn import functional as F

from interp.candidates.bridge import DARK
from interp.candidates.guided import agreement, guided, recoloured, share_of_carried
from interp.candidates.ramps import ramps
from interp.light import luminance, to_light
from interp.methods import Gap, open_method
from interp.networks import make
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


def test_what_does_not_agree_counts_little() -> None:
    target = torch.full((1, 1, 3, 20, 20), 0.5)
    logits = agreement(torch.stack([target, target + 0.2], 2), target)
    torch.testing.assert_close(logits[:, :, 0], torch.zeros(1, 1, 20, 20))
    torch.testing.assert_close(logits[:, :, 1], torch.full((1, 1, 20, 20), -40 * 0.2))


@pytest.mark.parametrize(("footprint", "most"), [(1, 0.8), (2, 0.95)])
def test_what_agrees_is_mostly_what_was_carried(footprint: int, most: float) -> None:
    logits = torch.tensor([[0.0, -1.0], [-1.0, -2.0]])[None, None, :, None]  # of two warps, at two pixels
    found = share_of_carried(logits, footprint).flatten()
    torch.testing.assert_close(found, most * torch.exp(torch.tensor([0.0, -1.0])))


@pytest.mark.parametrize("size", [(8, 30), (16, 16)])
def test_any_size_will_do(size: tuple[int, int]) -> None:
    first, last = torch.rand(2, 1, 1, *size)
    assert guided(first, last, first[:, None]).flows.shape == (1, 1, 4, *size)


def test_a_fresh_guided_network_is_the_closed_form() -> None:
    first, last, events = shifted(0), shifted(5), moving([5 * k / STEPS for k in range(STEPS + 1)])
    times = torch.tensor([0.25, 0.5])
    with torch.no_grad():
        images = make("rrin_events_guided")(first, last, times, events).images[0]
    expected = open_method("guided").between(Gap(first[0], last[0], events, 33_333), times)
    torch.testing.assert_close(images, expected, atol=1e-5, rtol=0)


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
        name: float((open_method(name).between(Gap(*gap, coarse, 33_333), torch.tensor([0.25, 0.5, 0.75]))
                     - truth[..., :side, :side])[..., 8:-8, 8:-8].square().mean())
        for name in ("bridge", "guided")
    }  # fmt: skip
    assert error["guided"] < error["bridge"] / 4


def test_the_combined_system_starts_from_what_is_guided() -> None:
    """Heads that are zero leave both frames as the light of events has carried and weighed them."""
    first, second, seen = shifted(0), shifted(3), moving([0, 1, 2, 3])
    times = torch.tensor([[1 / 3, 2 / 3]])
    wanted = guided(first, second, ramps(first, second, seen, times)).blend(times)
    torch.manual_seed(0)
    made = make("rrin_slomo_events", flow="guided")(first, second, times[0], seen)
    torch.testing.assert_close(made.images, wanted, atol=1e-6, rtol=0)
    still = make("rrin_slomo_events", flow="dis")(first, second, times[0], seen)
    assert not torch.allclose(still.images, wanted, atol=1e-2)
