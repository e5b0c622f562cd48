#!/usr/bin/env python3
"""What it is worth that a camera stands still: a scene converted with and without `--no-skip`, from scene to events.

    python examples/benchmark_still.py                    a ball flies before a wall: about 5 % of the tiles change
    python examples/benchmark_still.py --sensor v2e-noisy --size 640x480
    python examples/benchmark_still.py --scene spinning-shapes

`--effects all --no-skip`, `--effects all` and `--effects auto` are run in turns, each in a process of its own.  The
table has the least of the seconds, by the clock and of all cores.  The events of the first two are compared byte by
byte.  A tile is 64x32 pixels; the share that changes is that of 24 pairs of frames in a row.
"""

from __future__ import annotations

import itertools
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np

from vid2ev.sources import open_source

SCENE = """
[scene]
duration_s = 0.5
ambient = 0.5

[camera]
size = [{width}, {height}]
fov_deg = 60

[[lights]]
name = "sun"
kind = "sun"
direction = [0.3, 1.0, 0.6]
colour = 0.6
shadows = true

[[objects]]
name = "wall"
kind = "plane"
size_m = [12, 8, 0]
texture = "brick"
repeat = [4, 3]
trajectory = {{ kind = "fixed", position_m = [0, 0, 5] }}

[[objects]]
name = "ball"
kind = "sphere"
size_m = 0.6
texture = "gravel"
trajectory = [
    {{ kind = "straight", at_s = 0.25, position_m = [0, 0, 3.5], velocity_m_s = [0.8, 0.1, 0] }},
    {{ kind = "spin", axis = [0, 1, 0], rate_deg_s = 90 }},
]
"""
WAYS = {
    "all, no skip": ("--effects", "all", "--no-skip"),
    "all": ("--effects", "all"),
    "auto": ("--effects", "auto"),
}
TILE = (32, 64)  # rows, columns


def share_changed(source: str) -> float:
    """The share of tiles that change from one frame to the next."""
    film = open_source(source)
    first = max(0, min(100, (film.frames_expected or 0) - 25))
    lights = (frame.light for frame in itertools.islice(film.frames(), first, first + 25))
    shares = []
    for before, after in itertools.pairwise(lights):
        rows, columns = (after.shape[k] // TILE[k] for k in range(2))
        differ = (before != after)[: rows * TILE[0], : columns * TILE[1]]
        shares.append(differ.reshape(rows, TILE[0], columns, TILE[1]).any(axis=(1, 3)).mean())
    return float(np.mean(shares))


def seconds(source: str, sensor: str, into: Path, options: tuple[str, ...]) -> tuple[float, float]:
    """By the clock, and of all cores, that a conversion takes."""
    command = [sys.executable, "-m", "vid2ev", "convert", source, "--sensor", sensor, "-o", str(into), "--no-preview"]
    used, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*command, "-q", "--overwrite", *options], check=True)
    wall, now = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime


@click.command(help=__doc__.split("\n\n")[0] if __doc__ else None)
@click.option("--scene", help="A scene or its file, in place of the ball.")
@click.option("--size", default="1280x720", show_default=True, metavar="WIDTHxHEIGHT", help="Of the ball's picture.")
@click.option("--sensor", default="paper", show_default=True)
@click.option("--rounds", type=click.IntRange(1), default=2, show_default=True)
def main(scene: str | None, size: str, sensor: str, rounds: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ball.toml"
        width, height = size.split("x")
        file.write_text(SCENE.format(width=width, height=height))
        source = f"scene:{scene or file}"
        click.echo(f"{100 * share_changed(source):.1f} % of the tiles change from frame to frame\n")
        times: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
        for _ in range(rounds):
            for number, (way, options) in enumerate(WAYS.items()):
                times[way].append(seconds(source, sensor, Path(folder) / str(number), options))
        if (Path(folder) / "0" / "events.h5").read_bytes() != (Path(folder) / "1" / "events.h5").read_bytes():
            raise click.ClickException("other events with skip than without")
    walls, cores = ({way: min(pair[k] for pair in times[way]) for way in WAYS} for k in range(2))
    click.echo("| --effects | s | s of all cores | times as fast |\n| --- | --: | --: | --: |")
    for way in WAYS:
        click.echo(f"| {way} | {walls[way]:.1f} | {cores[way]:.1f} | {walls['all, no skip'] / walls[way]:.1f} |")


if __name__ == "__main__":
    main()
