"""`convert`: the whole path, from a video to the folder of its recording."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import BLOCK, Recording
from vid2ev.outputs import Outputs
from vid2ev.recipe import Recipe
from vid2ev.recording.disk import write_npz
from vid2ev.recording.folder import Folder, begun_job
from vid2ev.recording.manifest import machine, write_manifest
from vid2ev.recording.preview import Preview
from vid2ev.recording.probe import HEADER, Probe, plot
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame

PIECE = 1 << 32  # pixel-steps between two checkpoints: seconds of work, whatever the size of the frames
FRAME_US, PROBE = "frame_us", "probe.csv"  # files that grow: the instants of the frames, the pixels that are probed
STEP = 1 << 18  # what a step counts for at least, as a small frame takes its time too


@dataclass
class Progress:
    """How far a conversion is."""

    frames: int = 0  # of the source
    subframes: int = 0  # made between them
    limited: int = 0  # source intervals that hit max_subframes
    events: int = 0
    start_ns: int = 0  # the first frame
    end_ns: int = 0  # the last frame
    last_us: int = 0  # the last event
    cuts_us: list[int] = field(default_factory=list)  # the first frames of new shots
    seconds: float = 0.0  # of work, in all runs
    finished: bool = False
    warnings: list[str] = field(default_factory=list)

    def add(self, frame: Frame, events: Events) -> None:
        """Count a frame and the events up to it."""
        self.frames += frame.original
        self.subframes += not frame.original
        self.end_ns = frame.t_ns
        self.cuts_us += [frame.t_ns // 1000] * frame.cut
        self.count(events)

    def count(self, events: Events) -> None:
        """Count events."""
        self.events += len(events)
        self.last_us = int(events.t[-1]) if len(events) else self.last_us

    @property
    def offset_us(self) -> int:
        """The instant from which an event file counts: the first frame."""
        return self.start_ns // 1000

    @property
    def duration_us(self) -> int:
        """From the first frame to the last, or to the last event where the sensor's readout makes it later."""
        return max(self.end_ns // 1000, self.last_us) - self.offset_us


Report = Callable[[Recipe, Progress], object]


def convert(
    video: str | Path,
    directory: str | Path | None = None,
    sensor: str | Path | DvsSpec = "paper",
    overrides: Sequence[str] = (),
    *,
    seed: int | None = 0,
    threads: int | None = None,
    overwrite: bool = False,
    resume: bool = False,
    report: Report | None = None,
    piece: int = PIECE,
    **rest: Any,
) -> dict[str, Any]:
    """Make the recording of a video: the folder `directory`, or NAME_events in the current one.

    seed       of the sensor; None draws one
    threads    of the sensor; by default as many as there are cores.  They change nothing but the time it takes
    overwrite  replace a recording that is there, when the new one is whole
    resume     go on where an interrupted conversion was; a finished one is left as it is
    report     called at every source frame; if it returns True, the recording ends there
    piece      pixel-steps between two checkpoints
    What is written is said by the fields of `Outputs`: formats, preview, frames, frames_by, frames_as.  Everything else
    is as for `Recipe.of`.

    Returns the manifest.  The same recipe makes the same bytes in events.h5, with or without interruptions.
    Raises UsageError for what cannot be meant, DataError for a source that cannot be read or a folder that cannot
    be written.
    """
    directory = default_directory(video) if directory is None else Path(directory)
    if seed is None:
        seed = (begun_job(directory) if resume else {}).get("seed", secrets.randbits(32))
    outputs = Outputs.of(**Outputs.taken_from(rest))
    recipe = Recipe.of(video, sensor, overrides, seed=seed, **rest)
    outputs.check(recipe.source.size, expected_us(recipe))
    if resume and not recipe.source.rewindable:
        raise UsageError(f"{video} passes once and cannot be taken up again; leave --resume out")
    job = recipe.describe() | {"outputs": outputs.describe()}
    growing = [FRAME_US, *[PROBE] * bool(outputs.probe)]
    with Folder(directory, job, labels=recipe.labels, overwrite=overwrite, resume=resume, growing=growing) as folder:
        if folder.finished:
            return folder.finished
        threads = threads or usable_cores()
        dvs = recipe.dvs(threads)
        film = Preview(recipe.source.size, folder.partial, wanted=outputs.preview)
        probe = Probe(outputs.probe, recipe.source.size[0]) if outputs.probe else None
        done = _record(recipe, dvs, film, probe, folder, piece, report)
        manifest = job | _outcome(done, dvs) | {"run": _run(video, threads, done)}
        with folder.writing():
            outputs.write(folder.whole, _recording(folder, recipe, done, outputs.want_frames))
            film.join(folder.whole / "preview.mp4")
            if probe:
                shutil.copyfile(folder.written(PROBE), folder.whole / PROBE)
                plot(folder.whole / PROBE, folder.whole / "probe.png")
            if outputs.noise_maps:
                write_npz(folder.whole / "noise_maps.npz", dvs.maps())
            write_manifest(folder.whole / "manifest.json", manifest)
            folder.publish()
    return manifest


def default_directory(video: str | Path) -> Path:
    """Where the recording of a video goes if nothing else is said."""
    if str(video) == "-" or str(video).startswith("camera:"):
        return Path("stdin_events" if str(video) == "-" else f"{str(video).replace(':', '')}_events")
    path = Path(os.path.abspath(str(video).removeprefix("synthetic:").partition(",")[0]))
    return Path(f"{path.name if path.is_dir() else path.stem}_events")


def usable_cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def expected_us(recipe: Recipe) -> int | None:
    """How long the recording should become, if there is any telling."""
    seconds = recipe.source.duration_expected_s
    return None if seconds is None else round(1e6 * seconds)


def _record(
    recipe: Recipe, dvs: Dvs, film: Preview, probe: Probe | None, folder: Folder, piece: int, report: Report | None
) -> Progress:
    """Events and preview into the folder, from its last checkpoint to the end of the source."""
    done = _take_up(folder, dvs, film)
    if done.finished:
        return done
    began, limited_before, work = time.monotonic() - done.seconds, done.limited, 0
    with closing(recipe.light(max(done.frames - 1, 0))) as light:
        first = next(light, None)
        if first is None:
            raise DataError(f"{recipe.video} has no frames; give a source that has some")
        film.begin(first[0])
        if not done.frames:
            dvs.step(first[0].light, first[0].t_ns)
            done.frames, done.start_ns, done.end_ns = 1, first[0].t_ns, first[0].t_ns
            _note(folder, first[0])
            if probe:
                folder.write(PROBE, HEADER + probe.lines(first[0], Events.empty(), dvs.inside(probe.places)))
        for frame, limited in light:
            events = dvs.see(frame)
            with folder.writing():
                folder.append(events)
                film.add(frame, events)
                _note(folder, frame)
                if probe:
                    folder.write(PROBE, probe.lines(frame, events, dvs.inside(probe.places)))
            done.add(frame, events)
            done.limited, done.seconds = limited_before + limited, time.monotonic() - began
            work += max(STEP, frame.light.size)
            if frame.original and report and report(recipe, done) is True:
                done.warnings.append(f"ended by hand after {done.frames} frames")
                break
            if frame.original and work >= piece:
                _checkpoint(folder, dvs, film, done)
                work = 0
    held_back = dvs.flush()
    with folder.writing():
        folder.append(held_back)
        film.finish(held_back)
        if probe:
            folder.write(PROBE, "".join(probe.event_lines(held_back)).encode())
    done.count(held_back)
    done.finished, done.warnings = True, [*done.warnings, *recipe.source.warnings]
    _checkpoint(folder, dvs, film, done)
    return done


def _note(folder: Folder, frame: Frame) -> None:
    """Note the instant of a frame of the source."""
    if frame.original:
        folder.write(FRAME_US, np.int64(frame.t_ns // 1000).tobytes())


def _take_up(folder: Folder, dvs: Dvs, film: Preview) -> Progress:
    """Bring everything to the point of the last checkpoint."""
    saved = folder.saved()
    if not saved:
        return Progress()
    dvs.restore({name.removeprefix("dvs."): array for name, array in saved.items() if name.startswith("dvs.")})
    film.restore({name.removeprefix("film."): array for name, array in saved.items() if name.startswith("film.")})
    return Progress(**json.loads(str(saved["progress"])))


def _checkpoint(folder: Folder, dvs: Dvs, film: Preview, done: Progress) -> None:
    with folder.writing():
        film.close()
        state = {f"dvs.{name}": array for name, array in dvs.state().items()}
        state |= {f"film.{name}": array for name, array in film.state().items()}
        folder.checkpoint(state | {"progress": np.array(json.dumps(asdict(done)))})


def _recording(folder: Folder, recipe: Recipe, done: Progress, want_frames: bool) -> Recording:
    """What event files are written from."""
    return Recording(
        recipe.source.size,
        done.offset_us,
        done.duration_us,
        done.events,
        lambda: folder.events(BLOCK),
        recipe.labels,
        recipe.pictures if want_frames and recipe.source.rewindable else None,
        np.fromfile(folder.written(FRAME_US), np.int64),
    )


def _outcome(done: Progress, dvs: Dvs) -> dict[str, Any]:
    """What came out, for the manifest."""
    counts = {"frames": done.frames, "subframes": done.subframes, "limited_intervals": done.limited}
    return {
        "start_us": done.offset_us,
        "duration_us": done.duration_us,
        "counts": counts | {"events": done.events} | dvs.counts,
        "cuts_us": done.cuts_us,
        "warnings": done.warnings + _remarks(done, dvs),
    }


def _remarks(done: Progress, dvs: Dvs) -> list[str]:
    """What a person should know about the result."""
    counts = dvs.counts
    remarks = []
    if done.frames == 1:
        remarks.append("one frame only: nothing changes, so there are no events")
    if done.cuts_us:
        remarks.append(
            f"{len(done.cuts_us)} cuts: the sensor started afresh after each; --cuts keep takes them for steps of light"
        )
    if done.limited:
        remarks.append(
            f"{done.limited} of {done.frames - 1} intervals asked for more sub-frames than --max-subframes allows"
        )
    if counts["capped"]:
        remarks.append(
            f"{counts['capped']} times a pixel had more than max_crossings = {dvs.spec.max_crossings} crossings"
            " from frame to frame; the rest is missing"
        )
    if counts["not_finite"]:
        remarks.append(
            f"{counts['not_finite']} values of light were negative, not finite or beyond 1e30; they count as 0 or 1e30"
        )
    return remarks


def _run(video: str | Path, threads: int, done: Progress) -> dict[str, Any]:
    """When, where and how fast, for the manifest."""
    return {
        "ended": datetime.now(UTC).isoformat(timespec="seconds"),
        "video": str(video),
        "seconds": round(done.seconds, 3),
        "threads": threads,
        "machine": machine(),
    }
