"""Gradients are finite in 16 bits on what breaks them: black, even light, no events, one event."""

from __future__ import annotations

import pytest
import torch
from pairs import FRAME_FED

from interp.light import to_ratios
from interp.losses.objectives import residue, supervised_residue
from interp.losses.terms import smoothness
from interp.networks import make
from interp.representation.event_counts import EventCounts

KINDS = [torch.bfloat16, torch.float16]
SIZE = (32, 32)


def even(level: float) -> torch.Tensor:
    return torch.full((1, 3, *SIZE), level)


def given(case: str) -> tuple[torch.Tensor, torch.Tensor, EventCounts]:
    """Two frames and events that say next to nothing."""
    events = EventCounts.none(1, SIZE, 8)
    if case == "black":
        return even(0.0), even(0.0), events
    if case == "even":
        return even(0.7), even(0.7), events
    if case == "one event":
        events.off_on[0, 1, 3, 10, 20] = 1
    return torch.rand(1, 3, *SIZE), torch.rand(1, 3, *SIZE), events


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", ["black", "even", "no events", "one event"])
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.long] * (n == "timelens")) for n in FRAME_FED])
def test_networks_of_frames_have_finite_gradients(name: str, case: str, kind: torch.dtype) -> None:
    network = make(name, zero_heads=False)
    first, second, events = given(case)
    with torch.autocast("cpu", kind):
        made = network(first, second, [0.0, 0.5], events)
        # the truth is what comes out to the bit: the slope of a square root at 0
        terms = {
            **residue(made, made.images.detach()),
            **supervised_residue(made, first[:, None].expand_as(made.images)),
        }
        loss = sum(terms.values()) + smoothness(made.flows_at)
    assert made.images.dtype == torch.float32 and torch.isfinite(loss)
    loss.backward()
    for parameter, values in network.named_parameters():
        assert values.grad is None or torch.isfinite(values.grad).all(), parameter


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", FRAME_FED)
@pytest.mark.parametrize("colours", [1, 3])
def test_frames_in_16_bits_are_the_same_frames_in_32(name: str, colours: int, kind: torch.dtype) -> None:
    network, (first, second, events) = make(name, colours=colours), given("one event")
    first, second = first.to(kind), second.to(kind)
    with torch.no_grad():
        made, expected = (network(*pair, [0.5], events) for pair in ((first, second), (first.float(), second.float())))
    assert made.images.dtype == torch.float32 and torch.equal(made.images, expected.images)


@pytest.mark.parametrize("name", ["rrin_events_guided", "rrin_events", "timelens"])
def test_masks_that_are_sure_of_themselves_may_be_beyond_float16(name: str) -> None:
    network, (first, second, events) = make(name, zero_heads=False).eval(), given("one event")
    masks = network.get_submodule("attention" if name == "timelens" else "masks")
    with torch.no_grad():
        for part in (masks.down[0][0], masks.head):  # type: ignore[index, union-attr]
            part.weight.mul_(1e4)  # type: ignore[union-attr, operator]
        expected = network(first, second, [0.5], events).images
        with torch.autocast("cpu", torch.float16):
            made = network(first, second, [0.5], events).images
    torch.testing.assert_close(made, expected, rtol=0, atol=0.1)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize("name", ["e2vid", "firenet"])
def test_networks_of_events_have_finite_gradients(name: str, number: int, kind: torch.dtype) -> None:
    network = make(name)
    voxels = torch.zeros(1, 4, 5, 16, 16)
    voxels[0, :number, 2, 3, 4] = 1 / 3
    with torch.autocast("cpu", kind):
        images, states = network.sequence(voxels)  # type: ignore[operator]
        images.square().sum().backward()
    assert all(part.dtype == torch.float32 for state in states for part in state)
    for parameter, values in network.named_parameters():
        assert values.grad is not None and torch.isfinite(values.grad).all(), parameter


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("level", [0.0, 0.7])
def test_hdr_has_finite_gradients(level: float, kind: torch.dtype) -> None:
    network, state = make("hdr"), None
    torch.nn.init.normal_(network.out.weight, std=0.01)  # type: ignore[arg-type, union-attr]
    loss = torch.zeros(())
    for _ in range(3):
        with torch.autocast("cpu", kind):
            picture, state = network(even(level), torch.zeros(1, 5, *SIZE), state)
            loss = loss + to_ratios(picture).square().sum()  # (as it learns)
    loss.backward()
    for parameter, values in network.named_parameters():
        assert values.grad is not None and torch.isfinite(values.grad).all(), parameter
