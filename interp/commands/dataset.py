"""`vid2ev dataset`: recordings to train and to score with, and a data card."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands.options import FiniteRange, Rate
from vid2ev.commands.worker_options import worker_options

if TYPE_CHECKING:
    from vid2ev.cluster.work import Outcome
    from vid2ev.commands.live import Said

SCENES = "{percentage:3.0f}% {bar} scene {n_fmt}/{total_fmt}, {elapsed} gone, {remaining} left{postfix}"


@click.command(short_help="Make a data set of recordings, with frames to rebuild.")
@click.argument("directory", type=click.Path(file_okay=False, path_type=Path), metavar="DIR")
@click.option(
    "--from", "videos", multiple=True, metavar="VIDEO",
    help="Of real videos, or a folder of them, in place of rendered scenes; may be repeated.",
)  # fmt: skip
@click.option(
    "--slowdown", type=FiniteRange(0, min_open=True), default=1.0, show_default=True, metavar="F",
    help="The videos play F times slower than the world went.",
)  # fmt: skip
@click.option(
    "--fps", type=Rate(), metavar="RATE",
    help="Of the videos, in place of their own times; for folders of pictures without times.",
)  # fmt: skip
@click.option(
    "--preset", type=click.Choice(["varied", "paper"]), default="varied", show_default=True,
    help="varied: sensors drawn for each scene or video, 30 to 240 frames a second; paper: its Table I, 30 to 960.",
)  # fmt: skip
@click.option(
    "--count", type=click.IntRange(1, 10**6), metavar="N",
    help="Scenes.  [default: 8, of the paper's 180, of videos all that they have]",
)  # fmt: skip
@click.option(
    "--layout", type=click.Choice(["own", "hsergb", "bsergb"]), default="own", show_default=True,
    help="Recordings of vid2ev, or the files of HS-ERGB or BS-ERGB.",
)  # fmt: skip
@click.option("--size", metavar="WxH", help="Pixels of rendered scenes.  [default: 640x480]")
@click.option(
    "--seed", type=click.IntRange(0, 1 << 61), default=0, show_default=True, help="Another seed, other scenes."
)
@worker_options("Scenes", "as many as cores")
@click.option("--resume", is_flag=True, help="Go on where an interrupted run was.")
@click.option("--json", "as_json", is_flag=True, help="Print what is in it as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def dataset(
    directory: Path,
    videos: tuple[str, ...],
    size: str | None,
    resume: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Make DIR: short recordings of a frame camera and an event camera, with what there was between the frames.

    Each is a folder in DIR; README.md there is a data card.  `vid2ev train --data DIR` trains with it.
    """
    from pydantic import ValidationError

    from interp.data.dataset import write_dataset
    from interp.data.dataset_spec import DatasetSpec
    from vid2ev.commands.batch import table
    from vid2ev.commands.live import shared_out
    from vid2ev.commands.progress import interruptible
    from vid2ev.commands.worker_options import workers_of
    from vid2ev.cores import usable_cores
    from vid2ev.errors import UsageError, clause
    from vid2ev.interrupts import heard
    from vid2ev.recording.destination import partial_of
    from vid2ev.sources.many import sources_in
    from vid2ev.terminal import counted, counting

    workers = workers_of(options, usable_cores())
    found = tuple(source for video in videos for source in sources_in(video))
    if size is not None:
        options["size"] = _size(size)
    try:
        spec = DatasetSpec(videos=found, **options)
    except ValidationError as error:
        complaint = error.errors()[0]
        named = f"--{str(complaint['loc'][0]).replace('_', '-')} {complaint['input']}: " if complaint["loc"] else ""
        raise UsageError(named + clause(complaint["msg"])) from error
    quiet |= as_json
    share = partial(shared_out, noun="scenes", quiet=quiet, said=_said)
    told = interruptible(directory, (partial_of(directory) / "job.json").exists)
    with told, heard(), counting(quiet, SCENES) as report:
        facts = write_dataset(directory, spec, resume=resume, workers=workers, share=share, report=report)
    if as_json:
        click.echo(json.dumps(facts, indent=2))
    elif not quiet:
        done = [{"video": name, "state": "done", "events": of["events"]} for name, of in facts["of_scenes"].items()]
        left = [{"video": name, "state": "failed", "error": why} for name, why in facts["left_out"].items()]
        click.echo(table([*done, *left]))
        made = (counted(facts[f"{name}s"], name) for name in ("scene", "sample", "event"))
        click.echo(f"{directory}: {', '.join(made)}")


def _said(outcome: Outcome) -> Said:
    """What is said of a scene that is made or left out."""
    from vid2ev.commands.live import Said, said_of
    from vid2ev.terminal import counted

    made = outcome.value
    if outcome.error or made.failed:
        return Said(f"{outcome.name}: left out: {made.failed}", failed=True) if made else said_of(outcome)
    return Said(f"{outcome.name}: {counted(made.facts['events'], 'event')}", made.facts["events"])


def _size(text: str) -> tuple[int, int]:
    from vid2ev.errors import UsageError

    width, times, height = text.partition("x")
    if not (times and width.isdecimal() and height.isdecimal() and min(int(width), int(height)) >= 16):
        raise UsageError(f"size '{text}': expected WIDTHxHEIGHT of at least 16, such as 640x480")
    return int(width), int(height)
