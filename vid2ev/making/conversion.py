"""`convert`: the whole path, from a video to the folder of its recording."""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from vid2ev.cluster.task import share_of
from vid2ev.cores import usable_cores
from vid2ev.errors import DataError, UsageError, check_names
from vid2ev.plan.plan import TOLERANCE, Plan, check_tolerance
from vid2ev.plan.planner import Planner
from vid2ev.plan.recordings import described, planned
from vid2ev.recording.folder import Folder, begun_job, check_free
from vid2ev.recording.manifest import machine, write_manifest
from vid2ev.requests import is_whole
from vid2ev.seen.instants import instants
from vid2ev.seen.recipe import Recipe, plain
from vid2ev.seen.sight import scene_of
from vid2ev.sensors.devices import device_for
from vid2ev.sensors.limits import check_threads
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import WHOLE, Part
from vid2ev.sources import begins_s, short_name
from vid2ev.terminal import counted
from vid2ev.tracks.outputs import Outputs
from vid2ev.tracks.parts import Made
from vid2ev.tracks.recorder import Progress, Recorder, growing, progress_of

PIECE = 1 << 32  # pixel-steps between two checkpoints: seconds of work, whatever the size of the frames
STEP = 1 << 18  # what a step counts for at least, as a small frame takes its time too


Report = Callable[[Recipe, Progress], object]


class Paused(Exception):
    """A conversion was stopped at a checkpoint, as asked for; `resume` goes on from there."""


@dataclass(frozen=True)
class _Course:
    """How a recording is to be made, whatever is in it; see `convert`."""

    piece: int
    report: Report | None
    since_ns: int | None
    pause: Callable[[], bool] | None


def convert(
    video: str | Path,
    directory: str | Path | None = None,
    sensor: str | Path | DvsSpec = "paper",
    overrides: Sequence[str] = (),
    *,
    seed: int | None = 0,
    threads: int | None = None,
    skip: bool = True,
    overwrite: bool = False,
    resume: bool = False,
    report: Report | None = None,
    piece: int = PIECE,
    effects: str | Sequence[str] = "all",
    tolerance: float = TOLERANCE,
    notes: Mapping[str, Any] | None = None,
    device: str = "cpu",
    part: Part = WHOLE,
    events_only: bool = False,
    since_ns: int | None = None,
    made: Made | None = None,
    pause: Callable[[], bool] | None = None,
    **rest: Any,
) -> dict[str, Any]:
    """Make the recording of a video: the folder `directory`, or NAME_events in the current one.

    seed       of the sensor; None draws one
    threads    of views, pictures of scenes and sensors; by default as many as there are cores.  They change nothing but
               the time it takes
    skip       let strips of pixels sleep in which nothing can happen, and keep what cannot have changed of a scene's
               picture; changes nothing but the time it takes
    overwrite  replace a recording that is there, when the new one is whole
    resume     go on where an interrupted conversion was; a finished one is left as it is
    report     called at every source frame; if it returns True, the recording ends there
    piece      pixel-steps between two checkpoints
    effects    those to simulate: all, auto (what the clip calls for, by bounds within `tolerance`; `plan.planner` has
               what it takes), none, or names
    notes      what else the manifest is to say, ready for JSON
    device     where light and events are made: cpu, cuda (a GPU; the CPU where there is none), or auto, by how much
               there is to do (`sensors.devices`); "simulated" is for tests.  Light differs by what float32 rounds
    part       pixels of the event cameras that are simulated; `split` puts the recordings of all parts together
    events_only  leave out frame cameras and truth: of a part only the events are used
    since_ns   the instant that the recording begins with; what is seen before it only warms event cameras (not with
               effects "auto", which would have to look at it)
    made       the events of all parts, which are then not simulated
    pause      asked at every checkpoint: whether to raise `Paused`, for `resume` to go on from there
    What is written is said by the fields of `Outputs` (formats, preview, frames, ...).  Everything else is as for
    `Recipe.of`.

    Returns the manifest.  The same recipe makes the same bytes in events.h5, with or without interruptions.
    Raises UsageError for what cannot be meant, DataError for a source that cannot be read or a folder that cannot
    be written.
    """
    check_names(rest, Outputs.options() + Recipe.options())
    directory = default_directory(video) if directory is None else Path(directory)
    check_threads(threads := usable_cores() if threads is None else threads)
    check_tolerance(tolerance)
    if not is_whole(piece, 1):
        raise UsageError(f"piece {piece!r}: expected a whole number of pixel-steps, of at least 1; leave it out")
    if seed is None:
        seed = begun_seed(directory, resume, secrets.randbits(32))
    outputs = Outputs.of(**Outputs.taken_from(rest))
    check_free(directory, overwrite, resume, video)  # (before the source is opened, which may take long)
    recipe = Recipe.of(video, sensor, overrides, seed=seed, **rest)
    check_outputs(recipe, outputs)
    where = device_for(device, recipe.work, threads)
    if scene := scene_of(recipe.source):
        scene.world.afresh, scene.memory = not skip, where.memory
    if effects == "auto" and since_ns is not None:
        raise UsageError("effects auto of a recording that begins after its light, which is not looked at; name them")
    planner = Planner(recipe, tolerance, threads, where) if effects == "auto" else None
    recipe, plans = (recipe, {}) if planner else planned(recipe, effects, tolerance)
    if resume:
        check_twice(recipe)
    whole = {"part_of": recipe.describe()} if events_only else {}  # (whose instants may suit frame cameras)
    recipe = recipe.of_events() if events_only else recipe
    job = whole | job_of(recipe, outputs, tolerance if planner else None, plans, notes)
    job |= {} if part == WHOLE else {"part": list(part)}
    job |= {} if since_ns is None else {"since_ns": since_ns}
    beside = growing(recipe, outputs)
    with Folder(directory, job, overwrite=overwrite, resume=resume, growing=beside) as folder:
        if folder.finished:
            return folder.finished
        make = partial(
            Recorder, outputs=outputs, folder=folder, threads=threads, skip=skip, device=where, part=part, made=made
        )
        recorder = _recorded(recipe, planner, folder, make, _Course(piece, report, since_ns, pause))
        said = described(planner.plans if planner else plans)
        with folder.writing():
            began = time.monotonic() - recorder.done.seconds
            recorder.write(folder.whole)
            recorder.done.seconds = time.monotonic() - began
            manifests = _manifests(job | recorder.recipe.describe() | said, recorder, _run(video, threads, recorder))
            for within, manifest in manifests.items():
                write_manifest(folder.whole / within / "manifest.json", manifest)
            folder.publish()
    return manifests[""]


