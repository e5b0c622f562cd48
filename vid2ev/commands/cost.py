"""`vid2ev cost`: what accuracy costs in time."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands.auto import Auto
from vid2ev.commands.options import FiniteRange
from vid2ev.commands.source_options import camera_options, source_options
from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from vid2ev.cost.store import Findings


@click.command(short_help="Say what accuracy costs in time, on your clip and machine.")
@click.argument("source")
@click.option(
    "--budget", metavar="LIMIT[,LIMIT...]",
    help="What a setting may cost: vR=0.05 (distance), count=0.01, us=50 (median timing error), lsb=1 (frames),"
    " time=10x (multiples of the clip's length).  [default: vR=0.05, of frame cameras alone lsb=1]",
)  # fmt: skip
@click.option("--duration", "duration_s", type=FiniteRange(0, min_open=True), metavar="S", help="How much of the"
    " middle of the clip to take.  [default: 30 frames of 640x480, less of larger ones]")  # fmt: skip
@click.option("--repeats", type=click.IntRange(1), default=3, show_default=True, help="How often to time each setting.")
@camera_options
@click.option(
    "--upsample", default="flow", show_default=True, metavar="none|linear|flow|net",
    help="Light between the frames: this in all settings.",
)  # fmt: skip
@click.option("--subframes", type=Auto("auto", 1, "subframes"), default="auto", help="Steps: this in all settings.")
@click.option("--max-subframes", type=click.IntRange(1), default=64, metavar="N", help="This in all settings.")
@click.option("--cuts", type=click.Choice(["restart", "keep"]), default="restart", help="As for convert.")
@source_options
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="As for convert.")
@click.option("--threads", type=click.IntRange(1), metavar="N", help="As for convert.  [default: all cores]")
@click.option(
    "--bayer", type=click.Choice(["RGGB", "BGGR", "GRBG", "GBRG"], case_sensitive=False), help="As for convert."
)
@click.option("--effects", default="all", metavar="all|auto|none|NAME[,NAME...]", help="This in all settings.")
@click.option("--tolerance", type=FiniteRange(0, 1), default=0.01, metavar="D", help="Of --effects auto.")
@click.option(
    "--rebuild", "multiple", type=click.IntRange(2), metavar="N",
    help="Of rebuilding N times the frames by `interpolate`, in place of converting: methods and networks.",
)  # fmt: skip
@click.option(
    "--network", "networks", multiple=True, metavar="WEIGHTS",
    help="With --rebuild, a network; may be repeated.  [default: those that come with vid2ev]",
)  # fmt: skip
@click.option("--gaps", type=click.IntRange(1), default=4, show_default=True, help="With --rebuild, how many to score.")
@click.option("-o", "--output", metavar="NAME", help="Write NAME.json and NAME.png.  [default: SOURCE_cost here]")
@click.option("--overwrite", is_flag=True, help="Replace them if they are there.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
def cost(
    source: str,
    output: str | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
    multiple: int | None,
    networks: tuple[str, ...],
    gaps: int,
    **options: Any,
) -> None:
    """Convert a part of SOURCE with one setting after the other, and say how long each takes and how far its events are
    from those of a reference, finer than all of them: a table, a file for programs, and a plot of error against time.

    What you give explicitly is the same in all settings; the rest is varied.  Nothing else is written.  Kernels are
    compiled before anything is timed; the first time that takes some minutes.

    Exit code 2 says that no setting is within the budget that was given; what was measured is there all the same.

    With --rebuild, frames of SOURCE (what `eval` takes) are dropped and rebuilt in one way after the other: how long
    each takes per frame, of that size and of two others, and how close its frames are to those dropped.
    """
    from vid2ev.commands.progress import given, pass_bar
    from vid2ev.cost.store import check, store

    asked = given()
    if multiple is None and (strange := asked & {"networks", "gaps"}):
        raise UsageError(
            f"--{'gaps' if 'gaps' in strange else 'network'} is for --rebuild; add it, such as --rebuild 8"
        )
    places = check(output, source, overwrite, "cost" if multiple is None else "rebuild_cost")
    with pass_bar(quiet or as_json) as report:
        if multiple is None:
            found = _of_conversion(source, given=asked, report=report, **options)
        else:
            options |= {"multiple": multiple, "networks": networks, "gaps": gaps}
            found = _of_rebuilding()(source, given=asked, report=report, **options)
    click.echo(json.dumps(found.described, indent=2) if as_json else found.text)
    store(found.described, places[0])
    found.draw(places[1])
    if not (as_json or quiet):
        click.echo(f"\n{places[0]}, {places[1]}")
    if found.refusal:
        raise UsageError(found.refusal)


def _of_conversion(source: str, **options: Any) -> Findings:
    from vid2ev.cost.front import refusal
    from vid2ev.cost.measure import measured
    from vid2ev.cost.plot import plot
    from vid2ev.cost.store import Findings
    from vid2ev.cost.table import table

    found = measured(source, **options)
    unmet = refusal(found.settings, found.budget) if found.recommended is None and options["budget"] else None
    return Findings(found.describe(), table(found, recommending=not unmet), partial(plot, found), unmet)


def _of_rebuilding() -> Callable[..., Findings]:
    """What another package has entered in the group `vid2ev.costs` for it."""
    return next(iter(entry_points(group="vid2ev.costs", name="rebuild"))).load()
