"""`vid2ev train`: a network, from simulated or real samples to its weights."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands.auto import Auto
from vid2ev.errors import DataError, UsageError

if TYPE_CHECKING:
    from interp.train.fit import Outcome
    from interp.train.job import Job
    from interp.train.machines import Machines
    from vid2ev.sensors.devices import Device

WORD = "auto"
SAYS = {  # what an option says of a job: the part of it, if it is in one, and the name
    "network": ("", "network"), "size": ("", "size"), "seed": ("recipe", "seed"), "steps": ("recipe", "steps"),
    "time_": ("recipe", "time_s"),
}  # fmt: skip


@click.command(short_help="Train a network that rebuilds video from slow frames and events.")
@click.option(
    "--network", metavar="NAME",
    help="superslomo, slomo-events, rrin, rrin-light, rrin-events, rrin-events-light, rrin-events-guided,"
    " rrin-slomo-events, timelens, flow, e2vid, firenet, hdr.  [default: rrin-events-guided, or that of --start]",
)  # fmt: skip
@click.option(
    "--size", type=click.Choice(["tiny", "small", "paper"]), help="Width.  [default: tiny, or that of --start]"
)
@click.option(
    "--start", "starts", multiple=True, metavar="[PART=]WEIGHTS",
    help="Begin with these weights: of a file, a run, or the name of some that come with vid2ev; for a part such as"
    " flow, those of a network trained for itself; features=FILE, of VGG16, for losses that look at features.",
)  # fmt: skip
@click.option(
    "--data", multiple=True, metavar="PATH", type=click.Path(exists=True),
    help="A video, or a folder of recordings, of videos or of pictures with their times; may be repeated.  [default:"
    " scenes, made on the fly]",
)  # fmt: skip
@click.option(
    "--validate", multiple=True, metavar="VIDEO", type=click.Path(exists=True),
    help="A video to validate with, or a folder of videos or of pictures with their times, beside scenes: frames of it"
    " are left out.",
)  # fmt: skip
@click.option("-o", "--output", metavar="RUN", help="Folder of the run.  [default: NETWORK_SIZE here]")
@click.option("--time", "time_", metavar="TIME", help="How long it may take, such as 2h.  [default: 55m]")
@click.option("--steps", type=click.IntRange(1), metavar="N", help="Steps, whatever time they take.")
@click.option(
    "--set", "settings", multiple=True, metavar="KEY=VALUE",
    help="Change a number of the recipe, of network., clips., samples., window. or validation.; may be repeated.",
)  # fmt: skip
@click.option(
    "--seed", type=click.IntRange(0, (1 << 63) - 1), default=0, show_default=True, help="Another seed is another run."
)
@click.option("--resume", is_flag=True, help="Go on where a run stands.")
@click.option("--session", metavar="TIME", help="Stop after this time, such as 5m, to go on another time.")
@click.option(
    "--devices", type=Auto(WORD, 1, "devices"), default=WORD, show_default=True,
    help="GPUs of each machine, or processes without.",
)  # fmt: skip
@click.option("--nodes", type=click.IntRange(1), default=1, show_default=True, help="Machines; start it on each.")
@click.option("--cpu", is_flag=True, help="Train on the CPU though there is a GPU.")
@click.option(
    "--workers", type=click.IntRange(0), metavar="N",
    help="Processes that make samples, for each that trains.  [default: the cores that are left, at least 1]",
)  # fmt: skip
@click.option(
    "--clips-on", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True,
    help="Where clips are simulated: by those processes, or on a GPU of NVIDIA's.",
)  # fmt: skip
@click.option("--dry-run", is_flag=True, help="Check everything, say what would be done, do nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def train(
    output: str | None,
    resume: bool,
    session: str | None,
    devices: int | str,
    nodes: int,
    cpu: bool,
    workers: int | None,
    clips_on: str,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Train a network, with samples that are simulated on the fly or taken from videos and recordings.

    A run is a folder with weights.safetensors, curves, pictures, and all that it takes to go on: interrupted or killed
    at any moment, or carried to another machine, it continues with --resume, on a CPU to the very same weights.
    """
    from interp.data.inputs import trained_with
    from interp.data.usable import unusable
    from interp.train.machines import Machines, check_installed
    from interp.train.run_folder import with_others
    from interp.train.starts import parsed

    session_s = _seconds(session, "--session") if session else None
    starts = parsed(options["starts"])
    path = Path(output or _usual_name(options, starts))
    job = _taken_up(path, options, starts) if resume else _job(options, starts)
    check_installed()
    from interp.train.made_of import check_samples

    machines = Machines.of(devices, nodes, cpu, job.recipe.processes)  # type: ignore[arg-type]
    if machines.accelerator == "cpu":
        job = job.trained_by(machines.devices)
    machines.check_batch(job.recipe.batch)
    check_samples(job)
    films = job.validation.videos
    notes = [f"not used: {reason}" for reason in (*unusable(job.clips, films), *_beside(options["data"]))]
    notes += trained_with(job.clips, films)
    _note(notes, machines, quiet)
    device = _device(clips_on, machines, quiet)
    if dry_run:
        from interp.train.made_of import learner_of
        from interp.train.run_folder import check_place
        from interp.train.starts import begin
        from interp.train.told import described

        check_place(path, job.kept([path]), resume)
        begin(learner_of(job), starts)
        click.echo(json.dumps(job.model_dump(mode="json"), indent=2) if as_json else described(job, path))
        return
    if resume and machines.first and (changed := with_others(path)):
        _note([f"trained until now with {changed}: it goes on, but not to the same bits"], machines, quiet)
    outcome = _run(job, path, resume, machines, session_s, workers, quiet or as_json, starts, device)
    if machines.first:
        _tell(outcome, path, job.network, as_json, quiet)


