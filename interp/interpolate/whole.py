"""`interpolate`: from a recording or a video to its frames at more instants, in a film or a folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch

from interp import pretrained
from interp.interpolate.after import After
from interp.interpolate.choice import FALLBACK, choice, choice_of_one, device_of
from interp.interpolate.destination import kind_of, manifest_of, places_of
from interp.interpolate.fill import NO_EVENTS, Fill, Filled
from interp.interpolate.instants import Grid, Number, Rate, Times, parse_number
from interp.interpolate.of_sequence import OfSequence
from interp.interpolate.of_still import OfStill
from interp.interpolate.pictures import Pictures, film_rate
from interp.interpolate.shelf import Shelf
from interp.interpolate.stretches import Stretch, stretches
from interp.interpolate.take import AS_IT_IS, Options, Take, open_take
from interp.methods import open_method
from interp.methods.running import PLAIN, Running
from interp.methods.tiling import tiling_of
from interp.representation.carried import footprint_of
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.destination import check_apart
from vid2ev.recording.manifest import machine, versions

Report = Callable[[int, int | None], object]  # frames done, of how many
MULTIPLE = 8
UNEVEN = 1.05  # times the shortest gap is the longest of frames at a constant rate
CLOCK_US = 1000  # what Matroska, ASF and FLV round times to
LINE = {"key_us": int, "remark": str, "shot": int}  # of each stretch


def interpolate(
    source: str | Path,
    output: str | Path,
    *,
    multiple: Number | None = None,
    fps: Number | None = None,
    method: str | None = None,
    network: str | Path | None = None,
    hdr: str | Path | None = None,
    format: str | None = None,
    play: Number | None = None,
    tile: str = "auto",
    cuts: str = "hold",
    device: str = "cpu",
    running: Running = PLAIN,
    options: Options = AS_IT_IS,
    overwrite: bool = False,
    resume: bool = False,
    report: Report | None = None,
    told: Callable[[str], object] | None = None,
) -> dict[str, Any]:
    """Make the frames of a recording or a video at more instants; returns the manifest.

    source     a recording of `vid2ev convert`, in the HS-ERGB or BS-ERGB layout, an event file with frames, a video or
               a folder of images, with the events of `options.events` or without; or a single frame with events
    output     a film, if its name ends in .mp4, or a folder of pictures with timestamps.txt
    multiple   so many times the frames, 8 by default; or `fps`, frames per second of the world's time
    method, network   a name of `interp.methods.METHODS`, or weights (`interp.pretrained.path_of`); by default what
                     is best for the source
    hdr        weights (`interp.pretrained.path_of`) of HDR post-processing, which changes all frames, key frames too
    format     mp4, png, or exr (linear light); by default as `output` says
    play       frames per second at which a film plays, for slow motion; by default in real time
    tile       none, WIDTHxHEIGHT, or auto: large frames in tiles
    cuts       hold: nothing is interpolated across a cut; keep: cuts are not looked for
    device     cpu, cuda or auto
    running    with how many bits a network is run, and whether torch compiles it
    resume     go on where an interrupted run was, on the same kind of device, to the same bytes; what is finished is
               left as it is
    report     told how many frames are done, of how many
    told       told in one sentence which method was chosen, and why

    Raises UsageError for requests that cannot be meant, DataError for what cannot be read or written.
    """
    output, where = Path(output), device_of(device)
    kind = kind_of(output, format)
    ready = prepared(source, grid_of(multiple, fps), method, network, hdr, tile, cuts, where, options, running)
    take, grid, fill = ready.take, ready.grid, ready.fill
    if overwrite:
        check_apart(source, output)
    rate = film_rate(take, grid, play, kind)
    pictures = Pictures(kind, take.bits, take.curve if kind == "mp4" else take.coded)
    job = {
        "versions": versions(("torch",)),
        "source": take.describe(places_of(output, kind)),
        "part": {"start_s": options.start_s, "stop_s": options.stop_s},
        "grid": grid.describe(),
        "interpolation": ready.about,
        "device": where.type,
        "hdr": ready.after and ready.after.about,
        "tiles": fill.tiling.describe(),
        "cuts": cuts,
        "format": pictures.describe(),
        "transfer": pictures.curve,
        "film_rate": str(rate) if kind == "mp4" else None,
    }
    with Shelf(output, kind, job, rate, overwrite=overwrite, resume=resume, write=pictures.write, line=LINE) as shelf:
        if shelf.finished:
            return shelf.finished
        if told:
            told(f"{fill.method.name}: {ready.why}")
        started, there = time.perf_counter(), shelf.count
        _fill(shelf, ready, pictures, report)
        seconds = time.perf_counter() - started
        run = {"seconds": round(seconds, 3), "frames": shelf.count - there, "device": str(where), "machine": machine()}
        manifest = shelf.job | _result(shelf, ready) | {"run": run}
        shelf.publish(manifest)
    return manifest


def frames(
    source: str | Path,
    *,
    multiple: Number | None = None,
    fps: Number | None = None,
    method: str | None = None,
    network: str | Path | None = None,
    hdr: str | Path | None = None,
    tile: str = "auto",
    cuts: str = "hold",
    device: str = "cpu",
    running: Running = PLAIN,
    options: Options = AS_IT_IS,
) -> Iterator[Filled]:
    """The frames that `interpolate` writes, one by one, in memory that does not grow; what is wrong is refused at
    once, as there."""
    where = device_of(device)
    ready = prepared(source, grid_of(multiple, fps), method, network, hdr, tile, cuts, where, options, running)
    return (frame for stretch in ready.stretches() for frame in ready.work(stretch)[1])


@dataclass(frozen=True, slots=True)
class Ready:
    """All that is to be known before the first frame; `why` the method was chosen, `about` for JSON what it is."""

    take: Take
    grid: Grid
    fill: Fill
    after: After | None
    look: bool
    why: str
    about: dict[str, Any]

    def stretches(self, zero_us: int | None = None, start: int = 0) -> Iterator[Stretch]:
        """See `interp.interpolate.stretches`."""
        return stretches(self.take, self.grid, zero_us, start, self.look)

    def work(self, stretch: Stretch) -> tuple[str, Iterator[Filled]]:
        """Why the method was not asked for a stretch, empty if it was; and its frames."""
        work = self.fill.fill(stretch)
        return work.remark, self.after.frames(work) if self.after else work.frames


def prepared(
    source: str | Path,
    grid: Grid,
    method: str | None,
    network: str | Path | None,
    hdr: str | Path | None,
    tile: str,
    cuts: str,
    device: torch.device,
    options: Options,
    running: Running,
) -> Ready:
    """Open the source, its method and its tiles.  Raises as `interpolate` does."""
    if cuts not in ("hold", "keep"):
        raise UsageError(f"cuts '{cuts}': expected hold or keep")
    take = open_take(source, options)
    has_events = take.event_size is not None
    if isinstance(take, OfStill):
        chosen = choice_of_one(method, network, str(source), running)
    else:
        chosen = choice(method, network, has_events, str(source), device, running)
    after = After(pretrained.path_of(hdr), has_events, device, tile, take.bright) if hdr else None
    footprint = footprint_of(take.size, take.event_size) if take.event_size else 1
    tiling = tiling_of(chosen.method, take.size, tile, footprint)
    needed = after is not None and after.needs_events
    fill = Fill(take, chosen.method.begin(), open_method(FALLBACK), tiling, grid.multiple_of(take.rate), device, needed)
    return Ready(take, grid, fill, after, cuts == "hold", chosen.why, chosen.about)


def grid_of(multiple: Number | None, fps: Number | None) -> Grid:
    """The grid of a multiple or a rate.  Raises UsageError for both."""
    if multiple is not None and fps is not None:
        raise UsageError(f"-x {multiple} and --fps {fps} each say how many frames; leave out one of them")
    if fps is not None:
        return Rate(parse_number(fps, "--fps"))
    return Times(parse_number(MULTIPLE if multiple is None else multiple, "-x"))


def _fill(shelf: Shelf, ready: Ready, pictures: Pictures, report: Report | None) -> None:
    """Make what is not there yet."""
    take, zero_us = ready.take, shelf.done[0]["key_us"] if shelf.done else None
    ready.fill.shot = shelf.done[-1]["shot"] if shelf.done else 0
    keepers: dict[str, Fill | After] = {"fill": ready.fill} | ({"after": ready.after} if ready.after else {})
    memory = shelf.memory()
    with shelf.remembering():
        for name, keeper in keepers.items():
            keeper.remember(_of(name, memory))
    done, total = shelf.count, _expected(take, ready.grid)
    if report:
        report(done, total)
    for stretch in ready.stretches(zero_us, len(shelf.done)):
        remark, made = ready.work(stretch)
        times = []
        with shelf.writing():
            for frame in _recalled(shelf, made) if memory else made:
                shelf.put(frame.instant.number, pictures.picture(frame))
                times.append(frame.instant.t_us)
                done += 1
                if report:
                    report(done, total)
            made_of = {f"{name}.{key}": array for name, each in keepers.items() for key, array in each.memory().items()}
            line = {"key_us": stretch.first.t_us, "t_us": times, "remark": remark, "shot": ready.fill.shot}
            shelf.stretch(line, made_of)
            memory = {}  # (from here on it is what this run has made)
    if not shelf.count:
        raise DataError(f"{take.name} holds no frame; give another part of it")


def _recalled(shelf: Shelf, made: Iterator[Filled]) -> Iterator[Filled]:
    """Frames that are made of what was remembered."""
    with shelf.remembering():
        yield from made


def _expected(take: Take, grid: Grid) -> int | None:
    """How many frames there should be; None if there is no telling."""
    if (gaps := take.gaps_expected) is None:
        return None
    span_us = round(10**6 * gaps / take.rate)
    left_out = len(grid.at(gaps, span_us, 0)) if isinstance(take, OfStill) else 0  # (the end of an exposure)
    return grid.count(gaps, span_us) - left_out


def _of(name: str, memory: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {key.removeprefix(f"{name}."): array for key, array in memory.items() if key.startswith(f"{name}.")}


def _unevenly(shelf: Shelf, grid: Grid) -> list[str]:
    """That a film plays frames evenly which are not, if it does."""
    gaps_us = [after["key_us"] - line["key_us"] for line, after in pairwise(shelf.done)]
    if shelf.kind != "mp4" or not isinstance(grid, Times) or not gaps_us or _are_even(gaps_us):
        return []
    return [
        f"frames lie {min(gaps_us) / 1000:g} to {max(gaps_us) / 1000:g} ms apart, and the film plays what is made of"
        " them evenly; --fps, or a folder of pictures, keeps their times"
    ]


def _are_even(gaps_us: list[int]) -> bool:
    """Whether gaps are those of frames at a constant rate, whose times are rounded."""
    least_us, most_us = min(gaps_us), max(gaps_us)
    rounded = not any(gap_us % CLOCK_US for gap_us in gaps_us) and most_us - least_us <= CLOCK_US < least_us
    return rounded or most_us <= UNEVEN * least_us


def _brought(ready: Ready, done: list[dict[str, Any]]) -> list[str]:
    """What becomes of events, if they are asked for, whose camera stands elsewhere, if some are known, or has another
    clock, by which they may be unknown; `done` are the stretches, the last of which is no gap."""
    take, wanted = ready.take, ready.fill.events or ready.fill.method.needs_events
    if not (wanted and isinstance(take, OfSequence)):
        return []
    known = any(each["remark"] != NO_EVENTS for each in done[:-1])
    said = []
    if take.apart and known:
        said.append("its cameras stand apart: events are brought to where the frames saw the same change")
    if take.late_us:
        late = f"{abs(take.late_us)} us {'late' if take.late_us > 0 else 'early'}"
        said.append(
            f"its events are {late} by the clock of its frames, which is not corrected; give both cameras of the rig"
            " one clock_offset_us"
        )
    return said


def _clipped(shelf: Shelf, ready: Ready) -> list[str]:
    """That light above white, of the source or of HDR post-processing, is not in what is made, if it is not."""
    if shelf.kind == "exr" or not (ready.take.bright or ready.after):
        return []
    made = "" if ready.take.bright else ", which HDR post-processing makes,"
    return [f"light above white{made} is kept in EXR only: --format exr"]


def _result(shelf: Shelf, ready: Ready) -> dict[str, Any]:
    """What the manifest says of what was made."""
    take = ready.take
    named: dict[str, list[list[float]]] = {}
    for line, after in zip(shelf.done, [*shelf.done[1:], None], strict=True):
        if line["remark"]:
            assert after is not None
            named.setdefault(line["remark"], []).append([line["key_us"] / 1e6, after["key_us"] / 1e6])
    return {
        "frames": shelf.count,
        "key_frames": len(shelf.done),
        "size": list(shelf.size_of(take.size)),
        "start_us": shelf.done[0]["key_us"],
        "stop_us": max([shelf.done[-1]["key_us"], *shelf.done[-1]["t_us"]]),
        "gaps_s": named,
        "remarks": [
            *take.remarks,
            *_brought(ready, shelf.done),
            *_clipped(shelf, ready),
            *_unevenly(shelf, ready.grid),
            *shelf.remarks_on(take.size),
        ],
        "manifest": str(manifest_of(shelf.output, shelf.kind)),
    }
