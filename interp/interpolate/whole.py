"""`interpolate`: from a recording or a video to its frames at more instants, in a film or a folder."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from interp.interpolate.after import After
from interp.interpolate.choice import FALLBACK, Choice, choice, choice_of_one, device_of
from interp.interpolate.fill import Fill
from interp.interpolate.instants import Grid, Number, Rate, Times, parse_number
from interp.interpolate.of_still import OfStill
from interp.interpolate.pictures import Pictures, film_rate
from interp.interpolate.shelf import Shelf, kind_of, manifest_of
from interp.interpolate.stretches import stretches
from interp.interpolate.take import AS_IT_IS, Options, Take, open_take
from interp.interpolate.tiling import Tiling, parse_tiling
from interp.methods import open_method
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.manifest import machine, sha256, versions

Report = Callable[[int, int | None], object]  # frames done, of how many
MULTIPLE = 8


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
    method, network   a name of `interp.methods.METHODS`, or a file of weights; by default what is best for the source
    hdr        weights of HDR post-processing, which changes all frames, key frames too
    format     mp4, png, or exr (linear light); by default as `output` says
    play       frames per second at which the film plays, for slow motion; by default in real time
    tile       none, WIDTHxHEIGHT, or auto: large frames in tiles
    cuts       hold: nothing is interpolated across a cut; keep: cuts are not looked for
    device     cpu, cuda or auto
    resume     go on where an interrupted run was, to the same bytes; what is finished is left as it is
    report     told how many frames are done, of how many
    told       told in one sentence which method was chosen, and why

    Raises UsageError for requests that cannot be meant, DataError for what cannot be read or written.
    """
    output, grid = Path(output), grid_of(multiple, fps)
    kind = kind_of(output, format)
    if cuts not in ("hold", "keep"):
        raise UsageError(f"cuts '{cuts}': expected hold or keep")
    take, where = open_take(source, options), device_of(device)
    if isinstance(take, OfStill):
        chosen = choice_of_one(method, network, str(source))
    else:
        chosen = choice(method, network, take.event_size is not None, str(source), where)
    if told:
        told(f"{chosen.method.name}: {chosen.why}")
    after = After(Path(hdr), take.event_size is not None, where) if hdr else None
    tiling = parse_tiling(tile, take.size, multiple_of(chosen))
    rate = film_rate(take, grid, play)
    pictures = Pictures(kind, take.bits, take.curve)
    job = {
        "versions": versions(("torch",)),
        "source": take.describe(),
        "part": {"start_s": options.start_s, "stop_s": options.stop_s},
        "grid": grid.describe(),
        "interpolation": chosen.about,
        "hdr": {"weights": str(hdr), "sha256": sha256(Path(hdr))} if hdr else None,
        "tiles": tiling.describe(),
        "cuts": cuts,
        "format": pictures.describe(),
        "film_rate": str(rate) if kind == "mp4" else None,
    }
    with Shelf(output, kind, job, rate, overwrite=overwrite, resume=resume, write=pictures.write) as shelf:
        if shelf.finished:
            return shelf.finished
        started, there = time.perf_counter(), shelf.count
        fill = Fill(take, chosen.method.begin(), open_method(FALLBACK), tiling, grid.parts, where)
        _fill(shelf, fill, after, grid, cuts == "hold", pictures, report)
        seconds = time.perf_counter() - started
        run = {"seconds": round(seconds, 3), "frames": shelf.count - there, "device": str(where), "machine": machine()}
        manifest = shelf.job | _result(shelf, take, tiling) | {"run": run}
        shelf.publish(manifest)
    return manifest


def grid_of(multiple: Number | None, fps: Number | None) -> Grid:
    """The grid of a multiple or a rate.  Raises UsageError for both."""
    if multiple is not None and fps is not None:
        raise UsageError(f"-x {multiple} and --fps {fps} each say how many frames; leave out one of them")
    if fps is not None:
        return Rate(parse_number(fps, "--fps"))
    return Times(parse_number(MULTIPLE if multiple is None else multiple, "-x"))


def multiple_of(chosen: Choice) -> int:
    """Of what tiles must begin at whole multiples."""
    return int(getattr(getattr(chosen.method, "network", None), "multiple", 2))


def _fill(
    shelf: Shelf,
    fill: Fill,
    after: After | None,
    grid: Grid,
    look: bool,
    pictures: Pictures,
    report: Report | None,
) -> None:
    """Make what is not there yet."""
    take, zero_us = fill.take, shelf.done[0]["key_us"] if shelf.done else None
    fill.shot = shelf.done[-1]["shot"] if shelf.done else 0
    fill.events = after is not None and after.needs_events
    keepers: dict[str, Fill | After] = {"fill": fill} | ({"after": after} if after else {})
    for name, keeper in keepers.items():
        keeper.remember(_of(name, shelf.memory()))
    gaps, done = take.gaps_expected, shelf.count
    total = grid.count(gaps, 0) if gaps is not None and grid.parts else None
    if report:
        report(done, total)
    for stretch in stretches(take, grid, zero_us, len(shelf.done), look):
        work, times = fill.fill(stretch), []
        with shelf.writing():
            for frame in after.frames(work) if after else work.frames:
                shelf.put(frame.instant.number, pictures.picture(frame))
                times.append(frame.instant.t_us)
                done += 1
                if report:
                    report(done, total)
            memory = {f"{name}.{key}": array for name, each in keepers.items() for key, array in each.memory().items()}
            line = {"key_us": stretch.first.t_us, "t_us": times, "remark": work.remark, "shot": fill.shot}
            shelf.stretch(line, memory)
    if not shelf.count:
        raise DataError(f"{take.name} holds no frame; give another part of it")


def _of(name: str, memory: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {key.removeprefix(f"{name}."): array for key, array in memory.items() if key.startswith(f"{name}.")}


def _result(shelf: Shelf, take: Take, tiling: Tiling) -> dict[str, Any]:
    """What the manifest says of what was made."""
    named: dict[str, list[list[float]]] = {}
    for line, after in zip(shelf.done, [*shelf.done[1:], None], strict=True):
        if line["remark"]:
            assert after is not None
            named.setdefault(line["remark"], []).append([line["key_us"] / 1e6, after["key_us"] / 1e6])
    return {
        "frames": shelf.count,
        "key_frames": len(shelf.done),
        "size": list(take.size),
        "start_us": shelf.done[0]["key_us"],
        "stop_us": shelf.done[-1]["key_us"],
        "gaps_s": named,
        "remarks": list(take.remarks),
        "manifest": str(manifest_of(shelf.output, shelf.kind)),
    }
