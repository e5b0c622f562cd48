"""Recurrent networks over long sequences: bounded, the same from the same start, and without gradients where cut."""

from __future__ import annotations

import pytest
import torch

from interp.blocks.recurrent import CELL_LIMIT, ConvGru, ConvLstm
from interp.light import to_ratios
from interp.networks import make
from interp.networks.hdr import AROUND, HdrState

LONG = 500
SIDE = 8


def strong(network: torch.nn.Module) -> torch.nn.Module:
    """Weights three times as large: what a network that is badly trained may have."""
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(3)
    return network.eval()


def drives(channels: int) -> list[torch.Tensor]:
    """The same strong events again and again, none, and ever others."""
    fixed = 10 * torch.randn(1, channels, SIDE, SIDE).sign()
    return [fixed, torch.zeros_like(fixed), 10 * torch.randn(1, channels, SIDE, SIDE)]


@pytest.mark.parametrize("name", ["e2vid", "firenet"])
@pytest.mark.parametrize("drive", [0, 1, 2])
def test_pictures_from_events_are_bounded_over_500_windows(name: str, drive: int) -> None:
    network, states = strong(make(name)), ()
    with torch.no_grad():
        for k in range(LONG):
            voxels = drives(5)[drive] if drive == 2 or k == 0 else voxels  # noqa: F821
            image, states = network(voxels, states)
    assert torch.isfinite(image).all() and image.min() >= 0 and image.max() <= 1
    assert max(float(part.abs().max()) for state in states for part in state) <= CELL_LIMIT


def test_hdr_is_bounded_over_500_frames() -> None:
    network, state = make("hdr").eval(), None
    torch.nn.init.normal_(network.out.weight)  # type: ignore[arg-type, union-attr]
    frame, events = torch.rand(1, 3, SIDE, SIDE), 10 * torch.randn(1, 5, SIDE, SIDE)
    with torch.no_grad():
        for _ in range(LONG):
            picture, state = network(frame, events, state)
    # a residue of at most 1, whatever came before: the last output is an input, and not added up
    assert isinstance(state, HdrState) and torch.isfinite(picture).all()
    assert 0 < (to_ratios(picture) - to_ratios(state.carried)).abs().max() <= 1 + 1e-5
    assert float(state.cell[1].abs().max()) <= CELL_LIMIT


@pytest.mark.parametrize("kind", [ConvLstm, ConvGru])
def test_cells_stay_bounded_when_every_gate_is_open(kind: type) -> None:
    cell, state = kind(1, 4), None
    with torch.no_grad():
        for parameter in cell.parameters():
            parameter.fill_(2.0)
        for _ in range(LONG):
            h, state = cell(torch.full((1, 1, 3, 3), 1e4), state)
    assert h.abs().max() <= 1 and all(part.abs().max() <= CELL_LIMIT for part in state)


@pytest.mark.parametrize("kind", [torch.bfloat16, torch.float16])
@pytest.mark.parametrize("cell", [ConvLstm, ConvGru])
def test_states_are_not_rounded_to_16_bits(cell: type, kind: torch.dtype) -> None:
    made, states = cell(1, 2), []
    with torch.no_grad():
        for name, parameter in made.named_parameters():
            # gates that 16 bits can hold, so that only what is done with them can differ
            parameter.copy_(torch.linspace(-1, 1, 9)[: parameter.numel()] if "bias" in name else 0 * parameter)
        for half in (False, True):
            state = None
            for _ in range(20):
                with torch.autocast("cpu", kind, enabled=half):
                    _, state = made(torch.zeros(1, 1, 3, 3), state)
            states.append(state)
    assert all(torch.equal(whole, half) for whole, half in zip(*states, strict=True))


def test_an_lstm_remembers_at_first_and_gates_are_orthogonal() -> None:
    gates = ConvLstm(4, 4).gates
    assert gates.bias is not None and gates.bias[4:8].tolist() == [1] * 4 and gates.bias[:4].abs().sum() == 0
    rows = gates.weight.flatten(1)
    torch.testing.assert_close(rows @ rows.T, torch.eye(16), rtol=0, atol=1e-5)


@pytest.mark.parametrize("kind", [ConvLstm, ConvGru])
def test_none_is_a_state_of_zeros(kind: type) -> None:
    cell, x = kind(2, 3), torch.randn(1, 2, 5, 5)
    _, state = cell(x, None)
    zeros = tuple(torch.zeros_like(part) for part in state)
    torch.testing.assert_close(cell(x, None)[0], cell(x, zeros)[0])


