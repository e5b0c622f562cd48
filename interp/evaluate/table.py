"""A summary as a table of Markdown, like those of the field."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

HEADS = (
    "method", "PSNR, pooled", "SSIM", "PSNR, sequences", "SSIM", "PSNR-255", "moving", "static", "worst frame",
    "worst 99x99",
)  # fmt: skip


def table(summary: Mapping[str, Any]) -> str:
    """The methods, each a line, in the order of the summary."""
    lines = [list(HEADS), ["---"] * len(HEADS), *(_line(name, of) for name, of in summary["methods"].items())]
    widths = [max(len(line[column]) for line in lines) for column in range(len(HEADS))]
    lines[1] = ["-" * width for width in widths]
    padded = [[f"{cell:<{width}}" for cell, width in zip(line, widths, strict=True)] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in padded)


def notes(summary: Mapping[str, Any]) -> list[str]:
    """What a person should know: what was not scored, and what is missing, a sentence each."""
    said = [f"{name}: not used: {reason}" for name, reason in summary["unusable"].items()]
    for name, of in summary["sequences"].items():
        said += [f"{name}: {count} groups not scored: {reason}" for reason, count in of["not_scored"].items()]
        said += [f"{name}: {remark}" for remark in of["remarks"]]
        said += [f"{name}: {count} frames of {method} are missing" for method, count in of["missing"].items() if count]
    return said


def _line(name: str, of: Mapping[str, Any]) -> list[str]:
    pooled, each = of["pooled"], of["global"]
    worst = of["worst"]
    return [
        name,
        *(_spread(of[score], digits) for of in (pooled, each) for score, digits in (("psnr", 2), ("ssim", 3))),
        *(_number(pooled[score]["mean"], 2) for score in ("psnr_255", "psnr_moving", "psnr_static")),
        *(_number(worst[score] and worst[score][score], 2) for score in ("psnr", "patch_psnr")),
    ]  # fmt: skip


def _spread(of: Mapping[str, Any], digits: int) -> str:
    return "-" if of["mean"] is None else f"{of['mean']:.{digits}f} ± {of['std']:.{digits}f}"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