def telling(tell: Callable[[Mapping[str, Any]], object]) -> Report:
    """A `report` for `convert` that tells what a live line of tasks wants to know: events, and the share of frames."""

    def report(recipe: Recipe, done: Progress) -> None:
        tell({"events": done.events} | share_of(done.frames, recipe.source.frames_expected))

    return report


def default_directory(video: str | Path) -> Path:
    """Where the recording of a video goes if nothing else is said."""
    return Path(f"{short_name(str(video))}_events")


def begun_seed(directory: Path, resume: bool, drawn: Any) -> Any:
    """The seed of a recording that is given none: that of what is there if it goes on, or else what was drawn."""
    return (begun_job(directory) if resume else {}).get("seed", drawn)


def check_twice(recipe: Recipe) -> None:
    """Raise UsageError for a source that cannot be read again, as one has to be to go on."""
    if not recipe.source.rewindable:
        raise UsageError(f"{recipe.video} passes once and cannot be taken up again; leave --resume out")


def check_outputs(recipe: Recipe, outputs: Outputs) -> None:
    """Raise UsageError where a format cannot hold what a camera may send, or a probed pixel is not there."""
    source = recipe.source
    if recipe.labels and all("labels" not in kind.keeps for kind in outputs.kinds()):
        raise UsageError(
            f"labels with format {', '.join(outputs.formats)}: expected one that holds them; add hdf5, npz or csv, or"
            " leave them out"
        )
    if outputs.pictures != Outputs().pictures and all(mount.kind == "dvs" for mount in recipe.mounts):
        raise UsageError(f"pictures as {', '.join(outputs.pictures)}: expected a frame camera; add --frames or --cis")
    of_events: dict[str, Any] = {"bayer": recipe.bayer, "labels": recipe.labels, "frames of events": outputs.frames}
    of_events |= {"probe": outputs.probe, "noise_maps": outputs.noise_maps}
    of_events |= {f"format {', '.join(outputs.formats)}": outputs.formats != Outputs().formats}
    asked = next((name for name, value in of_events.items() if value), None)
    if asked and all(mount.kind == "cis" for mount in recipe.mounts):
        raise UsageError(f"{asked} without an event camera: expected one in the rig; add one, or leave {asked} out")
    # (To ask for its first instant opens a source once more; those that pass once are asked when they begin.)
    known = outputs.by_the_clock and source.rewindable
    _check_cameras(recipe, outputs, round(1e9 * begins_s(source)) if known else None)


def _check_cameras(recipe: Recipe, outputs: Outputs, begin_ns: int | None) -> None:
    """Raise UsageError where a format cannot hold what event cameras may send of a source that begins then."""
    seconds = recipe.source.duration_expected_s
    duration_us = None if seconds is None else round(1e6 * seconds)
    for mount in recipe.mounts:
        if mount.kind == "dvs":
            start_us = None if begin_ns is None else begin_ns // 1000 + mount.clock_offset_us
            outputs.check(mount.size, duration_us, start_us)


