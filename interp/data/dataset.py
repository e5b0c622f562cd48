"""Data sets: recordings made as `vid2ev convert` makes them, in a folder that is there as a whole or not at all.

DIR.partial/         while it is being made; the same command with --resume goes on
    job.json         what is made; only the same is ever continued
    NAME/            each recording as it is finished
    parts/NAME/      of other layouts: what a recording is written from
DIR/                 NAME/ ..., dataset.json, README.md (the data card)
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from interp.data.card import card_text
from interp.data.dataset_spec import DatasetSpec, Scene, scenes_of
from interp.data.inputs import digests_of
from interp.data.layouts import open_sequence
from interp.data.layouts.own import Own
from vid2ev import DataError, UsageError, convert
from vid2ev.cluster.processes import processes
from vid2ev.cluster.task import Task, Tell
from vid2ev.cluster.work import Share, WorkerLost, outcomes
from vid2ev.cluster.workers import Workers, has_dask
from vid2ev.errors import DiskError
from vid2ev.making.conversion import telling
from vid2ev.recording.destination import check_destination, partial_of
from vid2ev.recording.disk import THEN_RESUME, sync, whole_file, writing
from vid2ev.recording.held import LOCK, Held
from vid2ev.recording.manifest import difference, read_manifest, versions

FACTS = "dataset.json"
ALONE = Workers()
Report = Callable[[int, int, str], object]  # scenes done, of how many, and the last one's name


class Made(NamedTuple):
    """A recording of a data set: its facts for the card, or why it could not be made."""

    name: str
    facts: dict[str, Any]
    failed: str = ""


def write_dataset(
    directory: Path,
    spec: DatasetSpec,
    *,
    resume: bool = False,
    workers: Workers = ALONE,
    share: Share = outcomes,
    report: Report | None = None,
) -> dict[str, Any]:
    """Make a data set; returns its facts, which dataset.json and the data card have.

    workers  who make a scene each; they change nothing but the time it takes
    share    shares scenes out among several workers
    report   told how far it is where they are not shared out
    resume   go on where an interrupted run was; a finished data set is left as it is
    Raises UsageError where `directory` is taken or begun with something else, DataError where it cannot be written, no
    scene can be made, or the workers of one died.
    """
    made_in = partial_of(directory)
    inputs = {"inputs": digests_of(spec.videos, [directory, made_in])} if spec.videos else {}
    job = json.loads(json.dumps({"versions": versions(), "spec": spec.model_dump(mode="json")} | inputs))
    if directory.exists():
        return _finished(directory, job, resume)
    check_destination(directory)
    if (made_in / "job.json").exists() and not resume:
        raise UsageError(f"{directory} was begun and not finished; --resume continues it, or remove {made_in}")
    scenes, unusable = scenes_of(spec)
    with writing(directory, THEN_RESUME), Held(made_in):
        _begin(made_in / "job.json", job, directory)
        made = sorted(_all(scenes, made_in, spec, workers, share, report))
        facts = _facts(job, spec, made, unusable)
        _publish(made_in, directory, facts)
    return facts


def _all(
    scenes: list[Scene], folder: Path, spec: DatasetSpec, workers: Workers, share: Share, report: Report | None
) -> Iterator[Made]:
    """All recordings, in whatever order they come."""
    make = partial(make_scene, folder=folder, layout=spec.layout, multiple=spec.multiple)
    if workers.alone:
        coming: Iterator[Made] = map(make, scenes)
        yield from _told(coming, len(scenes), report)
    elif workers.scheduler or has_dask():
        yield from _shared_out(scenes, make, workers, share)
    else:
        with processes(workers.jobs) as submit:
            futures = [submit(make, scene) for scene in scenes]
            yield from _told((future.result() for future in as_completed(futures)), len(scenes), report)


def _shared_out(scenes: list[Scene], make: Callable[[Scene], Made], workers: Workers, share: Share) -> Iterator[Made]:
    """All recordings, by workers.  What is left out is so because of itself, not of them: raises WorkerLost at the end
    if one was lost."""
    lost: Exception | None = None
    for outcome in share([Task(scene.name, partial(_as_task, make, scene)) for scene in scenes], workers):
        if outcome.error and not isinstance(outcome.error, WorkerLost):
            raise outcome.error
        lost = lost or outcome.error
        if outcome.value:
            yield outcome.value
    if lost:
        raise WorkerLost(f"{lost}; the other scenes are kept, the same command with --resume goes on")


def _as_task(make: Callable[..., Made], scene: Scene, tell: Tell) -> Made:
    return make(scene, tell=tell)


def _told(coming: Iterator[Made], count: int, report: Report | None) -> Iterator[Made]:
    for done, made in enumerate(coming, 1):
        if report:
            report(done, count, made.name)
        yield made


def make_scene(scene: Scene, folder: Path, layout: str, multiple: int, tell: Tell | None = None) -> Made:
    """One recording in a folder, if it is not there yet.  Raises DiskError, which is no fault of the scene."""
    target = folder / scene.name
    source = target if layout == "own" else folder / "parts" / scene.name
    try:
        if not target.exists():
            source.parent.mkdir(exist_ok=True)
            report = telling(tell) if tell else None
            fixed: dict[str, Any] = {"pictures": "png", "preview": False, "resume": True, "threads": 1}
            convert(scene.video, source, report=report, **fixed, **scene.options)
            if layout != "own":
                from interp.data.layouts.writing import write_sequence

                write_sequence(Own(source), target, layout)
                shutil.rmtree(source)
        return Made(scene.name, facts_of(target, multiple, scene))
    except DiskError as error:  # (its own remedy is for who chose the folder of this recording alone)
        reason = getattr(error.__cause__, "strerror", None) or "the disk does not take it"
        raise DiskError(f"{target} cannot be written: {reason}; {THEN_RESUME}") from error
    except (DataError, UsageError) as error:
        return Made(scene.name, {}, str(error))


def facts_of(folder: Path, multiple: int, scene: Scene) -> dict[str, Any]:
    """What the card says of a recording."""
    sequence = open_sequence(folder)
    frames = len(sequence.times_us)
    keys = len(sequence.key_frames) if isinstance(sequence, Own) else (frames - 1) // multiple + 1
    cameras = {camera.name: camera for camera in scene.options["rig"].cameras}
    start_us, stop_us = sequence.covered_us
    x_mm, y_mm, _ = cameras["dvs"].translation_mm
    return {
        "video": Path(scene.video).name, "key_frames": keys, "samples": max(keys - 1, 0) * multiple, "frames": frames,
        "events": len(sequence.events(start_us - 1, stop_us).t), "disparity_mm": round((x_mm**2 + y_mm**2) ** 0.5, 3),
        "size": list(sequence.size),
    }  # fmt: skip


def _facts(job: dict[str, Any], spec: DatasetSpec, made: list[Made], unusable: dict[str, str]) -> dict[str, Any]:
    whole, left_out = (
        [each for each in made if not each.failed],
        {each.name: each.failed for each in made if each.failed} | unusable,
    )
    if not whole:
        name, reason = next(iter(left_out.items()), ("none", "nothing was asked for"))
        raise DataError(f"no scene could be made; the first, {name}: {reason}")
    rates = {"cis_fps": spec.cis_fps, "interpolated_fps": spec.cis_fps * spec.multiple}
    sums = {key: sum(each.facts[key] for each in whole) for key in ("samples", "events")}
    disparity = max(each.facts["disparity_mm"] for each in whole)
    scenes = {each.name: each.facts for each in whole}
    return (
        job
        | {"scenes": len(whole)}
        | rates
        | sums
        | {"disparity_mm": disparity, "of_scenes": scenes, "left_out": left_out}
    )


def _publish(made_in: Path, directory: Path, facts: dict[str, Any]) -> None:
    """Put a finished data set in its place, at once."""
    for begun in (made_in / "parts", *made_in.glob("*.partial")):  # (of scenes left out, or killed as they were done)
        shutil.rmtree(begun, ignore_errors=True)
    for name, text in ((FACTS, json.dumps(facts, indent=2)), ("README.md", card_text(facts))):
        with whole_file(made_in / name) as file:
            file.write(f"{text.rstrip()}\n".encode())
    (made_in / "job.json").unlink(missing_ok=True)
    (made_in / LOCK).unlink(missing_ok=True)
    made_in.rename(directory)
    sync(directory.absolute().parent)


def _begin(path: Path, job: dict[str, Any], directory: Path) -> None:
    """Note what is made; what was begun must be the same."""
    if not path.exists() and (path.parent / FACTS).exists():  # (killed just before all was put in its place)
        path = path.parent / FACTS
    if path.exists():
        earlier = read_manifest(path)
        if changed := difference({key: earlier.get(key) for key in job}, job):
            raise UsageError(f"{directory} was begun with {changed}; --resume needs the options it was begun with")
        return
    with whole_file(path) as file:
        file.write(json.dumps(job, indent=2).encode())


def _finished(directory: Path, job: dict[str, Any], resume: bool) -> dict[str, Any]:
    """The facts of a data set that is there."""
    if not resume:
        raise UsageError(f"{directory} exists; choose another folder, or remove it")
    path = directory / FACTS
    facts = read_manifest(path) if path.is_file() else {}
    if changed := difference({key: facts.get(key) for key in job}, job):
        raise UsageError(f"{directory} is another data set ({changed}); choose another folder")
    return facts
