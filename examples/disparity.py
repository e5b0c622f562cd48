#!/usr/bin/env python3
"""What the distance between the two cameras costs: frames rebuilt from events of a camera that stands beside.

    python examples/disparity.py                                the table, and disparity.png
    python examples/disparity.py --method guided --method run/weights.safetensors --scenes 3

A thing is held close before a wall; a frame camera of 384x288 pixels and a clean event camera of a ninth of them, a
baseline apart, see it.  Every 8th of 240 frames a second is a key frame, and the others are rebuilt without being told
of the distance.  PSNR against 255, mean over the scenes; disparity is of the pixels of the frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np
from error_analysis import CLEAN, INK, METHODS_TRIED, TRUTH, scored
from matplotlib.figure import Figure

from interp.evaluate.simulated import Simulated
from interp.methods import METHODS
from vid2ev import open_source
from vid2ev.making.conversion import convert

SCENE = """
[scene]
duration_s = 1
ambient = 0.3

[camera]
size = [384, 288]
fov_deg = 58
trajectory = { kind = "shake", rms_mm = 1.5, rms_deg = 0.3, low_hz = 0.4, high_hz = 8.0, seed = 1 }

[[objects]]
name = "wall"
kind = "plane"
size_m = [3.2, 2.4, 0]
texture = { choice = ["astronaut", "motorcycle", "cat"] }
repeat = [2, 2]
trajectory = { kind = "fixed", position_m = [0, 0, 0.8] }

[[objects]]
name = "close"
kind = { choice = ["box", "sphere"] }
size_m = [0.11, 0.11, 0.11]
texture = { choice = ["coffee", "retina", "coins"] }
trajectory = [
    { kind = "straight", at_s = 0.5, position_m = [0, 0, 0.3], velocity_m_s = { uniform = [
        [-0.2, -0.1, 0], [0.2, 0.1, 0]
    ] } },
    { kind = "spin", axis = [0.3, 1, 0.2], rate_deg_s = { uniform = [20, 150] }, phase_deg = { uniform = [0, 360] } },
]

[[lights]]
name = "sun"
kind = "sun"
direction = [0.3, 0.7, 0.8]
"""
BASELINES_MM = (0, 5, 10, 15, 20)
START_S, STOP_S = 0.4, 0.7
SKIP = 7  # of 8 frames


def disparity_px(scene: str, baseline_mm: float) -> tuple[float, float]:
    """Mean and largest disparity in the middle of what is recorded."""
    world = open_source(scene).world  # type: ignore[attr-defined]
    depth_m = world.render(round(5e8 * (START_S + STOP_S))).depth
    found = world.intrinsics.focal_px[0] * baseline_mm / 1000 / depth_m
    return float(found.mean()), float(found.max())


def scores_db(scene: str, baseline_mm: float, methods: Sequence[str]) -> list[float]:
    """PSNR of each method where the event camera stands so far to the right."""
    dvs = f'[[camera]]\nname = "events"\nkind = "dvs"\nsensor = "paper"\nsize = [128, 96]\n{CLEAN}\n'
    with TemporaryDirectory() as folder:
        rig, recording = Path(folder) / "rig.toml", Path(folder) / "recording"
        rig.write_text(f"{TRUTH}size = [384, 288]\n\n{dvs}translation_mm = [{baseline_mm}, 0, 0]\n")
        convert(scene, recording, rig=rig, pictures="png", preview=False, start=START_S, stop=STOP_S)
        return list(scored(str(recording), methods, SKIP, Simulated.of("clean")).psnr_db.values())


def drawn(means_px: Sequence[float], scores: np.ndarray, names: Sequence[str]) -> Figure:
    """PSNR of each method against mean disparity."""
    figure = Figure(figsize=(5.6, 3.4), layout="constrained")
    axis = figure.subplots()
    for name, of in zip(names, scores.T, strict=True):
        axis.plot(means_px, of, color=INK, marker="o", markersize=3, linewidth=1.1)
        above = [other for other in scores[0] if 0 < other - of[0] < 0.1 * np.ptp(scores[0])]
        place = (0, -12) if above else (0, 5)  # (below, where another line is close above)
        axis.annotate(name, (means_px[0], of[0]), place, textcoords="offset points", color=INK, fontsize=8)
    axis.set_xlabel("mean disparity [px]", color=INK)
    axis.set_ylabel("PSNR [dB]", color=INK)
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(alpha=0.25)
    return figure


@click.command(help="Score methods with an event camera that stands further and further beside the frame camera.")
@click.option("--method", "methods", multiple=True, default=METHODS_TRIED, show_default=True)
@click.option("--scenes", default=2, show_default=True, help="How many.")
@click.option("-o", "--output", default="disparity.png", show_default=True)
def main(methods: tuple[str, ...], scenes: int, output: str) -> None:
    """Score, print, draw."""
    methods = tuple(sorted(methods, key=lambda name: name not in METHODS))  # (as they are scored)
    names = [Path(name).stem for name in methods]
    head = ["baseline", "mean disparity", "largest", *names]
    click.echo(f"| {' | '.join(head)} |\n|{' --: |' * len(head)}")
    means, scores = list[float](), list[np.ndarray]()
    with TemporaryDirectory() as folder:
        (Path(folder) / "near.toml").write_text(SCENE)
        for baseline_mm in BASELINES_MM:
            seen = [f"scene:{folder}/near.toml,seed={seed}" for seed in range(scenes)]
            mean, largest = np.mean([disparity_px(scene, baseline_mm) for scene in seen], axis=0)
            scores.append(np.mean([scores_db(scene, baseline_mm, methods) for scene in seen], axis=0))
            means.append(mean)
            shown = " | ".join(f"{score:.1f}" for score in scores[-1])
            click.echo(f"| {baseline_mm} mm | {mean:.1f} px | {largest:.1f} px | {shown} |")
    drawn(means, np.array(scores), names).savefig(output, dpi=110)


if __name__ == "__main__":
    main()
