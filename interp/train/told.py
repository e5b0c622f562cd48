"""What is told of a run: what it will do, and how it came out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from interp.train.fit import Outcome
from interp.train.job import Job
from interp.train.scores import Scores
from vid2ev.terminal import counted, lines

COLUMNS = ("psnr", "ssim", "moving", "static")
HEADS = ("PSNR", "SSIM", "moving", "static")
OF_HDR = ("PSNR", "SSIM", "above", "below")  # the range of the frames (`hdr.py`)


def described(job: Job, path: Path) -> str:
    """What a run will do."""
    recipe = job.recipe
    length = counted(recipe.steps, "step") if recipe.steps else f"{recipe.time_s / 60:g} min"
    sources = {name: getattr(job.clips, name) for name in ("scenes", "photographs", "videos", "recordings")}
    data = ", ".join(f"{100 * share / sum(sources.values()):.0f} % {name}" for name, share in sources.items() if share)
    return lines(
        [
            ("network", f"{job.network}, {job.size}"),
            *([("begins with", _starts(job))] if job.starts else []),
            ("training", f"{length} of {counted(recipe.batch, 'sample')} of {job.samples.size}x{job.samples.size}"),
            ("data", f"{data}; x{', x'.join(map(str, job.clips.multiples))}"),
            ("run", str(path)),
        ]
    )


def _starts(job: Job) -> str:
    return ", ".join(f"{part or 'all'} of sha256 {digest[:12]}" for part, digest in sorted(job.starts.items()))


def table(outcome: Outcome, network: str) -> str:
    """Scores of each group of clips, the best last."""
    blocks, heads = [], OF_HDR if network == "hdr" else HEADS
    for group, methods in outcome.scores.items():
        rows = [f"{group:<14}" + "".join(f"{head:>9}" for head in heads)]
        for name, scores in sorted(methods.items(), key=lambda item: item[1].psnr):
            values = [getattr(scores, column) for column in COLUMNS]
            rows.append(f"{name:<14}{values[0]:9.2f}{values[1]:9.4f}{values[2]:9.2f}{values[3]:9.2f}")
        blocks.append("\n".join(rows))
    return "\n\n".join(blocks)


def as_json(outcome: Outcome) -> Mapping[str, Any]:
    """The same for programs; NaN as nothing."""
    scores = {g: {m: s.named("") for m, s in methods.items()} for g, methods in outcome.scores.items()}
    return {
        "step": outcome.step,
        "steps": outcome.steps,
        "skipped": outcome.skipped,
        "best": outcome.best,
        "scores": scores,
    }


def outcome_of(said: Mapping[str, Any]) -> Outcome:
    """The outcome of `as_json`.  Raises LookupError, TypeError for what is none."""
    none = dict.fromkeys(COLUMNS, math.nan)
    scores = {g: {m: Scores(**none | values) for m, values in of.items()} for g, of in said["scores"].items()}
    return Outcome(said["step"], said["steps"], said["skipped"], said["best"], scores)
