"""`vid2ev reformat`: event files of one format into another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from vid2ev.commands.options import SECONDS
from vid2ev.interrupts import heard


@click.command(short_help="Turn an event file into one of another format.")
@click.argument("source", metavar="IN")
@click.argument("target", metavar="OUT", type=Path)
@click.option("--format", "name", metavar="NAME", help="Format of OUT.  [default: what its suffix says]")
@click.option(
    "--start", "start_s", type=SECONDS, metavar="S",
    help="Begin S seconds after the beginning: from when the file counts, or its first event if that is long after.",
)  # fmt: skip
@click.option(
    "--stop", "stop_s", type=SECONDS, metavar="S", help="End S seconds after the beginning, with what comes right then."
)
@click.option("--overwrite", is_flag=True, help="Replace what is there.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@heard()
def reformat(source: str, target: Path, as_json: bool, quiet: bool, **options: Any) -> None:
    """Turn the event file IN, of any format, into OUT: every event at its own microsecond.

    What IN is, its content says: DSEC's or v2e's HDF5, AEDAT 2, 3.1 or 4, Prophesee's EVT 2, EVT 3 or DAT, ROS bags,
    Event Stream, N-MNIST, NumPy arrays, or text.
    """
    from vid2ev.commands import summary
    from vid2ev.commands.progress import event_bar
    from vid2ev.reformat import reformat as make
    from vid2ev.terminal import lines

    with event_bar(quiet) as report:
        made = make(source, target, report=report, **options)
    if as_json:
        click.echo(json.dumps(made, indent=2))
    elif not quiet:
        width, height = made["size"]
        facts = [
            ("made", f"{', '.join(made['files'])}: {made['format']}, {summary.short(made['bytes'])}B"),
            ("events", f"{made['events']:,} in {made['span_us'] / 1e6:.10g} s, {width}x{height} pixels"),
            *(("warning", text) for text in made["warnings"]),
        ]
        click.echo(lines(facts))