@pytest.mark.parametrize("name", ["e2vid", "firenet"])
def test_states_are_not_changed_in_place_and_sequences_start_afresh(name: str) -> None:
    network = make(name)
    voxels = torch.randn(1, 4, 5, 11, 13)
    images, _ = network.sequence(voxels)  # type: ignore[operator]
    first, states = network.sequence(voxels[:, :2])  # type: ignore[operator]
    kept = [part.clone() for state in states for part in state]
    rest, _ = network.sequence(voxels[:, 2:], states)  # type: ignore[operator]
    assert all(torch.equal(a, b) for a, b in zip(kept, [part for state in states for part in state], strict=True))
    torch.testing.assert_close(torch.cat([first, rest], 1), images)
    assert images.shape == (1, 4, 1, 11, 13)
    torch.testing.assert_close(network.sequence(voxels)[0], images)  # type: ignore[operator]


@pytest.mark.parametrize("name", ["e2vid", "firenet"])
def test_gradients_go_back_as_far_as_told(name: str) -> None:
    network = make(name)
    voxels = torch.randn(1, 6, 5, 8, 8, requires_grad=True)
    images, _ = network.sequence(voxels, cut_every=2)  # type: ignore[operator]
    (grad,) = torch.autograd.grad(images[:, -1].sum(), voxels)
    assert not grad[:, :4].any() and grad[:, 4].any() and grad[:, 5].any()


def test_hdr_carries_no_gradients_from_frame_to_frame() -> None:
    network = make("hdr")
    first = torch.rand(1, 3, 16, 16, requires_grad=True)
    _, state = network(first, torch.zeros(1, 5, 16, 16))
    picture, _ = network(torch.rand(1, 3, 16, 16), torch.zeros(1, 5, 16, 16), state)
    assert torch.autograd.grad(picture.sum(), first, allow_unused=True)[0] is None


@pytest.mark.parametrize("size", [(1, 1), (5, 30), (37, 45)])
def test_any_size_of_frames_and_events(size: tuple[int, int]) -> None:
    for name in ("e2vid", "firenet"):
        assert make(name)(torch.zeros(2, 5, *size))[0].shape == (2, 1, *size)
    for second, beside in (("events", torch.zeros(2, 5, *size)), ("frames", torch.rand(2, 3, *size))):
        assert make("hdr", second=second)(torch.rand(2, 3, *size), beside)[0].shape == (2, 3, *size)
    flow = make("flow", bins=3)(*torch.rand(2, 2, 3, *size))
    assert flow.shape == (2, 4, *size)


def seen_around(of: torch.Tensor, where: int, seen: list[torch.Tensor]) -> int:
    """How many pixels around (where, where) of an image a pixel of it depends on."""
    farthest = 0
    for gradient in torch.autograd.grad(of[0, 0, where, where], seen, retain_graph=True):
        k = of.shape[-2] // gradient.shape[-2]
        rows, columns = torch.nonzero(gradient.abs().sum((0, 1)), as_tuple=True)
        for places in (rows, columns):
            farthest = max(farthest, where - k * int(places.min()), k * (int(places.max()) + 1) - 1 - where)
    return farthest


@pytest.mark.parametrize("name", ["e2vid", "firenet", "hdr"])
def test_a_pixel_sees_as_far_as_is_said_of_networks_that_are_run_in_parts(name: str) -> None:
    """Any of what the network gets and remembers; pixels of all phases, as levels are coarser."""
    network, side = make(name).eval(), 272
    voxels, frames = torch.rand(1, 5, side, side).requires_grad_(), torch.rand(1, 6, side, side).requires_grad_()
    if name == "hdr":
        torch.nn.init.normal_(network.out.weight)
        cell = [torch.rand_like(each).requires_grad_() for each in network.residue(frames, voxels, ())[1]]
        image, seen, around = network.residue(frames, voxels, tuple(cell))[0], [voxels, frames, *cell], AROUND
    else:
        states = [[torch.rand_like(each).requires_grad_() for each in state] for state in network.step(voxels, ())[1]]
        image, around = network.step(voxels, tuple(map(tuple, states)))[0], network.around
        seen = [voxels, *(each for state in states for each in state)]
    far = max(seen_around(image, side // 2 + phase, seen) for phase in range(8))
    assert around - 8 < far <= around