def _run(
    job: Job,
    path: Path,
    resume: bool,
    machines: Machines,
    session_s: float | None,
    workers: int | None,
    quiet: bool,
    starts: Mapping[str, Path],
    device: Device,
) -> Outcome:
    """A session; the first Ctrl-C ends it after the step, with a checkpoint, or before the first one at once."""
    from interp.train.runs import run
    from vid2ev.commands import INTERRUPTED, KEPT, say_interrupted
    from vid2ev.interrupts import heard

    try:
        with heard(gently=True) as check:
            return run(job, path, resume, machines, session_s, workers, quiet, check, starts, device, check)
    except KeyboardInterrupt:
        if machines.first:
            begun = (path / "run.json").exists()
            say_interrupted(f"{path}: {KEPT}" if begun else "")
        sys.exit(INTERRUPTED)


def _note(notes: Sequence[str], machines: Machines, quiet: bool) -> None:
    """What a person should know, said once."""
    for note in notes if machines.first and not quiet else ():
        click.echo(f"note: {note}", err=True)


def _device(asked: str, machines: Machines, quiet: bool) -> Device:
    """Where clips are made; without a GPU on the CPU, which is said."""
    from vid2ev.sensors.devices import Device, missing_for_cuda

    if asked == "cuda" and (missing := missing_for_cuda()):
        _note([f"clips are made on the CPU: {missing}"], machines, quiet)
        return Device("cpu", asked, missing)
    return Device(asked, asked)


def _tell(outcome: Outcome, path: Path, network: str, as_json: bool, quiet: bool) -> None:
    from interp.train import told

    if as_json:
        click.echo(json.dumps(told.as_json(outcome), indent=2))
    elif not quiet:
        of = f" of {outcome.steps}" if outcome.steps else ""
        skipped = f", {outcome.skipped} without a finite gradient skipped" * bool(outcome.skipped)
        rest = "" if outcome.finished else "; the same command with --resume goes on"
        click.echo(f"{path}: step {outcome.step}{of}{skipped}{rest}")
        if outcome.finished:
            click.echo(f"weights.safetensors: those of step {outcome.best}, the best by validation")
            click.echo(f"\n{told.table(outcome, network)}")


