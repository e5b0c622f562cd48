"""`vid2ev compare`: how different two recordings are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from vid2ev.compare.recordings import Compared


@click.command(short_help="Say how different two recordings are.")
@click.argument("recording", metavar="A")
@click.argument("reference", metavar="B")
@click.option(
    "--align",
    type=click.Choice(["clock", "start"]),
    default="clock",
    show_default=True,
    help="clock: times as they are; start: lay the beginning of B on that of A.",
)
@click.option(
    "--window",
    "window_us",
    type=click.IntRange(1, 1_000_000),
    default=5000,
    show_default=True,
    metavar="US",
    help="Events that belong together are less than this apart [us].",
)
@click.option("--statistics", is_flag=True, help="And each alone: rates, share of ON, intervals, isolated events.")
@click.option("--plot", type=Path, metavar="FILE.png", help="Draw it: per pixel, timing errors, over time.")
@click.option("--overwrite", is_flag=True, help="Replace the picture that is there.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
def compare(
    recording: str, reference: str, plot: Path | None, overwrite: bool, as_json: bool, quiet: bool, **options: Any
) -> None:
    """Say how different the events of A are from those of the reference B: event files of any formats, folders of
    recordings, or of two rigs with the same cameras.

    The distance is van Rossum's at 1 ms, per pixel and polarity: 0 is the same, 0.01 is 2 % of the events missing, 1 is
    nothing in common, and more the same of events in bursts, or of the wrong polarity.  Timing errors are those of
    events that belong together, positive where A is late.
    """
    from vid2ev.commands.progress import event_bar
    from vid2ev.compare.plots import plot as draw
    from vid2ev.compare.recordings import compare_recordings
    from vid2ev.compare.rigs import pairs
    from vid2ev.terminal import lines

    cameras = pairs(recording, reference)
    pictures = _pictures(plot, list(cameras), overwrite)
    found = {}
    for name, (one, other) in cameras.items():
        with event_bar(quiet) as report:
            found[name] = compare_recordings(one, other, report=report, **options)
    if as_json:
        numbers = {name: compared.as_dict() for name, compared in found.items()}
        click.echo(json.dumps(numbers.get("", {"cameras": numbers}), indent=2))
    else:
        click.echo("\n\n".join(lines(_facts(name, compared)) for name, compared in found.items()))
    for name, picture in pictures.items():
        draw(found[name].comparison, picture)


def _facts(name: str, compared: Compared) -> list[tuple[str, str]]:
    return [*([("camera", name)] if name else []), *compared.facts()]


def _pictures(picture: Path | None, names: list[str], overwrite: bool) -> dict[str, Path]:
    """The picture of the only comparison, or those of each camera, with its name in theirs."""
    from vid2ev.recording.destination import check_new

    if picture is None:
        return {}
    if picture.suffix.lower() != ".png":
        raise UsageError(f"--plot {picture}: expected a name that ends in .png")
    places = {name: picture.with_stem(f"{picture.stem}_{name}") if name else picture for name in names}
    for place in places.values():
        check_new(place, overwrite)
    return places
