"""Each kind of network learns: its loss falls, and its predictions are scored and pictured."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from small_run import SIDE, sample
from torch.utils.data import default_collate

from interp.light import grey
from interp.networks import make
from interp.networks.frame_fed import Interpolated
from interp.train.event_fed import EventFedLearner, aligned, windows
from interp.train.flow import FlowLearner
from interp.train.frame_fed import FrameFedLearner
from interp.train.hdr import HdrLearner, seen
from interp.train.learner import Learner
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.true_flows import with_flow_between, with_flows

KINDS = {  # (of each loss one)
    "superslomo": FrameFedLearner,
    "rrin_events": FrameFedLearner,
    "rrin_light": FrameFedLearner,
    "rrin_events_light": FrameFedLearner,
    "timelens": FrameFedLearner,
    "flow": FlowLearner,
    "e2vid": EventFedLearner,
    "firenet": EventFedLearner,
    "hdr": HdrLearner,
}


GREY = [name for name in KINDS if KINDS[name] is not EventFedLearner]


def learner(name: str, colours: int = 3) -> Learner:
    torch.manual_seed(0)
    options = {"colours": colours} if name in GREY else {}
    rate = 5e-3 if KINDS[name] is EventFedLearner else 1e-4 if name == "hdr" else 1e-3
    recipe, network = Recipe(steps=8, rate=rate), make(name, **options)
    if name == "hdr":  # (which begins with frames that are right already, wherever they are not clipped)
        torch.nn.init.normal_(network.out.weight, std=0.05)  # type: ignore[arg-type, union-attr]
    made: Any = KINDS[name](name, network, recipe, Schedule(0, 1.0, ((0, 8),)))  # type: ignore[arg-type]
    made._trainer = SimpleNamespace(global_step=0, world_size=1)
    return made


def batch(name: str, side: int = 2 * SIDE, colours: int = 3) -> dict[str, torch.Tensor]:
    """Four frames one after the other, and what is between the first and the last."""
    found = sample(0)
    if issubclass(KINDS[name], FrameFedLearner):
        found |= {key: grey(found[key]) for key in ("frames", "truth")} if colours == 1 else {}
        return {key: part[None] for key, part in with_flow_between(found).items()}
    light = (
        torch.rand(3, 8, 8, generator=torch.Generator().manual_seed(1)).repeat_interleave(5, 1).repeat_interleave(5, 2)
    )
    truth = torch.stack([light[:colours, k : k + side, :side] for k in range(4)])
    off_on = torch.poisson(torch.full((2, 9, side, side), 0.2), torch.Generator().manual_seed(2)).to(torch.uint8)
    codes = (truth - 0.2).clamp(0, 0.5) / 0.5
    sensor = {"clipped": codes, "range": torch.tensor([0.2, 0.7])}
    events = {"off_on": off_on, "footprint": torch.tensor(1), "contrast": torch.full((2,), 0.15)}
    sequence = {"truth": truth} | events | sensor
    return {key: part[None] for key, part in with_flows(sequence).items()}


@pytest.mark.parametrize("name", ["rrin_events_guided", "rrin_events_light"])
def test_of_a_batch_each_is_made_as_if_alone_however_coarse_its_events_are(name: str) -> None:
    samples = [sample(number) | {"footprint": torch.tensor(k)} for number, k in enumerate((2, 1, 3, 1, 2))]
    torch.manual_seed(0)
    learning = FrameFedLearner(name, make(name, zero_heads=False), Recipe(steps=8), Schedule(0, 1.0, ((0, 8),)))
    with torch.no_grad():
        made = learning.made(default_collate(samples))
        for number, one in enumerate(samples):
            alone = learning.made({key: part[None] for key, part in one.items()})
            for field in fields(Interpolated):
                ours, wanted = getattr(made, field.name), getattr(alone, field.name)
                assert (ours is None) == (wanted is None)
                if wanted is not None:
                    torch.testing.assert_close(ours[number : number + 1], wanted, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize(("name", "colours"), [*((name, 3) for name in KINDS), *((name, 1) for name in GREY)])
def test_the_loss_falls(name: str, colours: int) -> None:
    learning, one = learner(name, colours), batch(name, colours=colours)
    optimizer = learning.configure_optimizers()["optimizer"]
    losses = []
    for _ in range(8):
        loss = torch.stack(list(learning.parts(one).values())).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.99 * losses[0], losses
    with torch.no_grad():
        images = learning.eval().predicted(one)
    assert all(np.isfinite(each.psnr) for each in learning.scored(one, images))
    rgb = learning.picture(one, images)
    assert rgb.dtype == np.uint8 and rgb.shape[2] == 3 and rgb.std() > 0
    for method, others in learning.baselines(one).items():
        assert others.shape == images.shape, method


def test_codes_of_a_clipped_frame_stand_for_the_light_in_its_range() -> None:
    one = batch("hdr")
    torch.testing.assert_close(seen(one), one["truth"].clamp(0.2, 0.7), atol=1e-6, rtol=0)  # (float32)


def test_windows_of_a_sequence_hold_the_events_between_its_frames() -> None:
    one = batch("e2vid")
    voxels = windows(one, 1)
    per_window = one["off_on"].float().unflatten(2, (3, 3)).sum(3)
    change = 0.15 * (per_window[:, 1] - per_window[:, 0])
    torch.testing.assert_close(voxels[:, :, 0], change / 0.45, atol=1e-5, rtol=0)  # (a third for an event of 0.15 nat)


def test_alignment_takes_brightness_and_contrast_away_and_nothing_else() -> None:
    truth = grey(batch("e2vid")["truth"])[0]
    torch.testing.assert_close(aligned(0.3 * truth - 0.2, truth), truth, atol=1e-5, rtol=0)
    flat = aligned(torch.full_like(truth, 0.4), truth)  # (nothing to scale)
    assert float((flat - truth.mean((1, 2, 3), keepdim=True)).abs().max()) < 1e-5


def test_flows_lead_to_the_frame_before_and_to_the_first() -> None:
    noise = torch.nn.functional.interpolate(torch.rand(1, 3, 24, 24), size=(96, 96), mode="bicubic")[0].clamp(0, 1)
    truth = torch.stack([noise[:, 10:74, 10 + 2 * k : 74 + 2 * k] for k in range(3)])  # moves left by 2 px a frame
    found = with_flows({"truth": truth})
    middle = (slice(None), slice(16, -16), slice(16, -16))
    for flow in found["flows"]:
        assert float((flow[middle] - torch.tensor([2.0, 0.0])[:, None, None]).abs().median()) < 0.2
    assert float((found["flows_to_first"][1][middle][0] - 4).abs().median()) < 0.3
