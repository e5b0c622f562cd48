"""Weights to ship, of a run of `vid2ev train`: 16 bits, and a card that says where they come from.

    python examples/ship_weights.py RUN [REPORT ...] --hours 17

writes interp/pretrained/NETWORK-SIZE.safetensors and NETWORK-SIZE.md.  REPORT are folders of `vid2ev eval --network
NETWORK-SIZE`, for the scores on the card: run this first, then that, then this again; the weights are the same bytes
each time.

A network that begins as a closed form, with last layers that are zero, may have learnt too much of what it was trained
on.  With `--share 0.5 --share 1` those layers are tried at both shares of what they are, and the share is kept whose
validation is best (between zero and tuned weights: M. Wortsman et al., "Robust fine-tuning of zero-shot models", CVPR
2022).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import torch
from pydantic import BaseModel
from safetensors import safe_open
from torch import nn

from interp import pretrained, weights
from interp.data.samples import SampleSettings
from interp.data.settings import ClipSettings
from interp.train.curves import read_curve
from interp.train.job import Job
from interp.train.learner import means, overall
from interp.train.made_of import learner_of, validation_of
from interp.train.scores import Scores

FILES = ("video_files", "recording_folders")  # of `--data`
SCORES = {
    "hdr": "PSNR in decades of light, beyond the range of the frames / SSIM",
    "firenet": "PSNR-255 / SSIM, brought to the truth's mean and contrast",
}


@click.command()
@click.argument("run", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("reports", nargs=-1, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--machine", default="two cores of a CPU", show_default=True, help="What it was trained on.")
@click.option("--hours", type=float, required=True, help="How long training took [h].")
@click.option("--share", "shares", type=float, multiple=True, default=(1.0,), help="Of the last layers, to be tried.")
@click.option("--note", default="", help="A sentence more for the card.")
@click.option("--clips", type=click.Path(path_type=Path), help="Clips of validation.  [default: those of the run]")
def ship(
    run: Path,
    reports: tuple[Path, ...],
    machine: str,
    hours: float,
    shares: tuple[float, ...],
    note: str,
    clips: Path | None,
) -> None:
    """Weights of RUN, and their card."""
    said = json.loads((run / "run.json").read_text())
    job = said["job"]
    with safe_open(run / "weights.safetensors", "pt") as file:
        best = int(file.metadata()["step"])
    tried = {share: _shared(run, share) for share in shares}
    tables = {share: _table(job, tried[share], clips or run / "clips" / "validation") for share in shares}
    kept = max(shares, key=lambda share: overall(tables[share]))
    for share, table in tables.items():
        click.echo(f"share {share:g}: {overall(table):.3f} dB, " + ", ".join(_cells(table)))
    path = Path(pretrained.__file__).with_name(f"{job['network']}-{job['size']}.safetensors")
    about = {"steps": str(best), "seed": str(job["recipe"]["seed"]), "share": f"{kept:g}"}
    weights.save(path, job["network"], tried[kept], about, half=True)
    card = _card(run, job, said["versions"], best, kept, tables[kept], machine, hours, note, reports)
    path.with_suffix(".md").write_text(card)
    click.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def _shared(run: Path, share: float) -> nn.Module:
    """The network of a run, its last layers at a share of what they are, with weights of 16 bits."""
    network = weights.load(run / "weights.safetensors")
    with torch.no_grad():
        for name, weight in network.named_parameters():
            if name.rsplit(".", 2)[-2] == "head":
                weight.mul_(share)
            weight.copy_(weight.half())
    return network


@torch.no_grad()
def _table(job: dict[str, Any], network: nn.Module, clips: Path) -> dict[str, Scores]:
    """Its scores on the clips of validation."""
    learner = learner_of(Job.model_validate(job))
    learner.network = network
    batches = validation_of(Job.model_validate(job), clips)
    return means([(group, learner.scored(clip, learner.predicted(clip).float())) for group, clip in batches])


def _cells(table: dict[str, Scores]) -> list[str]:
    return [f"{found.psnr:.2f} / {found.ssim:.3f}" for found in table.values()]


def _card(
    run: Path,
    job: dict[str, Any],
    versions: dict[str, str],
    best: int,
    share: float,
    table: dict[str, Scores],
    machine: str,
    hours: float,
    note: str,
    reports: tuple[Path, ...],
) -> str:
    recipe, clips = job["recipe"], job["clips"]
    changed = {
        "network": job["options"],
        "samples": _unusual(job["samples"], SampleSettings()),
        "clips": {name: value for name, value in _unusual(clips, ClipSettings()).items() if name not in FILES},
    }
    set_to = "".join(f" --set '{part}.{name}={value}'" for part, of in changed.items() for name, value in of.items())
    steps = read_curve(run / "validation.csv")[-1]["step"]
    videos = ", ".join(Path(name).name for name in job["validation"]["videos"])
    begun = ", ".join(f"{part or 'all'} of sha256 {digest}" for part, digest in job.get("starts", {}).items())
    total = clips["scenes"] + clips["photographs"] + clips["videos"] + clips["recordings"]
    trained_on = [Path(name).name for name in clips["video_files"]]
    lines = [
        f"# {job['network']}, {job['size']}",
        "",
        f"Trained by `vid2ev train --network {job['network'].replace('_', '-')} --size {job['size']}"
        f" --steps {steps}{set_to}`, rate {recipe['rate']:g}, seed {recipe['seed']},"
        f" {steps} steps of {recipe['batch']} samples of"
        f" {job['samples']['size']} x {job['samples']['size']} pixels, {hours:.1f} hours on {machine}; the weights are"
        f" those of step {best}, whose validation was best,{_said_of(share)} stored in 16 bits."
        f"{f' They began with weights: {begun}.' * bool(begun)}"
        f" Versions: torch {versions['torch']}, lightning {versions['lightning']}.{' ' * bool(note)}{note}",
        "",
        "- **Data**: events simulated while training, of "
        f"{clips['scenes'] / total:.0%} rendered scenes ({', '.join(clips['scene_names'])}), "
        f"{clips['photographs'] / total:.0%} photographs in motion ({', '.join(clips['textures'])}) and "
        f"{clips['videos'] / total:.0%} real videos ({', '.join(trained_on) or 'none'});{_rigs(clips)} frames made of"
        f" each key frame: {', '.join(f'x{k}' for k in clips['multiples'])};"
        f" thresholds {clips['sensors']['threshold'][0]} to {clips['sensors']['threshold'][1]} nat.",
        f"- **Validated on, never trained on**: {job['validation']['clips']} clips of scenes and photographs that"
        f" training does not have, and real ones of {videos or 'no videos'}, each with a clean and a noisy sensor.",
        "",
        "## Validation",
        "",
        *_validation(run, table, SCORES.get(job["network"], "PSNR-255 / SSIM")),
    ]
    for report in reports:
        summary = json.loads((report / "summary.json").read_text())
        lines += ["", f"## {report.name}", "", *_scores(summary)]
    return "\n".join(lines) + "\n"


def _unusual(settings: dict[str, Any], usual: BaseModel) -> dict[str, Any]:
    """Those that are not what they usually are."""
    of_all = usual.model_dump(mode="json")
    return {name: value for name, value in settings.items() if value != of_all[name]}


def _rigs(clips: dict[str, Any]) -> str:
    """Of event cameras that are not the frame camera's pixels."""
    if not clips["rigs"]:
        return ""
    coarser, (least, most) = ", ".join(map(str, clips["coarser"])), clips["baseline_mm"]
    return f" {clips['rigs']:.0%} with events of pixels {coarser} times as large, {least:g} to {most:g} mm beside;"


