"""The bridge: exact where events say all, the key frames where nothing happens, and finite whatever it is given."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from pairs import counts, frames

from interp.candidates.bridge import BRIGHTEST, DARKEST, bridge, coloured, highest_of, integrated, ratios_of
from interp.candidates.contrast import LEAST, MOST, with_fitted_contrast
from interp.candidates.ramps import ramps
from interp.light import luminance, to_codes, to_light
from interp.representation.event_counts import EventCounts
from vid2ev import UsageError
from vid2ev.light.transfer import parse_transfer

STEPS = 8
C = 0.15


def ramp(rise: int, size: tuple[int, int] = (4, 5)) -> tuple[torch.Tensor, torch.Tensor, EventCounts]:
    """Grey light that rises by c * rise in every sub-interval, and its events."""
    logs = torch.linspace(-3, -1.5, size[0] * size[1]).reshape(1, 1, *size)
    off_on = torch.zeros(1, 2, STEPS, *size)
    off_on[:, int(rise > 0)] = abs(rise)
    lights = [torch.exp(logs + C * rise * k) - 1e-3 for k in (0, STEPS)]
    return lights[0], lights[1], EventCounts(off_on, torch.full((1, 2), C))


@pytest.mark.parametrize("rise", [1, -1])
@pytest.mark.parametrize("method", ["bridge", "both", "nearest"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.77, 1.0])
def test_it_is_exact_where_the_events_are(rise: int, method: str, share: float) -> None:
    first, second, events = ramp(rise)
    found = bridge(first, second, events, torch.tensor([[share]]), "linear", method)  # type: ignore[arg-type]
    expected = (first + 1e-3) * math.exp(C * rise * STEPS * share) - 1e-3
    torch.testing.assert_close(found[:, 0], expected, rtol=1e-4, atol=1e-6)  # float32 logs near -7


def test_drift_is_spread_where_the_events_are() -> None:
    # the frames differ by one threshold more than the events say, and all events come in the last quarter
    off_on = torch.zeros(1, 2, STEPS, 1, 1)
    off_on[0, 1, 6:] = 10
    first = torch.full((1, 1, 1, 1), math.exp(-5.0) - 1e-3)
    second = torch.full((1, 1, 1, 1), math.exp(-5.0 + 21 * C) - 1e-3)
    found = integrated(first, second, EventCounts(off_on, torch.full((1, 2), C)), torch.tensor([[0.75, 0.875]]))
    drift = found.drift.flatten().tolist()
    assert drift == pytest.approx([(0 + 1.5) / 22, (10 + 1.75) / 22])
    logs = torch.log(found.light() + 1e-3).flatten().tolist()
    assert logs == pytest.approx([-5 + drift[0] * C, -5 + 10 * C + drift[1] * C], abs=1e-4)


@pytest.mark.parametrize("transfer", ["srgb", "linear"])
@pytest.mark.parametrize("colours", [1, 3])
def test_nothing_happens_and_the_frames_stay(transfer: str, colours: int) -> None:
    frame, _ = frames(2, (9, 11), colours)
    frame[..., 0] = 0
    frame[..., 1] = 1.7  # brighter than white
    found = bridge(frame, frame, EventCounts.none(2, (9, 11)), torch.tensor([[0.0, 0.3, 1.0]] * 2), transfer)  # type: ignore[arg-type]
    torch.testing.assert_close(found, frame[:, None].expand_as(found), rtol=1e-5, atol=2e-5)  # exp(log) in float32


def test_a_curve_and_a_method_that_are_none_are_refused() -> None:
    given = (torch.zeros(1, 3, 4, 4), torch.zeros(1, 3, 4, 4), EventCounts.none(1, (4, 4)), torch.tensor([[0.5]]))
    with pytest.raises(UsageError, match="transfer 'gamma': expected one of srgb, linear"):
        bridge(*given, transfer="gamma")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="method 'best': expected one of bridge, both, nearest"):
        bridge(*given, method="best")  # type: ignore[arg-type]


def test_without_events_light_fades_in_logs() -> None:
    first, second, _ = ramp(2)
    found = bridge(first, second, EventCounts.none(1, (4, 5)), torch.tensor([[0.25]]), "linear")
    expected = torch.exp(0.75 * torch.log(first + 1e-3) + 0.25 * torch.log(second + 1e-3)) - 1e-3
    torch.testing.assert_close(found[:, 0], expected, rtol=1e-5, atol=1e-6)


def test_a_pair_does_not_see_the_others_of_its_batch() -> None:
    first, second = frames(2, (8, 8))
    first[1] *= 20  # far brighter than white
    some, times = counts(2, (8, 8), rate=1.0), torch.tensor([[0.5], [0.5]])
    alone = bridge(first[:1], second[:1], EventCounts(some.off_on[:1], some.contrast[:1]), times[:1])
    torch.testing.assert_close(bridge(first, second, some, times)[:1], alone)


def test_light_is_its_luminance_and_its_colours() -> None:
    light = torch.rand(1, 3, 6, 7) + 0.05
    ratios = ratios_of(light)
    torch.testing.assert_close(luminance(ratios), torch.ones(1, 1, 6, 7))
    torch.testing.assert_close(coloured(luminance(light), ratios), light)


@pytest.mark.parametrize("method", [bridge, ramps])
def test_colours_go_from_those_of_the_one_frame_to_those_of_the_other_as_the_drift_does(method: Any) -> None:
    """r = (RGB + 0.01) / (Y + 0.01); all events come in the last quarter."""
    off_on = torch.zeros(1, 2, STEPS, 1, 1)
    off_on[0, 1, 6:] = 10
    lights = [torch.tensor(each).reshape(1, 3, 1, 1) for each in ((0.3, 0.1, 0.2), (0.5, 0.7, 0.6))]
    first, second = ((each + 0.01) / (luminance(each) + 0.01) for each in lights)
    found = method(*lights, EventCounts(off_on, torch.full((1, 2), 0.01)), torch.tensor([[0.75]]), "linear")[:, 0]
    # (ramps are on the way to the first event, half of which is before it, in the middle of a sub-interval)
    drift = 1.5 / (20 + 2) if method is bridge else (0.5 * (0.75 / 0.8125) ** 2 + 1.5) / (20 + 2)
    made = (found + 0.01) / (luminance(found) + 0.01)
    torch.testing.assert_close(made, first + drift * (second - first), rtol=1e-4, atol=0)


def test_the_nearest_is_integrated_from_the_nearer_frame_alone() -> None:
    first, second, events = ramp(1)
    other = 3 * second  # of which events tell nothing
    times = torch.tensor([[0.45, 0.5, 0.55]])
    found = bridge(first, other, events, times, "linear", "nearest")[0]
    logs = [torch.log(each[0] + 1e-3) for each in (first, other)]
    expected = [logs[0] + C * STEPS * 0.45, logs[0] + C * STEPS * 0.5, logs[1] - C * STEPS * 0.45]
    torch.testing.assert_close(found, torch.exp(torch.stack(expected)) - 1e-3, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("brightest", [0.2, 1.0, 6.0])
@pytest.mark.parametrize("order", [1, -1])
def test_light_is_within_what_frames_can_show_or_as_bright_as_they_are(brightest: float, order: int) -> None:
    """However many events there are: a tenth of a nat above white, or the brightest of any colour in either frame."""
    pair = [torch.full((1, 3, 2, 2), 0.1), torch.full((1, 3, 2, 2), 0.1)]
    pair[0][0, 1, 1, 0] = brightest  # in a single colour of a single pixel
    first, second = pair[::order]
    highest = highest_of(first, second, "linear")
    assert float(highest) == pytest.approx(max(BRIGHTEST, math.log(brightest + 1e-3)))
    off_on = torch.zeros(1, 2, STEPS, 2, 2)
    off_on[:, 0, :, 0], off_on[:, 1, :, 1] = 1e4, 1e4  # darker above, brighter below
    events, times = EventCounts(off_on, torch.full((1, 2), C)), torch.tensor([[0.0, 0.5, 1.0]])
    found = integrated(luminance(first), luminance(second), events, times, highest)
    begun, lowest, top = math.log(0.1 + 1e-3), torch.full((2,), DARKEST), highest.flatten().expand(2)
    torch.testing.assert_close(found.forward[0, 1, 0], torch.stack([lowest, top]))
    torch.testing.assert_close(found.backward[0, 1, 0], torch.stack([top, lowest]))
    assert float(found.forward[0, 0, 0, 0, 1]) == float(found.backward[0, 2, 0, 0, 1]) == pytest.approx(begun)
    assert float(found.light().min()) >= 0
    for method in (bridge, ramps):
        made = luminance(method(first, second, events, times, "linear"))
        assert float(made.min()) >= 0 and float(made.max()) <= float(torch.exp(highest)) * 1.0001
    dark = integrated(-luminance(first), luminance(second), events, times)
    assert torch.isfinite(dark.forward).all()  # noise below black counts as black


def test_nothing_is_darker_than_black() -> None:
    """Neither what gets so dark in between that both frames know of it, nor a colour that black has none of."""
    grey, off_on = torch.full((1, 1, 2, 2), 0.1), torch.zeros(1, 2, STEPS, 2, 2)
    off_on[:, 0, : STEPS // 2], off_on[:, 1, STEPS // 2 :] = 1e3, 1e3
    found = integrated(grey, grey, EventCounts(off_on, torch.full((1, 2), C)), torch.tensor([[0.5]]))
    assert (found.forward == DARKEST).all() and (found.backward == DARKEST).all() and (found.light() == 0).all()
    red = ratios_of(torch.tensor([1.0, 0.0, 0.0]).reshape(3, 1, 1))
    assert coloured(torch.zeros(1, 1, 1), red).flatten().tolist() == [pytest.approx(float(0.01 * red[0] - 0.01)), 0, 0]


@pytest.mark.parametrize("level", [0.0, 1e-8, 0.5, 1.0, 1e4])
def test_gradients_are_finite_on_light_of_any_level(level: float) -> None:
    first, second = (torch.full((1, 3, 8, 8), level, requires_grad=True) for _ in range(2))
    contrast = torch.full((1, 2), C, requires_grad=True)
    some = EventCounts(counts(1, (8, 8), rate=3.0).off_on, contrast)
    found = bridge(first, second, some, torch.tensor([[0.0, 0.5, 1.0]]))
    found.sum().backward()
    assert torch.isfinite(found).all()
    for each in (first, second, contrast):
        assert each.grad is not None and torch.isfinite(each.grad).all()


def test_no_number_of_events_is_too_large() -> None:
    some = EventCounts(torch.full((1, 2, 4, 3, 3), 1e6), torch.tensor([[0.1, 0.2]]))
    first, second = frames(1, (3, 3))
    found = bridge(first, second, some, torch.tensor([[0.5]]))
    assert torch.isfinite(found).all() and found.min() >= 0
    negative = bridge(-first, second, counts(1, (3, 3)), torch.tensor([[0.5]]))
    assert torch.isfinite(negative).all()  # noise below black


@pytest.mark.parametrize("transfer", ["srgb", "linear"])
def test_curves_are_those_of_vid2ev(transfer: str) -> None:
    codes = torch.linspace(0, 1.5, 700)
    curve = parse_transfer(transfer)
    np.testing.assert_allclose(to_light(codes, transfer), curve.to_light(codes.numpy()), rtol=2e-6, atol=1e-7)  # type: ignore[arg-type]
    np.testing.assert_allclose(to_codes(codes, transfer), curve.to_signal(codes.numpy()), rtol=2e-6, atol=1e-7)  # type: ignore[arg-type]
    dark = torch.zeros(3, requires_grad=True)
    (to_codes(dark, transfer).sum() + to_light(dark, transfer).sum()).backward()  # type: ignore[arg-type]
    assert dark.grad is not None and torch.isfinite(dark.grad).all()


@pytest.mark.parametrize("thresholds", [(0.15, 0.15), (0.22, 0.3), (0.08, 0.12)])
def test_the_contrast_is_found_from_the_frames(thresholds: tuple[float, float]) -> None:
    generator = torch.Generator().manual_seed(5)
    logs = -2 + 0.8 * torch.randn(2, 1, 1, 60, 80, generator=generator).clamp(-2, 2)
    first, second = torch.exp(logs) - 1e-3
    change = (logs[1] - logs[0])[0, 0]
    phase = torch.rand(60, 80, generator=generator)
    number = torch.where(change > 0, (change / thresholds[1] + phase), (-change / thresholds[0] + phase)).floor()
    off_on = torch.stack([torch.where(change < 0, number, 0), torch.where(change > 0, number, 0)])[None, :, None]
    found = with_fitted_contrast(first, second, EventCounts(off_on, torch.full((1, 2), C)), "linear").contrast[0]
    # what is left over below a threshold is a third of a threshold, of changes of some ten
    np.testing.assert_allclose(found, thresholds, rtol=0.08)


def test_without_events_the_contrast_is_the_usual_one() -> None:
    first, second = frames(2, (8, 8))
    found = with_fitted_contrast(first, second, EventCounts.none(2, (8, 8))).contrast
    torch.testing.assert_close(found, torch.full((2, 2), C))


def test_a_contrast_is_one_that_sensors_have() -> None:
    first, second = torch.full((1, 1, 20, 20), 1e-3), torch.full((1, 1, 20, 20), 1.0)
    off_on = torch.zeros(1, 2, 1, 20, 20)
    off_on[:, 0, :, :10], off_on[:, 1, :, 10:] = 100, 1
    found = with_fitted_contrast(
        torch.cat([first, first]),
        torch.cat([first, second]),
        EventCounts(off_on.expand(2, -1, -1, -1, -1), torch.full((2, 2), C)),
        "linear",
    ).contrast
    torch.testing.assert_close(found[:, 1], torch.tensor([C * (16 / 216) ** 0.5, MOST]))
    assert float(found[0, 0]) == pytest.approx(LEAST)


def test_few_events_weigh_against_sixteen_pixels_of_the_usual_contrast() -> None:
    changes = torch.tensor([0.5, 0.5, -0.3, 1.0, 1.0]).reshape(1, 1, 1, 5)
    first, second = (0.1 * torch.exp(change) - 1e-3 for change in (torch.zeros_like(changes), changes))
    off, on = torch.tensor([[0, 1, 3, 0, 2], [2, 3, 0, 0, 2]]).float()  # +2, +2, -3, and twice none left over
    off_on = torch.stack([off, on]).reshape(1, 2, 1, 1, 5)
    found = with_fitted_contrast(first, second, EventCounts(off_on, torch.full((1, 2), 0.3)), "linear").contrast[0]
    usual = 16 * 0.15**2
    expected = [(0.3**2 + usual) / (3**2 + 16), (2 * 0.5**2 + usual) / (2 * 2**2 + 16)]
    torch.testing.assert_close(found, torch.tensor(expected).sqrt(), atol=1e-5, rtol=0)
