"""`reconstruct`: from an event file to pictures of what the camera saw, in a film or a folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import torch

from interp import pretrained
from interp.interpolate.choice import device_of
from interp.interpolate.destination import kind_of, manifest_of, places_of
from interp.interpolate.instants import Number, parse_number
from interp.interpolate.pictures import Pictures, checked_play
from interp.interpolate.sensor import sensor_of
from interp.interpolate.shelf import Shelf
from interp.interpolate.take import check_contrast, check_second
from interp.reconstruct.high_pass import CUTOFF_HZ, HighPass
from interp.reconstruct.made_good import MadeGood
from interp.reconstruct.of_network import OfNetwork
from interp.reconstruct.reconstructor import Reconstructor
from interp.representation.dead_time import stated
from interp.representation.event_counts import USUAL_NATS
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import of_only_camera, open_events
from vid2ev.formats.event_file import EventFile, Recording
from vid2ev.pictures.film import SLOWEST_HZ, rate_of_film
from vid2ev.recording.manifest import identity, machine, sha256, versions
from vid2ev.requests import is_whole
from vid2ev.views.slices import Count, Duration, Slicing
from vid2ev.views.window import beginning_us, window

Report = Callable[[int, int | None], object]  # events taken in, of how many
FPS = 30
AT_ONCE = 16  # pictures between two instants from which it can go on


@dataclass(frozen=True, slots=True)
class Seen:
    """A slice that is taken in: its end, and how many events there were so far."""

    stop_us: int
    events: int


def reconstruct(
    events: str | Path,
    output: str | Path,
    *,
    network: str | Path | None = None,
    cutoff_hz: float | None = None,
    fps: Number | None = None,
    events_per_frame: int | None = None,
    format: str | None = None,
    play: Number | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    contrast: tuple[float, float] | None = None,
    refractory_us: float | None = None,
    device: str = "cpu",
    overwrite: bool = False,
    resume: bool = False,
    report: Report | None = None,
    told: Callable[[str], object] | None = None,
) -> dict[str, Any]:
    """Make pictures of what an event camera saw, from its events alone; returns the manifest.

    events      any event file that vid2ev reads, or the folder of an event camera's recording, or of a rig's with one
                event camera
    output      a film, if its name ends in .mp4, or a folder of pictures with timestamps.txt
    network     weights (`interp.pretrained.path_of`) of E2VID or FireNet; by default those that come with vid2ev, if
                any do, or else a high-pass
                filter, which `cutoff_hz` asks for, too (`high_pass.py`)
    fps         pictures per second, 30 by default; or `events_per_frame`, which are more where that many fall into one
                microsecond, of which there is one picture
    play        pictures per second of the film; by default in real time, or 30 where pictures are of so many events
    start_s, stop_s   the part to take [s after the beginning]; nothing is known of what was before
    contrast    what an OFF and an ON event stand for [nat]; by default what the recording says, or else 0.15
    refractory_us   how long a pixel is blind after an event, by default what the recording says; 0 for not at all.
                What it missed then is made good (`made_good.py`)
    resume      go on where an interrupted run was, on the same kind of device, to the same bytes
    report      told how many events were taken in, of how many

    All of the file is read in blocks; memory depends on the sensor's size alone; with `events_per_frame` on that, and
    where dead time is made good on the events of a picture.
    Raises UsageError for requests that cannot be meant, DataError for what cannot be read or written.
    """
    output, path = Path(output), of_only_camera(events)
    kind, slicing = kind_of(output, format), _slicing(fps, events_per_frame)
    check_contrast(contrast)
    file, recording = _window(path, start_s, stop_s)
    size = recording.size
    sensor = sensor_of(path, contrast, refractory_us)
    stands_for = sensor.contrast or (USUAL_NATS, USUAL_NATS)
    where = device_of(device)
    plain, why, about = _choice(network, cutoff_hz, size, stands_for, where)
    made_by = MadeGood(plain, sensor.dead_time, size) if sensor.dead_time else plain
    rate = checked_play(play, kind) or (
        Fraction(FPS) if isinstance(slicing, Count) else rate_of_film(10**6 / slicing.us)
    )
    pictures = Pictures(kind, 8, "srgb")
    job = {
        "versions": versions(("torch",)),
        "source": {
            "path": str(path),
            "size": list(size),
            "identity": identity(path, besides=places_of(output, kind)),
            "contrast": list(stands_for),
            "dead_time": stated(sensor.dead_time),
        },
        "part": {"start_s": start_s, "stop_s": stop_s},
        "pictures": str(slicing),
        "reconstruction": about,
        "format": pictures.describe(),
        "transfer": pictures.curve,
        "film_rate": str(rate) if kind == "mp4" else None,
    }
    with Shelf(output, kind, job, rate, overwrite=overwrite, resume=resume, write=pictures.write) as shelf:
        if shelf.finished:
            return shelf.finished
        if told:
            told(f"{made_by.name}: {why}")
        started, there = time.perf_counter(), shelf.count
        _make(shelf, made_by, recording, slicing, pictures, report)
        seconds = time.perf_counter() - started
        manifest = shelf.job | {
            "frames": shelf.count,
            "events": recording.count,
            "size": list(shelf.size_of(size)),
            "start_us": recording.start_us,
            "stop_us": shelf.done[-1]["t_us"][-1],
            "remarks": [*_remarks(path, file, recording), *shelf.remarks_on(size)],
            "manifest": str(manifest_of(output, kind)),
            "run": {"seconds": round(seconds, 3), "frames": shelf.count - there, "machine": machine()},
        }
        shelf.publish(manifest)
    return manifest


def slices(made_by: Reconstructor, recording: Recording, slicing: Slicing, skip: int = 0) -> Iterator[Seen]:
    """Take in a recording, slice by slice; the first `skip` slices are only counted.

    Slices that end within one microsecond are one: pictures have times, and each is after the one before.
    """
    number, count, start_us, seen = 0, 0, recording.start_us, None
    for piece in slicing.pieces(recording):
        if seen and piece.stop_us > seen.stop_us:
            if number >= skip:
                yield seen
            number, start_us = number + 1, piece.start_us
        count += len(piece.events)
        seen = Seen(piece.stop_us, count)
        if number >= skip:
            made_by.add(piece.events, start_us, piece.stop_us)
    if seen and number >= skip:
        yield seen


def _make(
    shelf: Shelf,
    made_by: Reconstructor,
    recording: Recording,
    slicing: Slicing,
    pictures: Pictures,
    report: Report | None,
) -> None:
    """Make what is not there yet."""
    if shelf.done:
        with shelf.remembering():
            made_by.remember(shelf.memory())
    times: list[int] = []
    number = shelf.count
    for seen in slices(made_by, recording, slicing, skip=shelf.count):
        light = made_by.picture(seen.stop_us)
        with shelf.writing():
            shelf.put(number, pictures.of_light(light))
            times.append(seen.stop_us)
            number += 1
            if len(times) == AT_ONCE:
                shelf.stretch({"t_us": times}, made_by.memory())
                times = []
        if report:
            report(seen.events, recording.count)
    if times:
        with shelf.writing():
            shelf.stretch({"t_us": times}, made_by.memory())


def _slicing(fps: Number | None, events_per_frame: int | None) -> Duration | Count:
    if events_per_frame is not None:
        if fps is not None:
            raise UsageError(f"--fps {fps} and --events-per-frame {events_per_frame}: leave out one of them")
        if not is_whole(events_per_frame, 1):
            raise UsageError(f"--events-per-frame {events_per_frame}: expected at least 1, such as 20000")
        return Count(events_per_frame)
    rate = parse_number(FPS if fps is None else fps, "--fps")
    if not SLOWEST_HZ <= rate <= 10**5:
        raise UsageError(f"--fps {fps}: expected from {float(SLOWEST_HZ):g} to 100000 pictures per second")
    return Duration(10**6 / rate)


def _window(path: Path, start_s: float | None, stop_s: float | None) -> tuple[EventFile, Recording]:
    """The file, and the part of it."""
    check_second(start_s, "--start")
    check_second(stop_s, "--stop")
    if start_s is not None and stop_s is not None and stop_s <= start_s:
        raise UsageError(f"--stop {stop_s:g} is not after --start {start_s:g}; choose a later one")
    file = open_events(path)
    zero_us = beginning_us(file)
    start_us, stop_us = (None if second is None else zero_us + round(second * 1e6) for second in (start_s, stop_s))
    recording = window(file, zero_us if start_us is None else start_us, stop_us)
    if not recording.count and start_s is None and stop_s is None:
        raise DataError(f"{path} holds no events, of which pictures are made; give another file")
    if not recording.count:
        stop = "on" if stop_s is None else f"to {stop_s:g} s"
        raise UsageError(f"{path}: no events from {start_s or 0:g} s {stop}; choose another part")
    return file, recording


def _remarks(path: Path, file: EventFile, recording: Recording) -> list[str]:
    """What the file does not say, and what is wrong with it."""
    across, down = recording.size
    guessed = f"{path} does not state the size of its sensor, taken for {across}x{down}, which holds all events"
    return [*[guessed] * (file.size is None), *(f"{path}: {text}" for text in dict.fromkeys(file.warnings))]


def _choice(
    network: str | Path | None,
    cutoff_hz: float | None,
    size: tuple[int, int],
    contrast: tuple[float, float],
    device: torch.device,
) -> tuple[Reconstructor, str, dict[str, Any]]:
    """What makes the pictures, why, and what it is, for JSON."""
    if network and cutoff_hz is not None:
        raise UsageError(f"--network {network} and --cutoff {cutoff_hz:g}: leave out one of them")
    asked = network or cutoff_hz is not None
    path = pretrained.path_of(network) if network else None if asked else pretrained.first(pretrained.OF_EVENTS)
    made_by: Reconstructor
    about: dict[str, Any]
    if path:
        why = "as asked" if asked else "the network that comes with vid2ev"
        made_by = OfNetwork(path, size, contrast, device)
        about = {"network": str(path), "sha256": sha256(path), "device": device.type}
    else:
        why = "as asked" if asked else "the best that needs no training"
        cutoff = CUTOFF_HZ if cutoff_hz is None else cutoff_hz
        made_by, about = HighPass(size, contrast, cutoff), {"filter": "high-pass", "cutoff_hz": cutoff}
    return made_by, why, about
