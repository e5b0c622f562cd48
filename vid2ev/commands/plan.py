"""`vid2ev plan`: which effects of its cameras a clip calls for."""

from __future__ import annotations

import json
from typing import Any

import click

from vid2ev.commands.auto import Auto
from vid2ev.commands.options import FiniteRange
from vid2ev.commands.source_options import camera_options, source_options


@click.command(short_help="Say which effects of a sensor a clip calls for.")
@click.argument("source")
@camera_options
@click.option(
    "--upsample", default="flow", show_default=True, metavar="none|linear|flow|net",
    help="Light between the frames: what is measured is what the sensor would see.",
)  # fmt: skip
@click.option("--subframes", type=Auto("auto", 1, "subframes"), default="auto", help="As for convert.")
@click.option("--max-subframes", type=click.IntRange(1), default=64, show_default=True, help="As for convert.")
@click.option("--cuts", type=click.Choice(["restart", "keep"]), default="restart", help="As for convert.")
@source_options
@click.option(
    "--bayer", type=click.Choice(["RGGB", "BGGR", "GRBG", "GBRG"], case_sensitive=False), help="As for convert."
)
@click.option(
    "--effects", default="auto", show_default=True, metavar="auto|all|none|NAME[,NAME...]", help="Effects to keep."
)
@click.option(
    "--tolerance", type=FiniteRange(0, 1), default=0.01, show_default=True, metavar="D",
    help="How far events and frames may be from those of all effects, as a distance.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
def plan(source: str, effects: str, tolerance: float, as_json: bool, **options: Any) -> None:
    """Measure SOURCE and say of each effect of the sensor what leaving it out would change, what that costs, and
    whether `convert --effects auto` would keep it; of a rig, for each camera, with the views and sub-frames.

    The distance of events is van Rossum's at 1 ms: 0 for the same, 1 or more for nothing in common.  That of frames is
    the square of the greatest change of a level, as a share of what rounding to codes changes: 0.01 is 0.029 LSB.
    A level is what is rounded to a code, in the mean over the noise that stays; of dim light with shot noise codes may
    change by more, as that noise goes with the light.  Nothing is converted.
    """
    from vid2ev.cores import usable_cores
    from vid2ev.plan.recordings import described, plans_of
    from vid2ev.seen.recipe import Recipe

    recipe = Recipe.of(source, **options)
    plans = plans_of(recipe, effects, tolerance, usable_cores())
    for warning in recipe.source.warnings:
        click.echo(f"warning: {warning}", err=True)
    if as_json:
        click.echo(json.dumps(described(plans)["plan"], indent=2))
        return
    click.echo("\n\n".join(f"{name}\n{each}".lstrip() for name, each in plans.items()))
