"""`vid2ev reconstruct`: pictures of what an event camera saw, from its events alone."""

from __future__ import annotations

import ctypes
import json
import os
import sys
from pathlib import Path
from typing import Any

import click

from interp.commands.making import (
    bar,
    contrast_of,
    device_option,
    event_options,
    film_text,
    run_options,
    what_options,
)
from vid2ev.commands.options import Finite

M_TRIM_THRESHOLD, M_MMAP_MAX, LARGEST_INT = -1, -4, 2**31 - 1  # of glibc's malloc.h
EVENTS = "{percentage:3.0f}% {bar} {n_fmt}/{total_fmt} events, {rate_fmt}, {elapsed} gone, {remaining} left"


@click.command(short_help="Make pictures from the events of any event file alone.")
@click.argument("events")
@click.option(
    "--network", metavar="WEIGHTS",
    help="Of `vid2ev train --network e2vid` or firenet.  [default: the FireNet that comes with vid2ev]",
)  # fmt: skip
@click.option(
    "--cutoff", "cutoff_hz", type=Finite(), metavar="HZ",
    help="A high-pass filter in place of a network: what changes more slowly fades to grey.",
)  # fmt: skip
@click.option("--fps", metavar="RATE", help="Pictures per second of the scene's time.  [default: 30]")
@click.option(
    "--events-per-frame", type=int, metavar="N",
    help="A picture after each N events, instead; one of each microsecond at most.",
)  # fmt: skip
@what_options(
    output="What to make.  [default: NAME_seen.mp4 here]",
    play="Pictures per second of the film.  [default: real time; 30 with N events]",
)
@click.option(
    "--start", "start_s", type=Finite(), metavar="S",
    help="Begin S seconds after the beginning: from when the file counts, or its first event if that is long after.",
)  # fmt: skip
@click.option(
    "--stop", "stop_s", type=Finite(), metavar="S",
    help="End S seconds after the beginning, with what comes right then.",
)  # fmt: skip
@event_options(contrast="0.15")
@device_option
@run_options
def reconstruct(
    events: str, output: Path | None, contrast: str | None, as_json: bool, quiet: bool, **options: Any
) -> None:
    """Make pictures of what the event camera of EVENTS saw: any event file, or a recording's folder; of a rig's, that
    of its only event camera.

    EVENTS is read in blocks, however long it is.  How bright a scene is cannot be seen from events: pictures show what
    changed.
    """
    from interp.reconstruct.whole import reconstruct as make
    from vid2ev.commands.progress import kept
    from vid2ev.interrupts import heard

    keep_memory()
    quiet |= as_json
    path = output or _default(events, options["format"])
    tell = None if quiet else lambda text: click.echo(f"by {text}")
    with kept(path, "done.jsonl"), heard(), bar(quiet, EVENTS, " events") as report:
        made = make(events, path, contrast=contrast_of(contrast), report=report, told=tell, **options)
    if as_json:
        click.echo(json.dumps(made, indent=2))
    elif not quiet:
        from vid2ev.terminal import lines

        click.echo(lines(_facts(path, made)))


def keep_memory() -> bool:
    """Let the C library keep the memory of a picture for the next one; returns whether it can be told so.

    glibc gives back at once what is larger than 32 MB, and each page that is taken anew has to be cleared: at 1280x720
    half of the processors' time went there.  This is of the whole process, so a command may do it, and a library may
    not.
    """
    if sys.platform == "win32" or not hasattr(library := ctypes.CDLL(None), "mallopt"):
        return False
    return bool(library.mallopt(M_MMAP_MAX, 0) and library.mallopt(M_TRIM_THRESHOLD, LARGEST_INT))


def _default(events: str, kind: str | None) -> Path:
    path = Path(os.path.abspath(events))
    name = f"{path.name if path.is_dir() else path.stem}_seen"
    return Path(name if kind in ("png", "exr") else f"{name}.mp4")


def _facts(path: Path, made: dict[str, Any]) -> list[tuple[str, str]]:
    from vid2ev.terminal import counted

    (width, height), kind, run = made["size"], made["format"].partition(" ")[0], made["run"]
    span_s, seconds = (made["stop_us"] - made["start_us"]) / 1e6, max(run["seconds"], 1e-9)
    return [
        ("made", f"{path}: {counted(made['frames'], 'picture')} of {width}x{height} as {kind}{film_text(made)}"),
        ("from", f"{counted(made['events'], 'event')}, {span_s:.6g} s"),
        ("speed", f"{run['frames'] / seconds:.3g} pictures/s, {run['seconds']:.3g} s"),
        *(("warning", text) for text in made["remarks"]),
    ]
