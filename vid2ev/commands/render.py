"""`vid2ev render`: a film or a picture of any event file."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from vid2ev.commands.options import SECONDS, FiniteRange
from vid2ev.interrupts import heard
from vid2ev.terminal import counted


@click.command(short_help="Make a film or a picture of any event file.")
@click.argument("events")
@click.option(
    "-o", "--output", type=Path, metavar="FILE.mp4|FILE.png|DIR", help="What to make.  [default: NAME.mp4 here]"
)
@click.option(
    "--view",
    default="polarity",
    show_default=True,
    metavar="VIEW",
    help="polarity, time-surface[:TAU], accumulated[:FULL_SCALE] or voxel[:BINS].",
)
@click.option(
    "--by",
    metavar="SLICES",
    help="What a picture shows: duration:10ms, count:50000, area:500,32 or source (from frame to frame)."
    "  [default: what passes in a picture's time]",
)
@click.option(
    "--fps",
    type=FiniteRange(0.01, 1000),
    default=30,
    show_default=True,
    metavar="RATE",
    help="Pictures per second of the film.",
)
@click.option(
    "--speed",
    type=FiniteRange(1e-6, 1e6),
    metavar="FACTOR",
    help="Of the film against reality; 0.1 is slow motion.  [default: 1]",
)
@click.option(
    "--start", "start_s", type=SECONDS, metavar="S",
    help="Begin S seconds after the beginning: from when the file counts, or its first event if that is long after.",
)  # fmt: skip
@click.option(
    "--stop", "stop_s", type=SECONDS, metavar="S", help="End S seconds after the beginning, with what comes right then."
)
@click.option(
    "--size",
    type=click.IntRange(64, 8192),
    default=1280,
    show_default=True,
    metavar="PIXELS",
    help="Longest side at most, the line below (--stamp) not counted; small sensors are enlarged a whole number of"
    " times, large ones reduced.",
)
@click.option(
    "--with-frames/--no-frames",
    "frames",
    default=None,
    help="Show the file's frames beside its events, under them if they are wide.  [default: if it has any]",
)
@click.option("--stamp/--no-stamp", default=True, help="Write time and number of events below.  [default: yes]")
@click.option("--overwrite", is_flag=True, help="Replace what is there.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@heard()
def render(events: str, output: Path | None, as_json: bool, quiet: bool, **options: Any) -> None:
    """Make a film (.mp4), a picture (.png) or a folder of pictures of EVENTS: an event file, or a recording's folder.

    Every event is shown once.  ON is amber, OFF is blue.  A film has a picture for each slice; FILE.png is a picture of
    all events from --start to --stop, or, with --by, --speed or without a window, of the slice with the most events.
    """
    from vid2ev.commands.progress import event_bar
    from vid2ev.terminal import lines
    from vid2ev.views.render import render as make

    with event_bar(quiet) as report:
        made = make(events, output or _default(events), report=report, **options)
    if as_json:
        click.echo(json.dumps(made, indent=2))
    elif not quiet:
        click.echo(lines(_facts(made)))


def _default(events: str) -> Path:
    path = Path(events).absolute()
    return Path(f"{path.name if path.is_dir() else path.stem}.mp4")


def _of_people(by: str) -> str:
    """How it was sliced, in milliseconds where that is no whole number of microseconds."""
    kind, _, us = by.partition(":")
    if kind == "duration" and "/" in us:
        return f"duration:{float(Fraction(us.removesuffix('us'))) / 1000:.6g}ms"
    return by


def _facts(made: dict[str, Any]) -> list[tuple[str, str]]:
    many, (width, height) = made["frames"], made["size"]
    pictures = f"{counted(many, 'picture')} of {width}x{height}"
    film = f", {made['fps']:g} per second: {many / made['fps']:.3g} s" if made["kind"] == "mp4" else ""
    densest = f", the densest of {made['slices']:,}" if many < made["slices"] else ""
    return [
        ("made", f"{made['path']}: {pictures}{film}"),
        ("shows", f"{made['view']} by {_of_people(made['by'])}{densest}"),
        ("events", f"{made['events']:,} in {made['duration_us'] / 1e6:.10g} s"),
        *(("warning", text) for text in made["warnings"]),
    ]
