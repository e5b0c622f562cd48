#!/usr/bin/env python3
"""What it is worth to let still strips of pixels sleep: `Dvs(skip=True)` against `skip=False`.

    python examples/benchmark_skip.py                       a still mosaic in which a band moves
    python examples/benchmark_skip.py --moving 0.2 --size 640x480
    python examples/benchmark_skip.py --clip FILE           frames of a clip, as `vid2ev convert` sees them

A strip is 256 pixels of a row: at 1280x720 a fifth of it; the walk's tiles have eight strips each.  The band is as
high as makes the share `--moving` of them change in every frame; in `--width` of it photographs move by half a pixel a
frame, 1 ms apart.

    told    the frames say which strips have not changed (`vid2ev.stream.still`), as those of scenes and upsamplers do
    looks   the sensor looks, as it does for arrays and plain videos
    walks   skip=False

Timed is `Dvs.see_all` of ten frames, in CPU time of one thread, float32 frames in, arrays of events out.  All ways
see ten frames in turn, so that a slow minute of the machine hits all alike; the table has medians over the turns but
the first, and the events of all are compared.
"""

from __future__ import annotations

import itertools
import statistics
import time
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from benchmark import mosaic

from vid2ev.kernels.layout import BLOCK, STRIP
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.presets import load_sensor
from vid2ev.sources import open_source
from vid2ev.stream import Events, Frame
from vid2ev.stream.still import Still
from vid2ev.upsample.stillness import still_strips

PRESETS = ("ideal", "v2e-clean", "paper", "v2e-noisy")
FRAME_NS = 1_000_000
WAYS = ("told", "looks", "walks")
TURN = 10  # frames; the first ones warm up
FEWEST = 3 * TURN


def moving_band(count: int, width: int, height: int, moving: float, part: float) -> tuple[np.ndarray, np.ndarray]:
    """Light float32 [N, height, width], and the times [ns]."""
    import cv2

    texture = mosaic(height, 2 * width + count)
    rows = max(1, round(moving * height))
    first, across = (height - rows) // 2, round(part * width)
    frames = np.repeat(texture[None, :, :width], count, axis=0)
    for k in range(count):
        shift = np.array([[1, 0, -0.5 * k - width], [0, 1, 0]], np.float32)
        moved = cv2.warpAffine(texture[first : first + rows], shift, (across, rows), flags=cv2.INTER_LINEAR)
        frames[k, first : first + rows, :across] = moved
    return frames / np.float32(255), FRAME_NS * np.arange(1, count + 1)


def clip_frames(clip: Path, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The first frames of a clip as light, and their times [ns]."""
    frames = list(itertools.islice(open_source(clip).frames(), count))
    return np.stack([frame.light for frame in frames]), np.array([frame.t_ns for frame in frames])


def share_changed(frames: np.ndarray, pixels: int) -> float:
    """The share of runs of pixels that are not what they were in the frame before, to the bit."""
    flat = frames.reshape(len(frames), -1).view(np.uint32)
    starts = np.arange(0, flat.shape[1], pixels)
    changed = [np.logical_or.reduceat(after != before, starts).mean() for before, after in itertools.pairwise(flat)]
    return float(np.mean(changed))


def measure(preset: str, frames: np.ndarray, t_ns: np.ndarray, settings: tuple[str, ...]) -> dict[str, float]:
    """Medians of all ways [ns per pixel], what has slept, and how many events there are."""
    size, pictures = (frames.shape[2], frames.shape[1]), list(frames)
    stills = [None, *(Still(before, still_strips(before, after)) for before, after in itertools.pairwise(pictures))]
    plain = [Frame(light, int(t)) for light, t in zip(pictures, t_ns, strict=True)]
    said = [replace(frame, still=still) for frame, still in zip(plain, stills, strict=True)]
    sensors = {way: Dvs(load_sensor(preset, settings), size, skip=way != "walks") for way in WAYS}
    spent: dict[str, list[float]] = {way: [] for way in WAYS}
    events = 0
    for first in range(0, len(pictures), TURN):
        sent: dict[str, list[Events]] = {}
        for way in WAYS if first % (2 * TURN) else reversed(WAYS):
            turn = (said if way == "told" else plain)[first : first + TURN]
            began = time.thread_time_ns()
            sent[way] = sensors[way].see_all(turn)
            if first > 0:
                spent[way].append((time.thread_time_ns() - began) / len(turn) / frames[0].size)
        ours = {way: Events.concatenate(sent[way]) for way in WAYS}
        for way, name in itertools.product(("told", "looks"), "txyp"):
            if not np.array_equal(getattr(ours[way], name), getattr(ours["walks"], name)):
                raise click.ClickException(f"{preset}: other events with skip than without from frame {first} on")
        events += len(ours["walks"])
    slept, of = sensors["told"].slept
    medians = {way: statistics.median(spent[way]) for way in WAYS}
    return medians | {"slept": slept / of, "events": events / frames.size}


@click.command(help=__doc__.split("\n\n")[0] if __doc__ else None)
@click.option("--preset", "presets", multiple=True, default=PRESETS, show_default=True)
@click.option("--size", default="1280x720", show_default=True, metavar="WIDTHxHEIGHT")
@click.option("--moving", type=click.FloatRange(0, 1), default=0.05, show_default=True, help="Share of strips.")
@click.option("--width", "part", type=click.FloatRange(0, 1), default=1.0, show_default=True, help="Of the band.")
@click.option("--count", type=click.IntRange(FEWEST), default=80, show_default=True, help="Frames.")
@click.option("--clip", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="Take its first frames.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change the sensors.")
def main(presets, size, moving, part, count, clip, settings) -> None:
    width, height = (int(word) for word in size.split("x"))
    frames, t_ns = clip_frames(clip, count) if clip else moving_band(count, width, height, moving, part)
    if len(frames) < FEWEST:
        raise click.UsageError(f"{clip}: {len(frames)} frames, expected at least {FEWEST}; give a longer clip")
    strips, tiles = share_changed(frames, STRIP), share_changed(frames, BLOCK)
    click.echo(
        f"{frames.shape[2]}x{frames.shape[1]}, {len(frames)} frames; {100 * strips:.1f} % of the strips and"
        f" {100 * tiles:.1f} % of the tiles change\n"
    )
    click.echo("ns per pixel and frame\n")
    click.echo("| sensor | told | looks | walks | walks / told | walks / looks | slept | events / pixel / frame |")
    click.echo("| --- | --: | --: | --: | --: | --: | --: | --: |")
    for preset in presets:
        row = measure(preset, frames, t_ns, settings)
        times = " | ".join(f"{row[way]:.2f}" for way in WAYS)
        ratios = " | ".join(f"{row['walks'] / row[way]:.2f}" for way in WAYS[:2])
        click.echo(f"| {preset} | {times} | {ratios} | {100 * row['slept']:.0f} % | {row['events']:.4f} |")


if __name__ == "__main__":
    main()
