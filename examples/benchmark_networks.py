#!/usr/bin/env python3
"""How fast networks are, with first weights: they make frames of 1280x720, and learn from samples of 256x256.

    python examples/benchmark_networks.py                  on the GPU, if there is one
    python examples/benchmark_networks.py --size 256x144   frames of another size; on a CPU 1280x720 takes minutes

frames     seven between two, motion between the two counted in, in 32 (TF32 on a GPU) and 16 bits; memory at the most
samples    a step of AdamW on a batch that is there already, without making samples: two targets each
"""

from __future__ import annotations

import time
from collections.abc import Callable

import click
import torch

from interp.methods.gap import Gap
from interp.methods.of_networks import OfFrames
from interp.methods.running import Running, laid_out
from interp.networks import make
from interp.representation.event_counts import EventCounts
from interp.train.job import Job
from interp.train.made_of import learner_of

FRAMES = [("rrin_events", "small"), ("rrin_events", "paper"), ("rrin_slomo_events", "small"), ("timelens", "small"),
          ("rrin_events_guided", "small")]  # fmt: skip
LEARNING = ["rrin_events", "rrin_slomo_events", "rrin_events_guided"]
TARGETS, RUNS, STEPS, SIDE = 7, 4, 12, 256


def counts(batch: int, size: tuple[int, int]) -> EventCounts:
    """An event in every fiftieth pixel, polarity and 32nd of the gap."""
    width, height = size
    off_on = torch.rand(batch, 2, 32, height, width) < 0.02
    return EventCounts(off_on.to(torch.uint8), torch.full((batch, 2), 0.2))


def seconds(work: Callable[[], object], runs: int, device: str) -> float:
    """The mean time of some runs after two that do not count."""
    for k in range(2 + runs):
        if k == 2:
            _await(device)
            began = time.perf_counter()
        work()
    _await(device)
    return (time.perf_counter() - began) / runs


def _await(device: str) -> None:
    if device == "cuda":
        torch.cuda.synchronize()


def frames_per_second(name: str, network_size: str, precision: str, size: tuple[int, int], device: str) -> str:
    """A line of the table."""
    torch.manual_seed(0)
    first = torch.nn.functional.interpolate(torch.rand(1, 3, 90, 160), size[::-1], mode="bilinear")[0].to(device)
    gap = Gap(first, first.roll(5, 2), counts(1, size).to(device))
    running = Running(precision)
    method = OfFrames(name, running.ready(make(name, network_size).to(device).eval()), True, running)
    times = torch.arange(1, TARGETS + 1, device=device) / (TARGETS + 1)
    taken = seconds(lambda: method.begin().between(gap, times), RUNS, device)
    most = f"{torch.cuda.max_memory_allocated() / 1e9:.1f} GB" if device == "cuda" else ""
    return f"| {name}, {network_size} | {precision} | {TARGETS / taken:.1f} | {most} |"


def samples_per_second(name: str, batch: int, device: str) -> str:
    """Another line."""
    job = Job.of(name, "small", [f"samples.size={SIDE}", f"clips.size=[{SIDE},{SIDE}]", f"batch={batch}", "steps=100"])
    learner = learner_of(job).to(device)
    laid_out(learner.network)
    sample = {
        "frames": torch.rand(batch, 2, 3, SIDE, SIDE), "truth": torch.rand(batch, 2, 3, SIDE, SIDE),
        "off_on": counts(batch, (SIDE, SIDE)).off_on, "contrast": torch.full((batch, 2), 0.2),
        "times": torch.tensor([[0.25, 0.625]]).repeat(batch, 1),
    }  # fmt: skip
    sample = {key: value.to(device) for key, value in sample.items()}
    optimizer = torch.optim.AdamW([weight for weight in learner.parameters() if weight.requires_grad], 1e-4)

    def step() -> None:
        with torch.autocast(device, torch.bfloat16, enabled=device == "cuda"):
            loss = torch.stack(list(learner.parts(sample).values())).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    return f"| {name}, small | {batch} | {batch / seconds(step, STEPS, device):.1f} |"


@click.command()
@click.option("--size", default="1280x720", show_default=True, help="Of frames.")
@click.option("--batch", default=32, show_default=True, help="Samples per step.")
def main(size: str, batch: int) -> None:
    """Frames and samples a second."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    width, height = map(int, size.split("x"))
    click.echo(torch.cuda.get_device_name() if device == "cuda" else f"{torch.get_num_threads()} threads of a CPU")
    click.echo(f"\n| network | bits | frames/s at {size} | memory |\n|---|---|--:|--:|")
    for name, network_size in FRAMES:
        for precision in ("float32", "bfloat16"):
            click.echo(frames_per_second(name, network_size, precision, (width, height), device))
    click.echo(f"\n| network | batch | samples/s at {SIDE}x{SIDE} |\n|---|--:|--:|")
    for name in LEARNING:
        click.echo(samples_per_second(name, batch, device))


if __name__ == "__main__":
    main()
