"""The network for flow learns the motion that there is, and what learns it fits where others take it frozen."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import torch
from torch.nn import functional as F

from interp import weights
from interp.networks import make
from interp.train.flow import FlowLearner
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.true_flows import with_flow_between

WAY = (4, 2)  # px to the right and down, from frame to frame


def moving() -> dict[str, torch.Tensor]:
    """A texture that moves, with what there is halfway."""
    texture = F.interpolate(torch.rand(1, 3, 24, 24), size=(96, 96), mode="bicubic")[0].clamp(0, 1)
    pictures = [texture[:, 16 - down : 80 - down, 16 - right : 80 - right] for right, down in ((0, 0), (2, 1), WAY)]
    sample = {
        "frames": torch.stack([pictures[0], pictures[2]]),
        "off_on": torch.zeros(2, 8, 64, 64, dtype=torch.uint8),
        "footprint": torch.tensor(1),
        "contrast": torch.full((2,), 0.15),
        "times": torch.tensor([0.5]),
        "truth": pictures[1][None],
    }
    return {name: part[None] for name, part in with_flow_between(sample).items()}


def test_it_finds_the_motion_of_a_texture_and_serves_others_frozen(tmp_path: Path) -> None:
    one, network = moving(), make("flow", "tiny")
    learner: Any = FlowLearner("flow", network, Recipe(steps=100, rate=1e-3), Schedule(0, 1.0))
    learner._trainer = SimpleNamespace(global_step=0, world_size=1)
    optimizer = learner.configure_optimizers()["optimizer"]
    for _ in range(100):
        loss = torch.stack(list(learner.parts(one).values())).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    first, last = one["frames"].unbind(1)
    with torch.no_grad():
        found = network(first, last)[0, :, 12:-12, 12:-12]
    true = torch.tensor([*WAY, -WAY[0], -WAY[1]]).float()[:, None, None]
    assert float((found - true).abs().mean()) < 0.3  # [px]
    weights.save(tmp_path / "weights.safetensors", "flow", network)
    other: Any = make("rrin_slomo_events", "tiny", flow="pretrained")
    weights.load_part(other, "flow", tmp_path / "weights.safetensors")
    with torch.no_grad():
        torch.testing.assert_close(other.prepare(first, last).flows, network(first, last))
