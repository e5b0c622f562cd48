"""What rebuilds frames between two frames, where it is known what it gives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from interp.light import to_codes, to_light
from interp.methods import METHODS, Gap, open_method
from interp.methods.of_networks import OfFrames, of_weights
from interp.methods.running import PRECISIONS, Running
from interp.methods.tiling import parse_tiling
from interp.networks import make, spec_of
from interp.representation.event_counts import EventCounts
from interp.weights import save
from vid2ev import Frame
from vid2ev.errors import DataError, UsageError
from vid2ev.upsample import make_upsampler
from vid2ev.upsample.flow import Moving

TIMES = torch.tensor([0.25, 0.5, 0.875])
NOTHING = EventCounts.none(1, (48, 48), steps=8)


def made_by(method: str | Path, frame_0: torch.Tensor, frame_1: torch.Tensor) -> torch.Tensor:
    return open_method(str(method)).begin().between(Gap(frame_0, frame_1, NOTHING), TIMES)


def test_between_two_frames_that_are_alike_all_give_that_frame() -> None:
    frame = 0.05 + 0.9 * torch.rand(3, 48, 48)
    for method in METHODS:
        made = made_by(method, frame, frame)
        # Through light and its log and back in float32: a hundredth of a code of 8 bits.
        torch.testing.assert_close(made, frame.expand(len(TIMES), -1, -1, -1), atol=0.01 / 255, rtol=0, msg=method)


@pytest.mark.parametrize("method", [*METHODS, "rrin", "rrin_events_guided", "timelens", "firenet"])
def test_of_no_times_there_are_no_images(tmp_path: Path, method: str) -> None:
    """As of a gap that holds no instant, but whose events are asked for by what comes after."""
    if method not in METHODS:
        save(tmp_path / "a.safetensors", method, make(method))
    opened = open_method(method if method in METHODS else str(tmp_path / "a.safetensors"))
    gap = Gap(*torch.rand(2, 3, 48, 96), EventCounts.none(1, (48, 96), steps=8))
    for tiling in (None, parse_tiling("64x64", (96, 48), 32)):
        assert not [*opened.begin().images(gap, torch.zeros(0), tiling)]


def test_nearest_and_linear_are_what_they_are_called() -> None:
    black, white = torch.zeros(3, 48, 48), torch.ones(3, 48, 48)
    assert made_by("nearest", black, white).mean((1, 2, 3)).tolist() == [0, 0, 1]
    assert made_by("linear", black, white).mean((1, 2, 3)).tolist() == TIMES.tolist()


def test_flow_carries_what_moves() -> None:
    texture = F.interpolate(torch.rand(1, 3, 16, 16), size=(80, 80), mode="bicubic")[0].clamp(0.1, 0.9)
    shifted = [texture[:, 8:56, 8 + k : 56 + k] for k in (0, 2, 4, 7, 8)]  # 8 px to the left
    made = made_by("flow", shifted[0], shifted[-1])
    crossed = made_by("linear", shifted[0], shifted[-1])
    inner = (slice(None), slice(None), slice(10, -10), slice(10, -10))
    truth = torch.stack(shifted[1:4])
    assert float((made - truth)[inner].pow(2).mean()) < 0.5 * float((crossed - truth)[inner].pow(2).mean())


@pytest.mark.parametrize("steps", [2, 3, 7, 8, 32])
def test_flow_at_even_times_is_that_of_the_upsampler(steps: int) -> None:
    frames = torch.rand(2, 3, 12, 16).repeat_interleave(4, 2).repeat_interleave(4, 3)
    before, after = (
        Frame(to_light(frame, "srgb").permute(1, 2, 0).contiguous().numpy(), 10**6 * steps * number)
        for number, frame in enumerate(frames)
    )
    even = [torch.from_numpy(each.light) for each in make_upsampler("flow", steps).between(before, after)]
    times = torch.from_numpy(np.linspace(0, 1, steps + 1)[1:]).float()
    made = open_method("flow").between(Gap(*frames, None), times)
    assert torch.equal(made, to_codes(torch.stack(even).permute(0, 3, 1, 2), "srgb"))


def test_flow_makes_the_instants_asked_for_and_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    gap = Gap(*torch.rand(2, 3, 48, 64), None)
    times = torch.tensor([0.0, 0.12501, 0.2493, 0.2493, 0.9, 1.0])  # as stamps of a real camera are
    flow = open_method("flow").between
    alone = torch.cat([flow(gap, time[None]) for time in times])
    made: list[float] = []
    at = Moving.at
    monkeypatch.setattr(Moving, "at", lambda moving, time: made.append(float(time)) or at(moving, time))
    assert torch.equal(flow(gap, times), alone)
    assert made == pytest.approx([0.12501, 0.2493, 0.9])
    torch.testing.assert_close(alone[[0, -1]], torch.stack([gap.frame_0, gap.frame_1]), atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    ("name", "options", "needs_events"),
    [
        ("rrin", {}, False),
        ("superslomo", {}, False),
        ("rrin_events", {}, True),
        ("rrin_events_light", {}, True),
        ("rrin_events_light", {"bins": 0, "candidate": "none"}, False),
        ("slomo_events", {}, True),
        ("timelens", {}, True),
        ("firenet", {}, True),
        ("e2vid", {}, True),
    ],
)
def test_networks_of_files_are_methods(
    tmp_path: Path, name: str, options: dict[str, object], needs_events: bool
) -> None:
    path = tmp_path / f"{name}.safetensors"
    save(path, name, make(name, "tiny", **options))
    method = open_method(str(path))
    assert (method.name, method.needs_events) == (name, needs_events)
    frames = torch.rand(2, 3, 48, 40)
    assert made_by(path, *frames).shape == (3, 3, 48, 40)
    without = Gap(*frames, None)
    if needs_events:
        with pytest.raises(UsageError, match="events"):
            method.between(without, TIMES)
    else:
        assert method.between(without, TIMES).shape == (3, 3, 48, 40)


def test_a_network_of_events_remembers_until_it_begins_again(tmp_path: Path) -> None:
    path = tmp_path / "firenet.safetensors"
    save(path, "firenet", make("firenet", "tiny"))
    frame = torch.rand(3, 16, 16)
    gap = Gap(frame, frame, EventCounts(torch.randint(0, 2, (1, 2, 8, 16, 16)), torch.full((1, 2), 0.15)))
    method = open_method(str(path))
    once, again = (method.between(gap, TIMES) for _ in range(2))
    assert method.sequential and not torch.equal(once, again)
    torch.testing.assert_close(method.begin().between(gap, TIMES), once, atol=0, rtol=0)


def test_what_is_no_method_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="did you mean bridge"):
        open_method("brige")
    with pytest.raises(UsageError, match="expected one of nearest, linear"):
        open_method("longer than files can be called " * 999)
    path = tmp_path / "hdr.safetensors"
    save(path, "hdr", make("hdr", "tiny"))
    with pytest.raises(UsageError, match="rebuilds no frames"):
        open_method(str(path))
    save(path, "rrin_events_guided", make("rrin_events_guided", transfer="linear"))
    with pytest.raises(UsageError, match="holds a network for linear light, and frames are sRGB codes"):
        open_method(str(path))


@pytest.mark.parametrize(
    ("name", "options", "takes"),
    [
        ("rrin", {}, False),
        ("rrin_events", {}, True),
        ("rrin_slomo_events", {}, True),
        ("rrin_slomo_events", {"events": "none"}, False),
        ("rrin_slomo_events", {"events": "none", "flow": "guided"}, True),
        ("rrin_slomo_events", {"events": "none", "flow_input": "frames+events"}, True),
        ("rrin_slomo_events", {"events": "none", "reconstruct": "firenet"}, True),
    ],
)
def test_a_network_needs_events_if_any_part_of_it_does(name: str, options: dict[str, Any], takes: bool) -> None:
    assert spec_of(name, **options).takes_events == takes


def test_weights_that_make_no_numbers_are_said(tmp_path: Path) -> None:
    network = make("rrin")
    with torch.no_grad():
        next(network.parameters()).fill_(torch.nan)
    save(tmp_path / "broken.safetensors", "rrin", network)
    frame = torch.rand(3, 32, 32)
    with pytest.raises(DataError, match="'broken' made values that are no numbers"):
        of_weights(tmp_path / "broken.safetensors").between(Gap(frame, frame, None), torch.tensor([0.5]))


@pytest.mark.parametrize("precision", PRECISIONS)
def test_where_few_bits_make_no_numbers_more_are_advised(precision: str) -> None:
    network, frame = make("rrin", zero_heads=False).eval(), torch.rand(3, 32, 32)
    with torch.no_grad():
        for layer, factor in (("flow.down.0.0", 3e5), ("flow.down.1.0", 1 / 3e5)):
            network.get_submodule(layer).weight.mul_(factor)  # type: ignore[union-attr, operator]
    method = OfFrames("loud", network, False, Running(precision))  # type: ignore[arg-type]
    gap = Gap(frame, frame.flip(2), None)
    if precision == "float16":
        with pytest.raises(DataError, match=r"take other weights or --precision float32$"):
            method.between(gap, torch.tensor([0.5]))
    else:
        assert method.between(gap, torch.tensor([0.5])).isfinite().all()
