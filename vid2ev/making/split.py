"""A clip shared out by parts, of its pixels or of its time; what is put together has the bytes of a recording made at
once, but for parts begun with a warm-up.

    DIR.parts/           while the recording is being made
        lock             held by the process that shares it out
        K-of-N/          the recording of a part; K-of-N.partial/ while it is being made
    DIR/                 the recording

    tiles        blocks of pixels; every worker makes the light for itself, so this pays where the sensor takes longer
                 than the light: noisy sensors, large pictures
    cuts         shots, at whose beginning sensors start afresh
    approximate  stretches of time, each begun with a warm-up (`stretches`)
"""

from __future__ import annotations

import re
import secrets
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any

from vid2ev.cluster.task import Task, Tell
from vid2ev.errors import UsageError
from vid2ev.kernels.layout import BLOCK
from vid2ev.making.conversion import Report, check_outputs, convert, telling
from vid2ev.making.stretches import Look, Stretch, at_cuts, warm_up_us, with_warm_up
from vid2ev.recording.disk import writing
from vid2ev.recording.folder import begun_job, check_free
from vid2ev.recording.held import LOCK, Held, undisturbed
from vid2ev.recording.manifest import read_manifest
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Part
from vid2ev.tracks.outputs import Outputs
from vid2ev.tracks.parts import Made, reading

PART = re.compile(r"\d+-of-\d+(\.partial)?")  # the folder of a part

ShareOut = Callable[[Sequence[Task]], object]  # does all tasks; raises what one ends with


def convert_split(
    video: str,
    directory: Path,
    kind: str,
    count: int,
    share_out: ShareOut,
    *,
    overwrite: bool = False,
    resume: bool = False,
    look: Look | None = None,
    report: Report | None = None,
    **options: Any,
) -> dict[str, Any]:
    """`conversion.convert` of at most so many parts of a kind, which `share_out` makes as tasks; returns the manifest.

    look    told how many frames were looked at for cuts and times, and of how many
    report  called at every source frame as parts are put together

    Raises UsageError for what cannot be split, and as `convert` does.
    """
    check_parts_free(directory, overwrite, resume, video)
    if resume and directory.exists() and not begun_parts(parts_of(directory)):
        # (it is finished, or was made with other options)
        return convert(video, directory, overwrite=overwrite, resume=True, report=report, **options)
    parts, notes = _parts(video, kind, count, options | {"seed": options.get("seed") or 0}, look)
    with _held(directory) as beside:
        check_parts_free(directory, overwrite, resume, video)  # (once more: another may have written there until now)
        if overwrite and not resume:
            _remove_parts(beside)
        if options.get("seed", 0) is None:
            options["seed"] = begun_part(directory).get("seed", secrets.randbits(32))
        folders = tuple(beside / f"{number}-of-{len(parts)}" for number in range(len(parts)))
        share_out(_tasks(video, parts, folders, options | {"overwrite": overwrite}))
        options |= {"notes": {**(options.get("notes") or {}), **notes}} if notes else {}
        made = Made(folders, in_time=kind != "tiles")
        manifest = convert(video, directory, overwrite=overwrite, resume=resume, report=report, made=made, **options)
        _remove_parts(beside)
    return manifest


def check_split(video: str, directory: Path, kind: str, *, overwrite: bool, resume: bool, **options: Any) -> None:
    """Raise UsageError for what `convert_split` refuses before it looks at the light."""
    check_parts_free(directory, overwrite, resume, video)
    _checked(video, kind, options | {"seed": options.get("seed") or 0})


def check_parts_free(directory: Path, overwrite: bool, resume: bool, video: str) -> None:
    """`recording.folder.check_free` of a recording and of its parts."""
    check_free(directory, overwrite, resume, video)
    beside = parts_of(directory)
    if beside.exists() and not beside.is_dir():
        raise UsageError(f"{beside} is needed to work in, and is a file; choose another folder with -o")
    for path in sorted(beside.iterdir()) if beside.is_dir() else ():
        if not ((path.is_dir() and PART.fullmatch(path.name)) or path.name == LOCK):
            raise UsageError(
                f"{beside} is needed to work in, and holds {path.name}, which is no part; choose another folder with -o"
            )
    if begun_parts(beside) and not (overwrite or resume):
        raise UsageError(f"{directory} was begun and not finished; --resume continues it, --overwrite starts again")


@contextmanager
def _held(directory: Path) -> Iterator[Path]:
    """The folder for the parts of a recording, which no other process touches meanwhile; where nothing was begun in it
    that could be taken up, it is gone in the end."""
    beside = parts_of(directory)
    held = Held(beside)
    try:
        with writing(directory):
            held.take()
        yield beside
    finally:
        with undisturbed():
            if held:
                _remove_parts_not_begun(beside)
            held.close()
            with suppress(OSError):
                beside.rmdir()


def begun_parts(beside: Path) -> list[Path]:
    """The parts that are there, in whole or in part."""
    return sorted(path for path in beside.iterdir() if PART.fullmatch(path.name)) if beside.is_dir() else []


