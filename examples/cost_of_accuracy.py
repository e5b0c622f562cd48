#!/usr/bin/env python3
"""Measure what accuracy costs on a clip: the table and the picture of the README.

    python examples/cost_of_accuracy.py                                 a second of examples/demo.mp4, to cost.png
    python examples/cost_of_accuracy.py CLIP --budget us=50 -o mine.png
    python examples/cost_of_accuracy.py CLIP -o docs/cost.png --into README.md

The same as `vid2ev cost CLIP`, but with the table in Markdown; with `--into` it takes the place of the table in the
section "What accuracy costs" of a page, and the lines that begin with "Measured:" say of what.  Run it on a machine
that does nothing else, or count the time of its processors instead, with `--cpu`.
"""

from __future__ import annotations

import re
import textwrap
import time
from pathlib import Path

import click

from vid2ev.cost.measure import Cost, measured
from vid2ev.cost.plot import plot
from vid2ev.cost.table import cells, recommendation, stretch_in_words
from vid2ev.recording.manifest import machine

CLIP = Path(__file__).with_name("demo.mp4")
HEADING = "## What accuracy costs"
TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
MEASURED = re.compile(r"^Measured: .*\n(?:.+\n)*", re.MULTILINE)
WIDTH = 120
SIDES = {"setting": ":--", "convert ...": ":--"}


def in_markdown(cost: Cost) -> str:
    """The table; what is on the front is in bold, and the recommended has an arrow."""
    head, *lines = cells(cost)
    rows = [head[1:], [SIDES.get(name, "--:") for name in head[1:]]]
    for mark, name, *rest, arguments in lines:
        shown = f"**{name}**" if mark else name
        rows.append([f"{'→ ' * (mark == '>')}{shown}", *rest, f"`{arguments}`" if arguments else ""])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def in_words(cost: Cost, cpu: bool) -> str:
    """What was measured, and the recommendation."""
    part = "" if cost.stretch_s == (None, None) else f" {stretch_in_words(cost.stretch_s)}"
    width, height = cost.size
    computer = f"{machine()['processor']}, {cost.threads} threads"
    kind = "; times are those of all processors together" * cpu
    words = f"`{Path(cost.clip).name}`{part}, {width}x{height}, {computer}{kind}. Recommended {recommendation(cost)}."
    return textwrap.fill(f"Measured: {words}", WIDTH, break_on_hyphens=False, break_long_words=False) + "\n"


def put(page: str, cost: Cost, cpu: bool = False) -> str:
    """The page with this table in its section; raises ClickException where there is none."""
    before, found, section = page.partition(HEADING)
    if not found or not TABLE.search(section) or not MEASURED.search(section):
        raise click.ClickException(f"the page has no section '{HEADING}' with a table and a line 'Measured: ...'")
    section = TABLE.sub(lambda _: in_markdown(cost), section, count=1)
    return before + found + MEASURED.sub(lambda _: in_words(cost, cpu), section, count=1)


@click.command(help=__doc__.split("\n\n")[0] if __doc__ else None)
@click.argument("clip", type=click.Path(exists=True, dir_okay=False, path_type=Path), default=CLIP)
@click.option("--budget", default="vR=0.05", show_default=True)
@click.option("--sensor", default="paper", show_default=True)
@click.option("--duration", type=float, help="Seconds of the middle of the clip.")
@click.option("--size", help="Bring the clip to this size first.")
@click.option("--fps", type=float, help="Frames per second, where the clip does not say.")
@click.option("--repeats", type=click.IntRange(1), default=3, show_default=True)
@click.option("--threads", type=click.IntRange(1))
@click.option("--cpu", is_flag=True, help="Count the time of processors.")
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), default=Path("cost.png"))
@click.option("--into", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="A page with such a table.")
def main(clip, budget, sensor, duration, size, fps, repeats, threads, cpu, output, into) -> None:
    def report(done: int, count: int, name: str) -> None:
        click.echo(f"{done + 1} of {count}: {name}", err=True)

    cost = measured(
        clip, budget=budget, sensor=sensor, duration_s=duration, size=size, fps=fps, repeats=repeats, threads=threads,
        report=report, clock=time.process_time if cpu else time.perf_counter, given=["size"] * (size is not None),
    )  # fmt: skip
    plot(cost, output)
    if into is not None:
        into.write_text(put(into.read_text(encoding="utf-8"), cost, cpu), encoding="utf-8")
    click.echo(in_markdown(cost) + "\n" + in_words(cost, cpu) + f"\n{output}")


if __name__ == "__main__":
    main()
