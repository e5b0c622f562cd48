#!/usr/bin/env python3
"""What makes rebuilding frames fail: eight causes, each alone, from nothing to much of it.

    python examples/error_analysis.py                          the table, and error_analysis.jpg
    python examples/error_analysis.py --method guided --method run/weights.safetensors

Scenes are rendered, so the truth is known at any instant; a clean event camera sees them.  Key frames are 30 a second
and 7 of 8 frames are rebuilt, unless the table says otherwise.  PSNR is against 255, over all rebuilt frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np
from matplotlib.figure import Figure

from interp.evaluate.protocol import Protocol
from interp.evaluate.rebuilders import methods_of
from interp.evaluate.sets import footage_of
from interp.evaluate.simulated import Simulated
from interp.methods import METHODS
from vid2ev.compare.pictures import psnr, squared_error
from vid2ev.making.conversion import convert

SIZE = "size=256x192"
NEAR = f"scene:parallax,seed=2,{SIZE},camera.trajectory={{kind='shake',rms_mm=6,rms_deg=1.5,low_hz=1,high_hz=4,seed=1}}"
CLEAN = "set = { mismatch = 0, crossing_noise = 0, leak_rate_hz = 0, shot_rate_hz = 0, hot_probability = 0 }"
TRUTH = """[[camera]]
name = "film"
kind = "cis"
sensor = "ideal"
set = { frame_rate_hz = 240 }
"""
OTHERS = {
    "low contrast": "low-light", "spin": "spinning-shapes", "highlights": "specular", "flicker": "flicker",
}  # fmt: skip
START_S, STOP_S = 0.3, 0.6
METHODS_TRIED = ("flow", "bridge", "guided", "rrin_events_guided-tiny")
INK = "#404040"


@dataclass(frozen=True)
class Case:
    """One amount of one cause.

    scene      what is seen
    skip       frames between key frames
    dvs, keys  what a rig says of the event camera, and of a camera for the key frames; without, all is in one place
    """

    cause: str
    amount: str
    scene: str = NEAR
    skip: int = 7
    dvs: str = ""
    keys: str = ""

    def opened(self, folder: Path) -> str:
        """What `vid2ev eval` takes: a recording of the rig in a new folder, or the scene."""
        if not self.dvs + self.keys:
            return self.scene
        cameras = [TRUTH, f'[[camera]]\nname = "events"\nkind = "dvs"\nsensor = "paper"\n{CLEAN}\n{self.dvs}\n']
        if self.keys:
            cameras.append(f'[[camera]]\nname = "keys"\nkind = "cis"\nsensor = "ideal"\n{self.keys}\n')
        rig = folder / "rig.toml"
        rig.write_text("\n".join(cameras))
        convert(self.scene, folder / "recording", rig=rig, pictures="png", preview=False, start=START_S, stop=STOP_S)
        return str(folder / "recording")


def cases() -> Iterator[Case]:
    """All of them, cause by cause."""
    for apart_mm in (0, 20, 80):
        yield Case("disparity", f"cameras {apart_mm} mm apart", dvs=f"translation_mm = [{apart_mm}, 0, 0]")
    for late_ms in (0, 2, 8):
        yield Case("clocks", f"events {late_ms} ms late", dvs=f"clock_offset_us = {1000 * late_ms}")
    for frames in (0, 2, 6):  # so that exposures have their middle at a frame of the truth
        numbers = f"set = {{ frame_rate_hz = 30, exposure_us = {round(frames * 1e6 / 240)} }}"
        yield Case("blur", f"key frames open for {frames / 0.24:.0f} ms", keys=numbers)
    for skip in (3, 7, 31):
        yield Case("speed", f"key frames every {(skip + 1) / 0.24:.0f} ms", skip=skip)
    for cause, name in OTHERS.items():
        yield Case(cause, f"scene {name}", f"scene:{name},seed=1,{SIZE}")


@dataclass(frozen=True)
class Found:
    """PSNR of the methods [dB], and a frame in the middle of the last gap: the truth and the last method's."""

    psnr_db: dict[str, float]
    truth: np.ndarray
    made: np.ndarray


def found(case: Case, methods: Sequence[str], gaps: int) -> Found:
    """What methods make of a case."""
    simulated = Simulated.of("clean", start=START_S, stop=STOP_S)
    with TemporaryDirectory() as folder:
        return scored(case.opened(Path(folder)), methods, case.skip, simulated, gaps)


def scored(dataset: str, methods: Sequence[str], skip: int, simulated: Simulated, gaps: int | None = None) -> Found:
    """What methods make of a data set of which `skip` frames of each gap are rebuilt."""
    forms, files = ([name for name in methods if (name in METHODS) == known] for known in (True, False))
    protocol = Protocol(skip=skip, insert=skip)
    rebuilders = methods_of(forms, files, protocol)
    errors: dict[str, list[np.ndarray]] = {each.name: [] for each in rebuilders}
    for group in footage_of([dataset], protocol, simulated, limit=gaps).footage[0].groups():
        for each in rebuilders:
            made = each.frames(group)
            errors[each.name] += [squared_error(a, b) for a, b in zip(made, group.truth, strict=True)]
    middle = len(group.positions) // 2
    return Found({name: psnr(np.stack(of)) for name, of in errors.items()}, group.truth[middle], made[middle])


def drawn(rows: Sequence[tuple[Case, Found]]) -> Figure:
    """The hardest case of each cause: truth, rebuilt, error."""
    hardest = {case.cause: (case, outcome) for case, outcome in rows}
    figure = Figure(figsize=(2.1 * len(hardest), 5.2), layout="constrained")
    axes = figure.subplots(3, len(hardest), squeeze=False)
    for column, (case, outcome) in zip(axes.T, hardest.values(), strict=True):
        error = np.abs(outcome.made.astype(int) - outcome.truth).max(axis=2)
        for axis, picture in zip(column, (outcome.truth, outcome.made, error), strict=True):
            axis.imshow(picture, interpolation="none", cmap="magma", vmin=0, vmax=64)
            axis.set(xticks=[], yticks=[])
            axis.spines[:].set_visible(False)
        column[0].set_title(f"{case.cause}\n{case.amount}", color=INK, fontsize=9)
    for axis, name in zip(axes[:, 0], ("truth", "rebuilt", "error, to 64 codes"), strict=True):
        axis.set_ylabel(name, color=INK, fontsize=9)
    return figure


@click.command(help="Score methods on eight causes of errors, each alone, and draw the last method's.")
@click.option("--method", "methods", multiple=True, default=METHODS_TRIED, show_default=True)
@click.option("--gaps", default=3, show_default=True, help="Gaps of each case.")
@click.option("-o", "--output", default="error_analysis.jpg", show_default=True)
def main(methods: tuple[str, ...], gaps: int, output: str) -> None:
    """Score, print, draw."""
    methods = tuple(sorted(methods, key=lambda name: name not in METHODS))  # (as they are scored)
    rows = []
    click.echo(
        "| cause | | " + " | ".join(Path(name).stem for name in methods) + " |\n" + "|---" * (len(methods) + 2) + "|"
    )
    for case in cases():
        rows.append((case, found(case, methods, gaps)))
        scores = " | ".join(f"{score:.1f}" for score in rows[-1][1].psnr_db.values())
        click.echo(f"| {case.cause} | {case.amount} | {scores} |")
    drawn(rows).savefig(output, dpi=110)


if __name__ == "__main__":
    main()
