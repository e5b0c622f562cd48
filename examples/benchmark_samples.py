#!/usr/bin/env python3
"""What samples to train with cost: clips, simulated on a thread of the CPU and on a GPU, and samples of them.

    python examples/benchmark_samples.py              128x128 x8, and 256x256 x32
    python examples/benchmark_samples.py --clips 256  of so many clips

Of each kind of clip:

    CPU       clips a second of one thread (`interp.data.making.made`)
    GPU       clips a second (`interp.data.on_card.made_on_card`), after as many others, for which kernels are compiled
    differ    of the codes and of the events of clips made by both, as many are others
    samples   drawn from such clips, altered, a second, by one thread

Without a GPU it says so, and the CPU's are measured alone.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np

KINDS = {
    "photographs 128x128 x8": {"size": (128, 128), "scenes": 0.0},
    "scenes 128x128 x8": {"size": (128, 128), "photographs": 0.0},
    "photographs 256x256 x32": {"size": (256, 256), "multiples": (32,), "scenes": 0.0},
    "scenes 256x256 x32": {"size": (256, 256), "multiples": (32,), "photographs": 0.0},
}
SEED, FEW = 1, 8  # clips that the CPU makes, and that are compared


def rate(work: Any) -> float:
    """How many a second something makes."""
    began, count = time.perf_counter(), sum(1 for _ in work)
    return count / (time.perf_counter() - began)


def of_cpu(settings: Any) -> tuple[dict[int, Any], float]:
    """Clips of the CPU, and how many of them it makes in a second when it makes them again."""
    from interp.data.making import made

    clips = {number: made(settings, SEED, number) for number in range(FEW)}  # (compiles for each kind of sensor)
    return clips, rate(made(settings, SEED, number) for number in range(FEW))


def of_card(settings: Any, count: int) -> tuple[dict[int, Any], float]:
    """The first clips of the GPU, and how many of others it makes in a second."""
    from interp.data.on_card import made_on_card
    from vid2ev.sensors.devices import Device

    card = Device("cuda", "cuda")
    first = dict(made_on_card(settings, SEED, range(count), card))
    return first, rate(made_on_card(settings, SEED, range(count, 2 * count), card))


def apart(ours: dict[int, Any], theirs: dict[int, Any]) -> tuple[float, float]:
    """Shares of codes, and of events, that differ in clips of the same numbers."""
    pairs = [(ours[number], theirs[number]) for number in theirs]
    codes = np.mean([(one.truth != other.truth).mean() for one, other in pairs])
    moved = sum(float(np.abs(one.off_on.astype(float) - other.off_on).sum()) for one, other in pairs)
    return float(codes), moved / max(1, sum(float(other.off_on.sum(dtype=float)) for _, other in pairs))


def samples_per_second(settings: Any, side: int) -> float:
    """Samples that a thread draws in a second from clips that are there."""
    from interp.data.pool import Pool
    from interp.data.samples import Samples, SampleSettings

    with TemporaryDirectory() as folder:
        pool = Pool(Path(folder), settings, SEED, begin=FEW, most=FEW, fresh=0.0)
        pool.fill(0)
        samples = Samples(pool, SampleSettings(size=side), 10**6)
        return rate(samples[index] for index in range(100))


def row(name: str, cells: Sequence[str]) -> str:
    return f"| {name} | {' | '.join(cells)} |"


@click.command()
@click.option("--clips", default=64, show_default=True, help="of the GPU, twice so many")
def main(clips: int) -> None:
    """Clips and samples per second."""
    from interp.data.settings import ClipSettings
    from vid2ev.sensors.devices import missing_for_cuda

    if missing := missing_for_cuda():
        click.echo(f"no GPU: {missing}; the CPU is measured alone")
    click.echo(row("clips", ["CPU, clips/s", "GPU, clips/s", "codes that differ", "events that differ", "samples/s"]))
    click.echo("|---|--:|--:|--:|--:|--:|")
    for name, said in KINDS.items():
        settings = ClipSettings.model_validate(said)
        theirs, cpu = of_cpu(settings)
        cells = ["", "", ""]
        if not missing:
            ours, card = of_card(settings, max(clips, FEW))
            codes, events = apart(ours, theirs)
            cells = [f"{card:.1f}", f"{codes:.1e}", f"{events:.1e}"]
        click.echo(row(name, [f"{cpu:.2f}", *cells, f"{samples_per_second(settings, settings.size[0]):.0f}"]))


if __name__ == "__main__":
    main()
