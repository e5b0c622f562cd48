"""A clip shared out by tiles: some pixels to each worker; the recording put together has the bytes of one made at once.

    DIR.tiles/K-of-N/    the recording of a part of the pixels
    DIR/                 the recording

Every worker makes the light for itself, so this pays where the sensor takes longer than the light: noisy sensors, large
pictures.
"""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from vid2ev.cluster.task import Task, Tell
from vid2ev.conversion import Report, check_outputs, convert
from vid2ev.errors import UsageError
from vid2ev.kernels.layout import BLOCK
from vid2ev.outputs import Outputs
from vid2ev.parts import Made
from vid2ev.recipe import Recipe
from vid2ev.recorder import Progress
from vid2ev.recording.folder import begun_job, check_free
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import Part

ShareOut = Callable[[Sequence[Task]], object]  # does all tasks; raises what one ends with


def convert_split(
    video: str,
    directory: Path,
    tiles: int,
    share_out: ShareOut,
    *,
    overwrite: bool = False,
    resume: bool = False,
    report: Report | None = None,
    **options: Any,
) -> dict[str, Any]:
    """`conversion.convert` with the pixels in so many parts, which `share_out` makes as tasks; returns the manifest.

    The files are those of `convert` to the byte.  Raises UsageError for what cannot be split, and as `convert` does.
    """
    beside = directory.with_name(f"{directory.name}.tiles")
    check_free(directory, overwrite, resume)
    if resume and directory.exists() and not beside.exists():
        return convert(video, directory, resume=True, **options)  # (it is finished, or was made with other options)
    if beside.exists() and not (overwrite or resume):
        raise UsageError(f"{directory} was begun and not finished; --resume continues it, --overwrite starts again")
    if overwrite and not resume:
        shutil.rmtree(beside, ignore_errors=True)
    if options.get("seed", 0) is None:
        options["seed"] = begun_job(beside / f"0-of-{tiles}").get("seed", secrets.randbits(32))
    count = _checked(video, tiles, dict(options))
    folders = tuple(beside / f"{number}-of-{count}" for number in range(count))
    beside.mkdir(parents=True, exist_ok=True)
    of_parts = {key: value for key, value in options.items() if key not in Outputs.__dataclass_fields__}
    calls = [
        partial(_part, video=video, folder=folder, part=Part(number, count), options=of_parts)
        for number, folder in enumerate(folders)
    ]
    share_out([Task(f"{video}, tile {number + 1} of {count}", call) for number, call in enumerate(calls)])
    made = convert(video, directory, overwrite=overwrite, resume=resume, report=report, made=Made(folders), **options)
    shutil.rmtree(beside)
    return made


def _part(tell: Tell, video: str, folder: Path, part: Part, options: dict[str, Any]) -> None:
    """The recording of a part, as a task."""

    def report(recipe: Recipe, done: Progress) -> None:
        total = recipe.source.frames_expected
        tell({"events": done.events} | ({"share": min(done.frames / total, 1.0)} if total else {}))

    convert(video, folder, resume=True, report=report, part=part, preview=False, **options)


def _checked(video: str, tiles: int, options: dict[str, Any]) -> int:
    """Into how many parts the pixels can be split: at most a block of 2048 each.  Raises UsageError."""
    for name in ("threads", "skip", "piece", "notes", "tolerance", "report"):
        options.pop(name, None)
    effects, device = options.pop("effects", "all"), options.pop("device", "cpu")
    outputs = Outputs.of(**Outputs.taken_from(options))
    recipe = Recipe.of(video, **options)
    check_outputs(recipe, outputs)
    specs = [mount.sensor.spec for mount in recipe.mounts]
    for wrong, what, instead in (
        (effects == "auto", "--effects auto", "name them, or take all"),
        (device != "cpu", f"--device {device}", "take cpu"),
        (bool(outputs.probe), "--probe", "probe a recording that is made at once"),
        (not recipe.source.rewindable, video, "keep it in a file first"),
        (any(not isinstance(spec, DvsSpec) for spec in specs), "a frame camera", "convert that one by itself"),
        (any(isinstance(spec, DvsSpec) and spec.frame_rate_hz > 0 for spec in specs), "frame_rate_hz", "set it to 0"),
    ):
        if wrong:
            raise UsageError(f"--split tiles cannot do {what}; {instead}, or leave --split out")
    return min(tiles, *(-(-mount.size[0] * mount.size[1] // BLOCK) for mount in recipe.mounts))
