#!/usr/bin/env python3
"""How fast training clips become events on a CPU, with one thread: straight into grids, and through lists of events.

    python examples/benchmark_clips.py                    256x256 with 32 steps a frame, 128x128 with 8
    python examples/benchmark_clips.py --runs 9 --speed 2

A clip is 9 frames of truth and the steps between them; its light is given: a texture that moves by `--speed` pixels
from frame to frame.  Each clip has a fresh sensor.  Milliseconds of a CPU per clip, the least of some runs in turn:

    fresh     another sensor in the same arrays, settled in the first frame (`Dvs.renew`, `restart`)
    straight  net counts of each step (`Dvs.fill`)
    voxels    a voxel grid of 5 bins of the whole clip, straight
    through   the same counts of lists of events, frame by frame (`Dvs.step`)
"""

from __future__ import annotations

import time
from collections.abc import Callable

import click
import numpy as np

TRUTH, FRAME_NS = 9, 33_333_333
CLIPS = {"256x256 x32": ((256, 256), 32), "128x128 x8": ((128, 128), 8)}


def light_of(size: tuple[int, int], steps: int, speed: float) -> np.ndarray:
    """Linear light [8 steps + 1, height, width] of a smooth texture that moves."""
    rng, (width, height), count = np.random.default_rng(0), size, (TRUTH - 1) * steps + 1
    wide = rng.standard_normal((height, width + int(TRUTH * speed) + 12)).astype(np.float32)
    for _ in range(3):
        wide = (wide + np.roll(wide, 1, 0) + np.roll(wide, 1, 1) + np.roll(wide, (1, 1), (0, 1))) / 4
    texture, at = np.exp(4.0 * wide), np.arange(count) * (speed / steps)
    low = at.astype(int)
    pairs = zip(low.tolist(), (at - low).tolist(), strict=True)
    moved = [(1 - part) * texture[:, k : k + width] + part * texture[:, k + 1 : k + 1 + width] for k, part in pairs]
    return np.stack(moved).astype(np.float32)


def parts_of(spec: object, light: np.ndarray, steps: int) -> tuple[dict[str, Callable], Callable]:
    """What is measured of a sensor and a clip, each after a `fresh` one; and how many events a pixel sent."""
    from vid2ev.sensors.dvs import Dvs
    from vid2ev.views.grid import NetCounts, Windows
    from vid2ev.views.voxel import Voxel

    size = light.shape[2], light.shape[1]
    t_ns = (np.arange(len(light)) * (FRAME_NS / steps)).astype(np.int64)
    sensor, edges = Dvs(spec, size, skip=False), t_ns // 1000  # type: ignore[arg-type]

    def fresh() -> None:
        sensor.renew(spec, 1)  # type: ignore[arg-type]
        sensor.restart(light[0], 0)

    def straight() -> None:
        grid = NetCounts(size, edges)
        sensor.fill(grid, light[1:], t_ns[1:])
        grid.take()

    def voxels() -> None:
        grid = Windows(size, Voxel, [(0, int(edges[-1]))])
        sensor.fill(grid, light[1:], t_ns[1:])
        grid.take()

    def through() -> None:
        grid = NetCounts(size, edges)
        for frame, t in zip(light[1:], t_ns[1:], strict=True):
            grid.add(sensor.step(frame, int(t)))
        grid.take()

    def per_pixel() -> float:
        return (sensor.counts["on"] + sensor.counts["off"]) / (size[0] * size[1])

    return {"fresh": fresh, "straight": straight, "voxels": voxels, "through": through}, per_pixel


def milliseconds(parts: dict[str, Callable], runs: int) -> dict[str, float]:
    """The least time of a CPU of each part, in turn."""
    least = dict.fromkeys(parts, float("inf"))
    for _ in range(runs + 1):  # (one more: the first compiles)
        for name, part in parts.items():
            if name != "fresh":
                parts["fresh"]()
            began = time.process_time()
            part()
            least[name] = min(least[name], 1e3 * (time.process_time() - began))
    return least


@click.command()
@click.option("--runs", default=5, show_default=True, help="runs of each, of which the fastest counts")
@click.option("--speed", default=1.0, show_default=True, help="pixels from frame to frame")
def main(runs: int, speed: float) -> None:
    """Training clips per second."""
    from vid2ev import load_sensor

    click.echo("| clip | sensor | events/pixel | fresh | straight | voxels | through | clips/s |")
    click.echo("|---|---|--:|--:|--:|--:|--:|--:|")
    for clip, (size, steps) in CLIPS.items():
        light = light_of(size, steps, speed)
        for name in ("paper", "ideal"):
            parts, per_pixel = parts_of(load_sensor(name), light, steps)
            ms = milliseconds(parts, runs)
            numbers = " | ".join(f"{ms[part]:.1f}" for part in ms)
            clips = 1e3 / (ms["fresh"] + ms["straight"])
            click.echo(f"| {clip} | {name} | {per_pixel():.2f} | {numbers} | {clips:.0f} |")


if __name__ == "__main__":
    main()