def _remove_parts(beside: Path) -> None:
    """Remove parts, and nothing else.  Raises UsageError for one that a worker left over is still making."""
    for part in begun_parts(beside):
        with writing(part), Held(part) if part.suffix == ".partial" else nullcontext():
            shutil.rmtree(part, ignore_errors=True)


def _remove_parts_not_begun(beside: Path) -> None:
    """Remove parts without a checkpoint, of workers that were ended before they came to one; others are left alone that
    a worker left over is still making."""
    for part in begun_parts(beside):
        if part.suffix == ".partial" and not (part / "checkpoint.npz").exists():
            with suppress(UsageError, OSError), Held(part):
                shutil.rmtree(part, ignore_errors=True)


def _tasks(video: str, parts: Sequence[dict[str, Any]], folders: Sequence[Path], options: dict[str, Any]) -> list[Task]:
    """The recording of each part, in its folder."""
    not_in_parts = Outputs.__dataclass_fields__.keys() - {"probe"}
    of_parts = {key: value for key, value in options.items() if key not in not_in_parts}
    calls = [
        partial(_part, video=video, folder=folder, options=of_parts | part)
        for folder, part in zip(folders, parts, strict=True)
    ]
    return [Task(f"{video}, part {number} of {len(parts)}", call) for number, call in enumerate(calls, 1)]


def parts_of(directory: Path) -> Path:
    """Where the parts of a recording are kept until it is whole."""
    return directory.with_name(f"{directory.name}.parts")


def begun_part(directory: Path) -> dict[str, Any]:
    """The job of the first part of a recording, if it was begun; otherwise empty."""
    found = sorted(parts_of(directory).glob("0-of-*"))
    if not found:
        return {}
    with reading(found[0]):
        return begun_job(found[0].with_name(found[0].name.removesuffix(".partial")))


def _part(tell: Tell, video: str, folder: Path, options: dict[str, Any]) -> None:
    """The recording of a part, as a task."""
    if folder.exists():
        with reading(folder):
            read_manifest(folder)
    convert(video, folder, resume=True, report=telling(tell), preview=False, events_only=True, **options)


def _parts(
    video: str, kind: str, count: int, options: dict[str, Any], look: Look | None
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The parts, as what their conversions are told, and what the manifest is to say of them.  Raises UsageError."""
    recipe = _checked(video, kind, options)
    if kind == "tiles":
        sizes = [mount.size for mount in recipe.mounts if mount.kind == "dvs"]
        count = min(count, *(-(-width * height // BLOCK) for width, height in sizes))
        return [{"part": Part(number, count)} for number in range(count)], {}
    if kind == "cuts":
        return [stretch._asdict() for stretch in at_cuts(recipe, count, options, look)], {}
    stretches = with_warm_up(recipe, count, options, look)
    return [stretch._asdict() for stretch in stretches], {"split": _seams(recipe, stretches)}


def _checked(video: str, kind: str, options: dict[str, Any]) -> Recipe:
    """The recipe of a video that can be parted so; takes out of the options what its light does not hang on.  Raises
    UsageError."""
    for name in ("threads", "skip", "piece", "notes", "tolerance"):
        options.pop(name, None)
    effects, device = options.pop("effects", "all"), options.pop("device", "cpu")
    outputs = Outputs.of(**Outputs.taken_from(options))
    recipe = Recipe.of(video, **options)
    check_outputs(recipe, outputs)
    specs = [mount.sensor.spec for mount in recipe.mounts if isinstance(mount.sensor.spec, DvsSpec)]
    for wrong, what, instead in (
        (effects == "auto", "--effects auto", "name those that `vid2ev plan` finds"),
        (device != "cpu" and kind != "cuts", f"--device {device}", "take cpu"),
        (bool(outputs.probe) and kind == "approximate", "--probe", "take --split cuts or tiles"),
        (not recipe.source.rewindable, video, "keep it in a file first"),
        (not specs, "a rig without event cameras", "convert it at once"),
        (kind == "cuts" and recipe.source.dense, "a scene, which is a single shot", "take --split chain or tiles"),
        (kind == "cuts" and recipe.cuts != "restart", f"--cuts {recipe.cuts}", "take --split chain or tiles"),
        (kind != "tiles" and any(spec.frame_rate_hz > 0 for spec in specs), "frame_rate_hz", "take --split tiles"),
    ):
        if wrong:
            raise UsageError(f"--split {kind} cannot do {what}; {instead}, or leave --split out")
    return recipe


def _seams(recipe: Recipe, stretches: Sequence[Stretch]) -> dict[str, Any]:
    """What the manifest says of parts begun with a warm-up."""
    seams_us = [stretch.since_ns // 1000 for stretch in stretches if stretch.since_ns is not None]
    return {"kind": "approximate", "seams_us": seams_us, "warm_up_us": warm_up_us(recipe)}