def _said_of(share: float) -> str:
    return "" if share == 1 else f" the last layers at {share:g} of what they were (of what was tried the best there),"


def _validation(run: Path, table: dict[str, Scores], measured: str) -> list[str]:
    """The scores of these weights beside those of what needs no training."""
    others = json.loads((run / "baselines.json").read_text())
    rows = {name: {group: Scores(**of[group]) for group in table} for name, of in others.items()}
    lines = [f"| {measured} | {' | '.join(table)} |", "|---" * (len(table) + 1) + "|"]
    for name, of in (rows | {"**these weights**": table}).items():
        lines.append(f"| {name} | {' | '.join(_cells(of))} |")
    return lines


def _scores(summary: dict[str, Any]) -> list[str]:
    """What an evaluation found, of every method it compared."""
    lines = ["| Time Lens protocol | PSNR | SSIM | moving | static |", "|---" * 5 + "|"]
    for name, found in summary["methods"].items():
        means = {score: found["pooled"][score]["mean"] for score in ("psnr", "ssim", "psnr_moving", "psnr_static")}
        shown = ("–" if mean is None else f"{mean:.{3 if score == 'ssim' else 2}f}" for score, mean in means.items())
        lines.append(f"| {name} | {' | '.join(shown)} |")
    return lines


if __name__ == "__main__":
    ship()
