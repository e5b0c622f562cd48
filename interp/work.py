"""What a network costs: parameters, and products and sums of its convolutions per pixel.

`python -m interp.work` prints the table of README.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeVar

import torch
from torch import nn

from interp.networks import make, names
from interp.networks.event_fed import EventFed
from interp.networks.frame_fed import FrameFed
from interp.networks.hdr import Hdr
from interp.representation.event_counts import EventCounts

Made = TypeVar("Made")
SIDE = 32
SIZES = ("tiny", "small", "paper")


class Work(NamedTuple):
    """Of one image of a network: parameters, kMAC/px once per pair of frames, kMAC/px for each target."""

    parameters: int
    once: float
    each: float


def work_of(network: nn.Module) -> Work:
    """The work of a network, counted while it makes an image of 32 x 32 pixels."""
    parameters = sum(parameter.numel() for parameter in network.parameters())
    spec: Any = network.spec
    frame = torch.zeros(1, getattr(spec, "colours", 1), SIDE, SIDE)
    voxels = torch.zeros(1, getattr(spec, "bins", 1), SIDE, SIDE)
    with torch.no_grad():
        if isinstance(network, FrameFed):
            once, pair = _counted(network, lambda: network.prepare(frame, frame, EventCounts.none(1, (SIDE, SIDE))))
            return Work(parameters, once, _counted(network, lambda: network.at(pair, [0.5]))[0])
        if isinstance(network, EventFed):
            return Work(parameters, 0.0, _counted(network, lambda: network(voxels))[0])
        if isinstance(network, Hdr):
            second = voxels if spec.second == "events" else frame
            return Work(parameters, 0.0, _counted(network, lambda: network(frame, second))[0])
        return Work(parameters, _counted(network, lambda: network(frame, frame))[0], 0.0)


def table() -> Iterator[str]:
    """The lines of a table in Markdown, of all networks and sizes."""
    yield "| network | parameters: tiny | small | paper | kMAC/px once per pair + each target: tiny | small | paper |"
    yield "|---|---|---|---|---|---|---|"
    for name in names():
        works = [work_of(make(name, size)) for size in SIZES]
        cells = [f"{work.parameters:,}" for work in works] + [f"{work.once:.1f} + {work.each:.1f}" for work in works]
        yield f"| `{name}` | {' | '.join(cells)} |"


def _counted(network: nn.Module, call: Callable[[], Made]) -> tuple[float, Made]:
    """kMAC per pixel of the convolutions that a call runs, and what it gives."""
    with _counting(network) as macs:
        made = call()
    return sum(macs) / SIDE**2 / 1000, made


@contextmanager
def _counting(network: nn.Module) -> Iterator[list[int]]:
    macs: list[int] = []

    def count(layer: nn.Module, _inputs: object, output: torch.Tensor) -> None:
        assert isinstance(layer, nn.Conv2d)
        macs.append(output.numel() * layer.weight[0].numel())

    hooks = [layer.register_forward_hook(count) for layer in network.modules() if isinstance(layer, nn.Conv2d)]
    try:
        yield macs
    finally:
        for hook in hooks:
            hook.remove()


if __name__ == "__main__":
    print("\n".join(table()))
