#!/usr/bin/env python3
"""How fast other cameras' views of a video are made.

    python examples/benchmark_views.py                        640x480, one thread and two
    python examples/benchmark_views.py --size 1280x720 --threads 4

The picture is noise that a lens has blurred; the scene, where depth counts, is twelve cards before a wavy wall.  The
camera is 15 mm beside the source and turned by a degree; `third` has a third of the pixels each way.  `depth, still` is
one depth map for all frames, `depth, moving` another one for each.

Times are the best of the rounds, without the first use, which compiles; the cases take turns.  `views/s` is by the
clock, and says as much about what else the machine does; the time of the processor, of all threads together, does not.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

import click
import cv2
import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.views import Views

POSE = Pose.of((0.4, 1.0, 0.2), (0.015, 0, 0))


def scene(size: tuple[int, int]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Light [H, W, 3], and depth maps of two instants."""
    width, height = size
    random = np.random.default_rng(0)
    light = cv2.GaussianBlur(random.random((height, width, 3), np.float32), (0, 0), 1)
    x, y = np.meshgrid(np.linspace(0, 6, width), np.linspace(0, 5, height))
    wall = (3 + 0.2 * np.sin(x) * np.cos(y)).astype(np.float32)
    maps = [wall.copy(), wall.copy()]
    for _ in range(12):
        left, top = random.integers(0, width * 3 // 4), random.integers(0, height * 3 // 4)
        right, bottom = (
            left + random.integers(width // 20, width // 5),
            top + random.integers(height // 20, height // 5),
        )
        for shift, depth_m in enumerate(maps):
            depth_m[top:bottom, left + shift : right + shift] = random.uniform(0.6, 2)
    return light, maps


def cases(size: tuple[int, int], threads: int) -> dict[str, Callable[[], object]]:
    """Each makes one view."""
    source = Intrinsics.of_field(size)
    light, maps = scene(size)
    third = source.scaled_to((size[0] // 3, size[1] // 3))
    made: dict[str, Callable[[], object]] = {}
    for colour, picture in (("luminance", light @ np.float32([0.2126, 0.7152, 0.0722])), ("RGB", light)):
        for name, camera in (("plane", source), ("plane, third", third)):
            views = Views(source, [(camera, POSE)], 2.0, threads=threads)
            made[f"{name}, {colour}"] = lambda views=views, picture=picture: views.see(picture)
        still, moving = (Views(source, [(source, POSE)], threads=threads) for _ in range(2))
        turns = itertools.cycle(maps)
        made[f"depth, still, {colour}"] = lambda views=still, picture=picture: views.see(picture, maps[0])
        made[f"depth, moving, {colour}"] = lambda views=moving, picture=picture, turns=turns: views.see(
            picture, next(turns)
        )
    return made


@click.command(help="Make views by plane and by depth; print how long they take.")
@click.option("--size", default="640x480", show_default=True, help="Of the source and of the camera.")
@click.option("--threads", multiple=True, type=int, default=(1, 2), show_default=True, help="May be given again.")
@click.option("--rounds", default=20, show_default=True, help="How often; the best counts.")
def main(size: str, threads: tuple[int, ...], rounds: int) -> None:
    """Measure, then print."""
    width, _, height = size.partition("x")
    made = {(name, n): case for n in threads for name, case in cases((int(width), int(height)), n).items()}
    best = {key: (np.inf, np.inf) for key in made}
    for turn, key in itertools.product(range(rounds + 1), made):
        begin, begin_cpu = time.perf_counter(), time.process_time()
        made[key]()
        took = time.perf_counter() - begin, time.process_time() - begin_cpu
        if turn:
            best[key] = (min(best[key][0], took[0]), min(best[key][1], took[1]))
    click.echo("| view | threads | views/s | ms of the clock | ms of the processor |\n|---|---:|---:|---:|---:|")
    for (name, n), (wall_s, cpu_s) in best.items():
        click.echo(f"| {name} | {n} | {1 / wall_s:.0f} | {1e3 * wall_s:.1f} | {1e3 * cpu_s:.1f} |")


if __name__ == "__main__":
    main()