def _usual_name(options: Mapping[str, Any], starts: Mapping[str, Path]) -> str:
    """NETWORK_SIZE, of a run's folder."""
    from interp.train.job import network_and_size

    return "_".join(network_and_size(options["network"], options["size"], starts))


def _job(options: Mapping[str, Any], starts: Mapping[str, Path]) -> Job:
    """The job of options of the command line."""
    from interp.train.job import Job

    videos, recordings = _told_apart(options["data"])
    validated, others = _told_apart(options["validate"])
    if others:
        raise UsageError(f"--validate {others[0]}: expected a video, or a folder of videos or of pictures")
    settings = [f"seed={options['seed']}", *options["settings"]]
    if options["time_"]:
        settings.append(f"time_s={_seconds(options['time_'], '--time')}")
    if options["steps"]:
        settings.append(f"steps={options['steps']}")
    return Job.of(options["network"], options["size"], settings, videos, recordings, validated, starts)


def _told_apart(paths: Sequence[str]) -> tuple[list[str], list[str]]:
    """The videos that paths stand for, and the folders of recordings among them, or of neither."""
    found = {path: _videos_in(path) for path in paths}
    return [video for path in paths for video in found[path]], [path for path in paths if not found[path]]


def _videos_in(path: str) -> list[str]:
    """The videos that a path stands for; none of a folder of recordings, or of neither."""
    from interp.data.layouts import holds_sequences
    from vid2ev.sources.many import holds_pictures, sources_in

    folder = Path(path)
    if not folder.is_dir():
        return sources_in(path)
    if holds_sequences(folder):
        return []
    return [each for each in sources_in(path) if each != path or holds_pictures(folder)]


def _beside(paths: Sequence[str]) -> Iterator[str]:
    """The videos beside recordings in a folder, which is one of these."""
    from interp.data.layouts import holds_sequences, is_sequence
    from vid2ev.sources.many import sources_in
    from vid2ev.terminal import counted

    for path in paths:
        folder = Path(path)
        films = sources_in(path) if not is_sequence(folder) and holds_sequences(folder) else []
        if films and films != [path]:
            yield f"{path}: {counted(len(films), 'video')} beside its recordings; give --data {films[0]}, too"


def _taken_up(path: Path, options: Mapping[str, Any], starts: Mapping[str, Path]) -> Job:
    """The job of a run that was begun, with what the command line says of it: whatever is not said is as it was begun.

    What decides more than a number, such as data, and settings of networks, has to be said as a whole.
    """
    from pydantic import ValidationError

    from interp.train.job import Job, by_part
    from interp.train.run_folder import begun_job
    from vid2ev.commands.progress import given
    from vid2ev.untrusted import first_line

    said, settings = given() & options.keys(), by_part(options["settings"])
    if said - SAYS.keys() - {"settings"} or settings["network"]:
        return _job(options, starts)
    try:
        begun = Job(**begun_job(path))
        if not said:
            return begun
        asked, merged = _job(options, starts).model_dump(), begun.model_dump()
        set_ = [(part, name) for part, values in settings.items() for name in values]
        for part, name in [*map(SAYS.__getitem__, said - {"settings"}), *set_]:
            of, to = (asked[part], merged[part]) if part else (asked, merged)
            to[name] = of[name]
        return Job(**merged)
    except (ValidationError, TypeError) as error:
        raise DataError(
            f"{path / 'run.json'} does not say what is trained ({first_line(error, 150)}); copy the run again, or start"
            " another"
        ) from error


def _seconds(text: str, option: str) -> float:
    """Seconds of a time such as 90s, 55m or 2h."""
    found = re.fullmatch(r"([0-9]{1,9}\.?[0-9]{0,9})\s*(s|m|h|)", text.strip())
    if not found or float(found[1]) == 0:
        raise UsageError(f"{option} {text}: expected a time above 0; give it as 90s, 55m or 2h")
    return float(found[1]) * {"s": 1, "": 1, "m": 60, "h": 3600}[found[2]]