def _manifests(job: dict[str, Any], recorder: Recorder, run: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The manifest of the recording, "", and of a rig that of each camera, by its part of the folder."""
    recipe = recorder.recipe
    if recipe.alone:
        return {"": job | recorder.outcome(0) | {"run": run}}
    outcomes = {mount: recorder.outcome(place) for place, mount in enumerate(recipe.mounts)}
    common, plans = {"outputs": job["outputs"]}, job.get("plan", {})
    own = {mount.name: {"plan": {mount.name: plans[mount.name]}} if plans else {} for mount in recipe.mounts}
    manifests = {
        mount.within: recipe.describe_camera(mount) | common | own[mount.name] | outcome | {"run": run}
        for mount, outcome in outcomes.items()
    }
    results = {mount.name: outcome for mount, outcome in outcomes.items()}
    return {"": job | {"results": results, "run": run}, **manifests}


def job_of(
    recipe: Recipe,
    outputs: Outputs,
    tolerance: float | None,
    plans: Mapping[str, Plan],
    notes: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What decides a recording, as JSON; where effects are chosen by its light, within a tolerance, the sensors as they
    were before."""
    said = recipe.describe() | described(plans)
    if tolerance is not None:
        sensors = {key: said.pop(key) for key in ("sensor", "cameras") if key in said}
        said |= {"asked": {"effects": "auto", "tolerance": tolerance} | sensors}
    return said | {"outputs": outputs.describe()} | plain({**(notes or {})})


def _recorded(
    recipe: Recipe,
    planner: Planner | None,
    folder: Folder,
    make: Callable[[Recipe], Recorder],
    course: _Course,
) -> Recorder:
    """A recording made to its end, from the last checkpoint on, or by new plans from the beginning."""
    began = time.monotonic()
    if planner:
        done = progress_of(folder)
        planner.begin(done.looked, done.ended)
        recipe = planner.left
    recorder = make(recipe)
    recorder.take_up()
    began -= recorder.done.seconds
    while not recorder.done.finished and not _record(recorder, planner, course, began):
        assert planner
        recorder.give_up()
        if recorder.done.by_hand:
            course = replace(course, report=partial(_ends, recorder.done.frames))
        recorder = make(planner.left)
    return recorder


def _ends(frames: int, _: Recipe, done: Progress) -> bool:
    """Whether a recording ends again where it was ended by hand."""
    return done.frames >= frames


def _record(recorder: Recorder, planner: Planner | None, course: _Course, began: float) -> bool:
    """From the point of the last checkpoint to the end of the source; returns False where there are new plans.  Work
    on it `began` [s of the monotonic clock], with that of earlier runs."""
    recipe, done = recorder.recipe, recorder.done
    limited_before, work = done.limited, 0
    coming = (
        planner.instants
        if planner
        else partial(instants, recorder.seen, device=recorder.device, threads=recorder.threads)
    )
    with closing(coming(done.warmed + max(done.frames - 1, 0))) as seen:
        first = next(seen, None)
        while first and not done.frames and course.since_ns is not None and first.t_ns < course.since_ns:
            recorder.warm(first)
            first = next(seen, None)
        if first is None:
            raise DataError(f"{recipe.video} has no frames; give a source that has some")
        _check_cameras(recipe, recorder.outputs, done.start_ns if done.frames else first.t_ns)
        recorder.begin(first)
        limited_before -= first.limited
        for instant in seen:
            if planner and planner.see(instant, done.frames + done.subframes):
                return False
            recorder.add(instant)
            done.limited, done.seconds = limited_before + instant.limited, time.monotonic() - began
            work += max(STEP, sum(math.prod(frame.light.shape) for frame in instant.frames))
            if instant.original and course.report and course.report(recipe, done) is True:
                done.by_hand = True
                done.warnings.append(f"ended by hand after {counted(done.frames, 'frame')}")
                break
            if instant.original and work >= course.piece:
                done.looked, done.ended = (planner.looked, planner.ended) if planner else (0, False)
                recorder.checkpoint()
                work = 0
                if course.pause and course.pause():
                    raise Paused(recipe.video)
    done.warnings += recipe.source.warnings
    if planner:
        if planner.finish():
            return False
        done.looked, done.ended = planner.looked, True
    recorder.finish()
    done.seconds = time.monotonic() - began
    return True


def _run(video: str | Path, threads: int, recorder: Recorder) -> dict[str, Any]:
    """When, where and how fast, for the manifest."""
    return {
        "ended": datetime.now(UTC).isoformat(timespec="seconds"),
        "video": str(video),
        "seconds": round(recorder.done.seconds, 3),
        "threads": threads,
        "device": recorder.device.describe(),
        "strips_slept": recorder.slept(),
        "machine": machine(),
    }
