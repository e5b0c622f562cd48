"""`vid2ev compare`: how different two recordings are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from vid2ev.plan.recordings import Compared


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
    nothing in common.  Timing errors are those of events that belong together, positive where A is late.
    """
    from vid2ev.commands import summary
    from vid2ev.commands.progress import event_bar
    from vid2ev.plan.recordings import compare_recordings
    from vid2ev.plan.rigs import compare_rigs, is_rig

    if plot is not None and plot.suffix.lower() != ".png":
        raise UsageError(f"--plot {plot}: expected a name that ends in .png")
    if is_rig(Path(recording)) and is_rig(Path(reference)):
        with event_bar(quiet) as report:
            cameras = compare_rigs(Path(recording), Path(reference), report=report, **options)
        _draw(cameras, plot, overwrite)
        texts = [f"{name}\n{summary.lines(compared.facts())}" for name, compared in cameras.items()]
        found = {"cameras": {name: compared.as_dict() for name, compared in cameras.items()}}
        click.echo(json.dumps(found, indent=2) if as_json else "\n\n".join(texts))
        return
    with event_bar(quiet) as report:
        compared = compare_recordings(recording, reference, report=report, **options)
    _draw({"": compared}, plot, overwrite)
    click.echo(json.dumps(compared.as_dict(), indent=2) if as_json else summary.lines(compared.facts()))


def _draw(cameras: dict[str, Compared], picture: Path | None, overwrite: bool) -> None:
    """The pictures of one comparison, or of each camera's with its name."""
    from vid2ev.plan.plots import plot

    if picture is None:
        return
    places = {picture.with_stem(f"{picture.stem}{name and '_'}{name}"): one for name, one in cameras.items()}
    for place in places:
        if place.exists() and not overwrite:
            raise UsageError(f"{place} exists; --overwrite replaces it")
    for place, compared in places.items():
        plot(compared.comparison, place)
