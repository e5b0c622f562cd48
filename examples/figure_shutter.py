#!/usr/bin/env python3
"""Draw what a shutter does to a frame: one frame of a scene by exposure time and line readout time.

    python examples/figure_shutter.py                         posts and boxes, to shutter.png
    python examples/figure_shutter.py --scene scene:spinning-shapes -o mine.png

The camera turns to the right.  Columns: a longer exposure blurs what moves.  Rows: when each line of pixels opens later
than the one above it, what moves sideways leans.  All frames open at the same instant, all are of the same light, and
nothing but the two times differs.
"""

from __future__ import annotations

from collections.abc import Sequence

import click
import numpy as np
from matplotlib.figure import Figure

from vid2ev import Cis, load_cis, open_source

SCENE = "scene:parallax,seed=1,size=480x360,camera.trajectory={kind='spin',axis=[0,1,0],rate_deg_s=130,phase_deg=-3}"
INK = "#7a7a7a"  # readable on white and on black


def exposed(scene: str, exposures_ms: Sequence[float], lines_us: Sequence[float]) -> list[list[np.ndarray]]:
    """Pictures in 8 bits [H, W, 3] of the first frame: a list of lines_us of lists of exposures_ms."""
    longest_s = 1e-3 * max(exposures_ms)
    height = open_source(scene).size[1]
    # a hair longer, so that the last row of the slowest camera closes before the light ends
    duration_s = longest_s + 1e-6 * max(lines_us) * height + 1e-3
    source = open_source(f"{scene},duration_s={duration_s:g}", colour="rgb")
    specs = [
        [load_cis("ideal", [f"exposure_us={1e3 * exposure_ms}", f"line_us={line_us}"]) for exposure_ms in exposures_ms]
        for line_us in lines_us
    ]
    cameras = [[Cis(spec, source.size) for spec in row] for row in specs]
    taken: list[list[np.ndarray | None]] = [[None] * len(exposures_ms) for _ in lines_us]
    for frame in source.frames():
        for pictures, row in zip(taken, cameras, strict=True):
            for k, camera in enumerate(row):
                for exposure in camera.see(frame):
                    if exposure.index == 0:
                        pictures[k] = camera.spec.picture_codes()[exposure.codes]
    return [[picture for picture in row if picture is not None] for row in taken]


def drawn(pictures: list[list[np.ndarray]], exposures_ms: Sequence[float], lines_us: Sequence[float]) -> Figure:
    """The grid of pictures with its labels."""
    height, width = pictures[0][0].shape[:2]
    across = 3.4
    size = (across * len(exposures_ms) + 0.7, across * height / width * len(lines_us) + 0.5)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(lines_us), len(exposures_ms), squeeze=False)
    for row, line_us, shown in zip(axes, lines_us, pictures, strict=True):
        for axis, exposure_ms, picture in zip(row, exposures_ms, shown, strict=True):
            axis.imshow(picture, interpolation="none")
            axis.set(xticks=[], yticks=[])
            axis.spines[:].set_visible(False)
            axis.set_title(f"exposure {exposure_ms:g} ms" if line_us == lines_us[0] else "", color=INK, fontsize=12)
        readout = f"all {height} lines in {1e-3 * line_us * height:.3g} ms" if line_us else "global shutter"
        row[0].set_ylabel(f"{line_us:g} µs per line\n{readout}", color=INK, fontsize=12)
    return figure


@click.command(help="Draw one frame of a scene by exposure time and line readout time.")
@click.option("--scene", default=SCENE, show_default=True, help="As `vid2ev convert` takes it.")
@click.option("--exposures", default="0,5,20", show_default=True, help="Columns [ms].")
@click.option("--lines", default="0,30,60", show_default=True, help="Rows [us].")
@click.option("-o", "--output", default="shutter.png", show_default=True)
def main(scene: str, exposures: str, lines: str, output: str) -> None:
    """Render, expose, draw."""
    exposures_ms, lines_us = ([float(number) for number in numbers.split(",")] for numbers in (exposures, lines))
    pictures = exposed(scene, exposures_ms, lines_us)
    drawn(pictures, exposures_ms, lines_us).savefig(output, dpi=110, transparent=True)
    click.echo(f"{output}: {len(exposures_ms)} exposure times by {len(lines_us)} line readout times")


if __name__ == "__main__":
    main()
