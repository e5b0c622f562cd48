"""`vid2ev eval`: how good methods are that rebuild frames."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click

from vid2ev.commands.source_options import source_options
from vid2ev.commands.worker_options import worker_options

GROUPS = "{percentage:3.0f}% {bar} {n_fmt}/{total_fmt} gaps, {elapsed} gone, {remaining} left{postfix}"


@click.command("eval", short_help="Score what rebuilds frames, as the field does.")
@click.argument("datasets", nargs=-1, required=True, metavar="DATASET...")
@click.option(
    "--network", "networks", multiple=True, metavar="WEIGHTS",
    help="Score a network: its weights, the folder of its run, or the name of some that come with vid2ev; may be"
    " repeated.",
)  # fmt: skip
@click.option(
    "--baseline", "baselines", multiple=True, metavar="NAME",
    help="Score a closed form; may be repeated.  [default: nearest, linear, flow, integration, both, bridge, ramps,"
    " guided]",
)  # fmt: skip
@click.option(
    "--predictions", multiple=True, metavar="DIR", type=click.Path(exists=True, file_okay=False),
    help="Score pictures that others have made: DIR/SEQUENCE/*.png, or DIR/SEQUENCE/METHOD/*.png; may be repeated."
    " As many as frames, or as are rebuilt, or named by the number of the frame, from 0.",
)  # fmt: skip
@click.option("--skip", type=click.IntRange(1), default=7, show_default=True, help="Frames between two key frames.")
@click.option(
    "--insert", type=click.IntRange(1), metavar="N", help="Frames rebuilt between them.  [default: as many as skipped]"
)
@click.option(
    "--times", type=click.Choice(["frames", "even"]), default="frames", show_default=True,
    help="Rebuild frames at their own times, or evenly between key frames as the field's scripts do; evenly where not"
    " as many are rebuilt as were skipped.",
)  # fmt: skip
@click.option(
    "--rounding", type=click.Choice(["round", "truncate"]), default="round", show_default=True,
    help="Of codes to 8 bits; the field's scripts truncate.",
)  # fmt: skip
@click.option(
    "--sensor", default="clean", show_default=True, metavar="PRESET|FILE",
    help="Event camera that looks at videos and scenes: clean is that of the paper without its low-pass; noisy a hard"
    " one; others as for convert.",
)  # fmt: skip
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of the sensor.")
@source_options
@click.option("--seed", type=click.IntRange(0, 1 << 61), default=0, show_default=True, help="Of the event camera.")
@click.option("--limit", type=click.IntRange(1), metavar="N", help="Only the first N gaps of each sequence.")
@click.option(
    "-o",
    "--output",
    metavar="REPORT",
    help="Folder of report, rows and summary.  [default: DATASET_eval here]",
)
@click.option(
    "--figures", is_flag=True,
    help="Also films, sheets of methods by moments and maps of errors, of the first gaps: REPORT/figures.",
)  # fmt: skip
@click.option("--resume", is_flag=True, help="Go on where an interrupted run was; networks may be added.")
@worker_options("Sequences")
@click.option("--device", default="cpu", show_default=True, metavar="DEVICE", help="Of networks: cpu or cuda.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def evaluate(
    datasets: tuple[str, ...],
    output: str | None,
    skip: int,
    insert: int | None,
    times: Any,
    rounding: Any,
    sensor: str,
    overrides: tuple[str, ...],
    baselines: tuple[str, ...],
    seed: int,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Score baselines, networks and predictions by the protocol of Time Lens: every 8th frame is a key frame, and those
    between are rebuilt and compared.

    DATASET is a folder of recordings (of vid2ev, HS-ERGB or BS-ERGB), a video of 240 frames a second or more, a folder
    of such, or scene:NAME.  Of videos frames are dropped, and an event camera is simulated that saw them all.
    """
    from interp.evaluate.protocol import Protocol
    from interp.evaluate.remarks import notes
    from interp.evaluate.report import PAGE
    from interp.evaluate.report.coverage import uneven
    from interp.evaluate.report.markdown import aligned
    from interp.evaluate.report.overview import full_scale_table, protocol_table
    from interp.evaluate.run import evaluate as evaluated
    from interp.evaluate.simulated import Simulated
    from interp.methods import METHODS
    from vid2ev.commands.live import shared_out
    from vid2ev.commands.progress import given
    from vid2ev.commands.worker_options import workers_of
    from vid2ev.interrupts import heard
    from vid2ev.sources import OPTIONS
    from vid2ev.terminal import counted, counting

    workers = workers_of(options)
    edits = {key: value for key in OPTIONS if (value := options.pop(key, None)) not in (None, "auto")}
    asked = edits or given() & {"sensor", "overrides", "seed"}
    folder = Path(output or f"{_name(datasets[0])}_eval")
    with kept(folder), heard() as check, counting(quiet or as_json, GROUPS) as shown:

        def report(*told: Any) -> None:
            check()
            shown(*told)

        found = evaluated(
            datasets,
            folder,
            baselines=baselines or tuple(METHODS),
            protocol=Protocol(skip, insert or skip, times, rounding),
            simulated=Simulated.of(sensor, overrides, seed, **edits) if asked else None,
            report=report,
            workers=workers,
            share=partial(shared_out, noun="sequences", quiet=quiet or as_json),
            **options,
        )
    if as_json:
        click.echo(json.dumps(found.summary, indent=2))
        return
    if quiet:
        return
    for table in (protocol_table(found.rows), full_scale_table(found.rows)):
        click.echo(f"{table.title}\n\n{aligned(table)}\n")
    sequences = counted(len(found.summary["sequences"]), "sequence")
    click.echo(f"{folder / PAGE}: {counted(len(found.rows), 'row')} of {sequences}")
    for note in (*notes(found.summary), *filter(None, (uneven(found.rows),))):
        click.echo(f"note: {note}", err=True)


@contextmanager
def kept(folder: Path) -> Iterator[None]:
    """Ctrl-C within says that the evaluation can be resumed."""
    from vid2ev.commands import KEPT, say_interrupted

    try:
        yield
    except KeyboardInterrupt:
        say_interrupted(f"{folder}: {KEPT}")


def _name(dataset: str) -> str:
    from interp.evaluate.naming import plain
    from vid2ev.sources import SCENE_PREFIX, short_name

    name = dataset.removeprefix(SCENE_PREFIX)
    return plain(short_name(dataset) if name == dataset else name)
