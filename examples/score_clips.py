#!/usr/bin/env python3
"""How well methods rebuild what training has not seen: clips of scenes and photographs, and parts of real videos.

    python examples/score_clips.py                                   16 scenes and photographs that were put aside
    python examples/score_clips.py --scenes 0 VIDEO ...              4 parts of each video, 7 of 8 frames left out
    python examples/score_clips.py --method bridge --method RUN      a closed form beside a run of training
    python examples/score_clips.py --coarser 3                       events of pixels that are 3 x 3 of the frames'

Clips are those that `vid2ev train` validates with, each with a clean and a noisy event sensor.  PSNR against 255 and
SSIM, means over all rebuilt frames; and by how much a method is above the first one in the clip in which that is least.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import torch
from torch.utils.data import default_collate

from interp import pretrained
from interp.data.clip import Clip
from interp.data.sensor_ranges import SENSORS
from interp.data.settings import ClipSettings
from interp.data.tensors import as_tensor, tensors
from interp.data.validation import validation_clips
from interp.methods import METHODS, open_method
from interp.train.frame_fed import gap_of
from interp.train.scores import Scores, scores

TRIED = ("bridge", "flow", "guided", "rrin_events_guided-tiny")


@click.command()
@click.argument("videos", nargs=-1, type=click.Path(exists=True, dir_okay=False))
@click.option("--scenes", default=16, show_default=True, help="Clips of scenes and photographs.")
@click.option("--parts", default=4, show_default=True, help="Of each video.")
@click.option("--slowdown", default=1.0, show_default=True, help="Times slower than the world that videos play.")
@click.option("--multiple", default=8, show_default=True, help="Frames for each key frame: 4, 8, 16, 32.")
@click.option("--coarser", default=1, show_default=True, help="Pixels of frames, across, to one of events.")
@click.option("--method", "tried", multiple=True, default=TRIED, show_default=True)
def main(
    videos: tuple[str, ...],
    scenes: int,
    parts: int,
    slowdown: float,
    multiple: int,
    coarser: int,
    tried: tuple[str, ...],
) -> None:
    """Scores of methods on clips."""
    methods = {name: open_method(name if name in METHODS else str(pretrained.path_of(name))) for name in tried}
    side = -(-128 // coarser) * coarser
    rig = {"rigs": 1.0, "coarser": (coarser,), "baseline_mm": (0.0, 0.0), "size": (side, side)} if coarser > 1 else {}
    settings = ClipSettings(slowdown=slowdown, multiples=(multiple,), **rig)
    click.echo("| clips | " + " | ".join(Path(name).name for name in tried) + " |")
    click.echo("| :-- |" + " --: |" * len(tried))
    for sensor in ("clean", "noisy"):
        seen = settings.model_copy(update={"sensors": SENSORS[sensor]})
        for what, clips in _clips(seen, scenes, videos, parts):
            found = [{name: _scored(method, clip) for name, method in methods.items()} for clip in clips]
            click.echo(
                f"| {len(clips)} {what}, {sensor} | "
                + " | ".join(_cell(found, name, tried[0]) for name in tried)
                + " |"
            )


def _clips(
    settings: ClipSettings, scenes: int, videos: tuple[str, ...], parts: int
) -> Iterator[tuple[str, list[Clip]]]:
    if scenes:
        yield "scenes", validation_clips(settings, scenes)
    if videos:
        yield f"parts of {len(videos)} videos", validation_clips(settings, 0, videos, parts)


@torch.no_grad()
def _scored(method: Any, clip: Clip) -> list[Scores]:
    """Of the frames that a method rebuilds."""
    gap = gap_of(default_collate([tensors(clip, ClipSettings())]))
    made = method.between(gap, torch.arange(1, clip.multiple).float() / clip.multiple)
    return scores(made, as_tensor(clip.truth[1:-1]), gap.frame_0, gap.frame_1)


def _cell(found: list[dict[str, list[Scores]]], name: str, first: str) -> str:
    mean = Scores.mean([one for clip in found for one in clip[name]])
    least = min(Scores.mean(clip[name]).psnr - Scores.mean(clip[first]).psnr for clip in found)
    return f"{mean.psnr:.2f} / {mean.ssim:.3f}" + (f" ({least:+.1f})" if name != first else "")


if __name__ == "__main__":
    main()
