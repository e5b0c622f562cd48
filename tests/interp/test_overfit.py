"""Every network can learn a clip by heart: what it is made of is joined up rightly, and its gradients lead somewhere.

Steps are bounded so that each takes less than a minute of two cores.
"""

from __future__ import annotations

import pytest
import torch
from overfit_clip import affine_psnr_db, made_clip, psnr_db
from pairs import FRAME_FED

from interp.candidates.ramps import ramps
from interp.losses import objectives
from interp.losses.perceptual import Perceptual
from interp.losses.terms import charbonnier
from interp.networks import make
from interp.networks.frame_fed import Interpolated

pytestmark = pytest.mark.slow
ENOUGH_DB, ENOUGH_FROM_EVENTS_DB = 34.0, 24.0
STEPS, STEPS_FROM_EVENTS = 220, 300
TOGETHER = 3  # targets of a step
CLIP = made_clip()
FEATURES = Perceptual(squared=True)


def loss_of(name: str, made: Interpolated, truth: torch.Tensor, progress: float) -> torch.Tensor:
    if name in ("superslomo", "slomo_events"):
        return torch.stack(list(objectives.super_slomo(made, *CLIP.pair(), truth, FEATURES).values())).sum() / 204
    if name == "rrin_events_light":
        return torch.stack(list(objectives.supervised_residue(made, truth, progress).values())).sum()
    return charbonnier(made.images, truth)


@pytest.mark.parametrize("name", FRAME_FED)
def test_networks_of_frames_learn_a_clip_by_heart(name: str) -> None:
    network = make(name, "tiny")
    optimiser = torch.optim.AdamW(network.parameters(), 1e-3 if name in ("superslomo", "slomo_events") else 2e-3)
    counts, times, truth = CLIP.counts(), CLIP.times(), CLIP.truth()
    best = 0.0
    for step in range(STEPS):
        chosen = torch.randperm(len(times))[:TOGETHER]
        made = network(*CLIP.pair(), times[chosen], counts)
        optimiser.zero_grad()
        loss_of(name, made, truth[:, chosen], step / STEPS).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        if step % 20 == 19:
            with torch.no_grad():
                best = max(best, psnr_db(network(*CLIP.pair(), times, counts).images, truth))
            if best > goal_db(name):
                break
    assert best > goal_db(name)


def goal_db(name: str) -> float:
    """What is asked of all; of a network that starts at the ramps, to be better than that."""
    if name != "rrin_events_light":
        return ENOUGH_DB
    closed = ramps(*CLIP.pair(), CLIP.counts(), CLIP.times()[None])
    return max(ENOUGH_DB, psnr_db(closed, CLIP.truth()) + 1)


@pytest.mark.parametrize("name", ["e2vid", "firenet"])
def test_networks_of_events_learn_a_clip_by_heart(name: str) -> None:
    network, features = make(name, "tiny"), Perceptual()
    optimiser = torch.optim.AdamW(network.parameters(), 3e-3 if name == "e2vid" else 1e-2)
    voxels, truth = CLIP.voxels(), CLIP.frames[None, 1:].mean(2, keepdim=True)
    best = 0.0
    for step in range(STEPS_FROM_EVENTS):
        images, _ = network.sequence(voxels)  # type: ignore[operator]
        optimiser.zero_grad()
        torch.stack(list(objectives.reconstruction(images, truth, features).values())).sum().backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        if step % 20 == 19:
            best = max(best, affine_psnr_db(images.detach()[:, 1:], truth[:, 1:]))
            if best > ENOUGH_FROM_EVENTS_DB:
                break
    assert best > ENOUGH_FROM_EVENTS_DB
