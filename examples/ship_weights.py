"""Weights to ship, of a run of `vid2ev train`: 16 bits, and a card that says where they come from.

    python examples/ship_weights.py RUN [REPORT ...]

writes interp/pretrained/NETWORK-SIZE.safetensors and NETWORK-SIZE.md.  REPORT are folders of `vid2ev eval --network
interp/pretrained/NETWORK-SIZE.safetensors`, for the scores on the card: run this first, then that, then this again; the
weights are the same bytes each time.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
from safetensors import safe_open

from interp import pretrained, weights
from interp.train.curves import read_curve

SCORES = {
    "hdr": "PSNR in decades of light, beyond the range of the frames / SSIM",
    "firenet": "PSNR-255 / SSIM, brought to the truth's mean and contrast",
}


@click.command()
@click.argument("run", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("reports", nargs=-1, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--machine", default="two cores of a CPU", show_default=True, help="What it was trained on.")
@click.option("--hours", type=float, required=True, help="How long training took [h].")
def ship(run: Path, reports: tuple[Path, ...], machine: str, hours: float) -> None:
    """Weights of RUN, and their card."""
    said = json.loads((run / "run.json").read_text())
    job, network = said["job"], weights.load(run / "weights.safetensors")
    with safe_open(run / "weights.safetensors", "pt") as file:
        best = int(file.metadata()["step"])
    path = Path(pretrained.__file__).with_name(f"{job['network']}-{job['size']}.safetensors")
    weights.save(path, job["network"], network, {"steps": str(best), "seed": str(job["recipe"]["seed"])}, half=True)
    path.with_suffix(".md").write_text(_card(run, job, said["versions"], best, machine, hours, reports))
    click.echo(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def _card(
    run: Path,
    job: dict[str, Any],
    versions: dict[str, str],
    best: int,
    machine: str,
    hours: float,
    reports: tuple[Path, ...],
) -> str:
    recipe, clips = job["recipe"], job["clips"]
    steps = read_curve(run / "validation.csv")[-1]["step"]
    videos = ", ".join(Path(name).name for name in job["validation"]["videos"])
    total = clips["scenes"] + clips["photographs"] + clips["videos"] + clips["recordings"]
    trained_on = [Path(name).name for name in clips["video_files"]]
    lines = [
        f"# {job['network']}, {job['size']}",
        "",
        f"Trained by `vid2ev train --network {job['network'].replace('_', '-')} --size {job['size']} --steps {steps}`,"
        f" rate {recipe['rate']:g}, seed {recipe['seed']}, {steps} steps of {recipe['batch']} samples of"
        f" {job['samples']['size']} x {job['samples']['size']} pixels, {hours:.1f} hours on {machine}; the weights are"
        f" those of step {best}, whose validation was best, stored in 16 bits."
        f" Versions: torch {versions['torch']}, lightning {versions['lightning']}.",
        "",
        "- **Data**: events simulated while training, of "
        f"{clips['scenes'] / total:.0%} rendered scenes ({', '.join(clips['scene_names'])}), "
        f"{clips['photographs'] / total:.0%} photographs in motion ({', '.join(clips['textures'])}) and "
        f"{clips['videos'] / total:.0%} real videos ({', '.join(trained_on) or 'none'}); frames made of each key frame:"
        f" {', '.join(f'x{k}' for k in clips['multiples'])};"
        f" thresholds {clips['sensors']['threshold'][0]} to {clips['sensors']['threshold'][1]} nat.",
        f"- **Validated on, never trained on**: {job['validation']['clips']} clips of scenes and photographs that"
        f" training does not have, and real ones of {videos or 'no videos'}, each with a clean and a noisy sensor.",
        "",
        "## Validation",
        "",
        *_validation(run, best, SCORES.get(job["network"], "PSNR-255 / SSIM")),
    ]
    for report in reports:
        summary = json.loads((report / "summary.json").read_text())
        lines += ["", f"## {report.name}", "", *_scores(summary)]
    return "\n".join(lines) + "\n"


def _validation(run: Path, best: int, measured: str) -> list[str]:
    """The scores of the best validation beside those of what needs no training."""
    others = json.loads((run / "baselines.json").read_text())
    row = next(row for row in read_curve(run / "validation.csv") if int(row["step"]) == best)
    groups = [key.removesuffix(".psnr") for key in row if key.endswith(".psnr")]
    found = {name: {group: (of[group]["psnr"], of[group]["ssim"]) for group in groups} for name, of in others.items()}
    found["**these weights**"] = {group: (float(row[f"{group}.psnr"]), float(row[f"{group}.ssim"])) for group in groups}
    lines = [f"| {measured} | {' | '.join(groups)} |", "|---" * (len(groups) + 1) + "|"]
    for name, of in found.items():
        lines.append(f"| {name} | {' | '.join(f'{psnr:.2f} / {ssim:.3f}' for psnr, ssim in of.values())} |")
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
