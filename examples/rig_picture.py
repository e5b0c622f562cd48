#!/usr/bin/env python3
"""Make docs/rig.png: a scene, and what two pairs of virtual cameras at its sides record of it.

    python examples/rig_picture.py                            to rig.png
    python examples/rig_picture.py --scene scene:close-object,seed=1 --start 0.4 -o mine.png

Each pair is a frame camera and an event camera in one place.  On the left, a phone's colour sensor with a rolling
shutter and an event camera of the same size; on the right, both halves of a DAVIS346.  The recording is that of

    vid2ev convert scene:parallax,seed=8 --rig examples/rig.toml --cis-out png --start 1 --stop 1.1

The events are those of the 8 milliseconds in the middle of the frame beside
them.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread
from PIL import Image

from vid2ev import Events, convert, open_source, read_events
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.pictures.colours import GROUND, MOST, OFF, ON, event_colours

SCENE = "scene:parallax,seed=8"
WINDOW_US = 8000
RIG = Path(__file__).with_name("rig.toml")
PAIRS = ("phone", "davis")  # each has its events beside it, in NAME-events
INK, FAINT = "#d8dce4", "#8a92a0"


class Pair(NamedTuple):
    """A frame, when it began and ended [us], and the events in its middle as a picture."""

    frame: np.ndarray
    span_us: tuple[int, int]
    events: np.ndarray
    count: int


def recorded(scene: str, start_s: float, stop_s: float, folder: Path) -> dict[str, Pair]:
    """Record a scene by the rig: the second frame of each frame camera, or its last, and events with it."""
    made = folder / "recording"
    convert(scene, made, rig=RIG, pictures=["png"], preview=False, start=start_s, stop=stop_s)
    return {name: pair_of(made / name, made / f"{name}-events") for name in PAIRS}


def pair_of(frames: Path, events: Path) -> Pair:
    """A frame of a camera's folder, and what the other one sent in its middle."""
    spans = np.loadtxt(frames / "frames" / "timestamps.txt", dtype=np.int64, ndmin=2)
    k = min(1, len(spans) - 1)
    middle_us = int(spans[k].mean())
    sent = Events.concatenate(read_events(events))
    shown = sent.select(np.abs(sent.t - middle_us) <= WINDOW_US // 2)
    frame = imread(frames / "frames" / f"{k:06d}.png")
    return Pair(frame, (int(spans[k][0]), int(spans[k][1])), picture_of(shown, frame.shape[:2]), len(shown.t))


def picture_of(events: Events, shape: tuple[int, ...]) -> np.ndarray:
    """R'G'B' [H, W, 3] of events: ON amber, OFF blue, brighter where there are more."""
    counts = np.zeros((2, *shape), np.int64)
    np.add.at(counts, (events.p, events.y, events.x), 1)
    off, on = np.minimum(counts, MOST)
    return event_colours()[off, on]


def drawn(scene: str, source: np.ndarray, pairs: dict[str, Pair]) -> Figure:
    """Source and plan, then a column for each pair."""
    figure = Figure(figsize=(10.4, 5.6), layout="constrained", facecolor=GROUND)
    axes = figure.subplots(2, 3)
    phone, davis = (pairs[name] for name in PAIRS)
    show(axes[0, 0], source, f"{scene}\nsource, {size_of(source)}")
    show(axes[0, 1], phone.frame, f"A: phone, rolling shutter\n{size_of(phone.frame)}, {span(phone)}")
    show(axes[1, 1], phone.events, f"events: paper, {size_of(phone.events)}\n{sent(phone)}", below=True)
    show(axes[0, 2], davis.frame, f"B: davis346-aps, global shutter\n{size_of(davis.frame)}, {span(davis)}")
    show(axes[1, 2], davis.events, f"events: davis346, {size_of(davis.events)}\n{sent(davis)}", below=True)
    draw_plan(axes[1, 0])
    return figure


def show(axis: Any, picture: np.ndarray, caption: str, below: bool = False) -> None:
    """A picture with a caption."""
    axis.imshow(picture, cmap="gray", interpolation="antialiased")
    axis.set(xticks=[], yticks=[])
    axis.spines[:].set_visible(False)
    if below:
        axis.set_xlabel(caption, color=INK, fontsize=11)
    else:
        axis.set_title(caption, color=INK, fontsize=11)


def draw_plan(axis: Any) -> None:
    """The cameras from above."""
    axis.set(xlim=(-75, 75), ylim=(-30, 82), aspect="equal", facecolor=GROUND)
    axis.axis("off")
    for x_mm, name, colour in ((-40, "A", INK), (0, "source", FAINT), (40, "B", INK)):
        axis.fill([x_mm - 30, x_mm, x_mm + 30], [52, 0, 52], color=colour, alpha=0.14, linewidth=0)
        axis.plot(x_mm, 0, "o", color=colour, markersize=9)
        axis.text(x_mm, -15, name, color=colour, ha="center", va="center", fontsize=12)
        axis.text(x_mm, -26, f"{x_mm:+d} mm" if x_mm else "0", color=FAINT, ha="center", va="center", fontsize=10)
    axis.text(0, 60, "the cameras from above", color=FAINT, ha="center", va="center", fontsize=10)
    axis.text(-3, 76, "ON: brighter", color=ON, ha="right", va="center", fontsize=11)
    axis.text(3, 76, "OFF: darker", color=OFF, ha="left", va="center", fontsize=11)


def size_of(picture: np.ndarray) -> str:
    """Width and height."""
    return f"{picture.shape[1]}×{picture.shape[0]}"


def span(pair: Pair) -> str:
    """How long the frame was open."""
    return f"all rows within {1e-3 * (pair.span_us[1] - pair.span_us[0]):.0f} ms"


def sent(pair: Pair) -> str:
    """How many events are shown."""
    return f"{pair.count:,} events in {WINDOW_US / 1000:g} ms"


def save(figure: Figure, path: Path, colours: int = 256) -> None:
    """A PNG with a palette, which has a third of the bytes."""
    with tempfile.TemporaryFile() as whole:
        figure.savefig(whole, format="png", dpi=100)
        with Image.open(whole) as picture:
            picture.convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(path, optimize=True)


@click.command(help="Draw what two pairs of cameras record of a scene.")
@click.option("--scene", default=SCENE, show_default=True)
@click.option("--start", default=1.0, show_default=True, help="From this second of the scene on.")
@click.option("--seconds", default=0.1, show_default=True, help="How long; two frames have to fit.")
@click.option("-o", "--output", default="rig.png", show_default=True)
def main(scene: str, start: float, seconds: float, output: str) -> None:
    """Record, draw."""
    with tempfile.TemporaryDirectory() as folder:
        pairs = recorded(scene, start, start + seconds, Path(folder))
    middle_s = 1e-6 * sum(pairs["phone"].span_us) / 2
    source = open_source(scene, colour="rgb", start=middle_s)
    save(drawn(scene, srgb_codes(next(source.frames()).light), pairs), Path(output))
    click.echo(f"{output}: {', '.join(f'{name} {pair.count:,} events' for name, pair in pairs.items())}")


if __name__ == "__main__":
    main()
