"""A setup as the command that does the same, as the options of `conversion.convert`, and as files.

Cameras that stand where the source's own rig has them, or where there is none the video's, need no rig file: what is
changed of their sensors is said by --sensor, --cis and --set.  Otherwise all of it is in a rig file, and a scene that
was changed in a scene file; the command then names those.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from vid2ev.gui.setup import Setup, texts_of
from vid2ev.making.conversion import default_directory
from vid2ev.recording.destination import check_new
from vid2ev.recording.disk import sync, writing
from vid2ev.rig.camera import Camera, Rig, default_rig
from vid2ev.rig.rig_file import rig_text, write_text
from vid2ev.scenes.own_files import copy_files, named_from, with_own_files
from vid2ev.sensors.presets import PRESET, sensor_file_text
from vid2ev.toml_text import toml_text

RIG, SCENE = "rig.toml", "scene.toml"


@dataclass(frozen=True)
class Command:
    """`vid2ev convert` of a setup.

    arguments  those after `vid2ev convert`
    files      text of the files that they name, by name
    """

    arguments: tuple[str, ...]
    files: Mapping[str, str]

    def __str__(self) -> str:
        return shlex.join(["vid2ev", "convert", *self.arguments])


def command_of(setup: Setup, output: str | None = None) -> Command:
    """The command of a setup, whose recording goes to `output`, which is said where the command would not do so."""
    files = {} if setup.scene is None else {SCENE: scene_text(setup)}
    source = f"./{setup.source}" if setup.source.startswith("-") else setup.source  # (which is no option)
    words = [SCENE if setup.scene is not None else source]
    if is_plain(setup):
        words += _sensor_words(setup)
    else:
        files[RIG] = rig_text(setup.rig)
        words += ["--rig", RIG]
    for name, value in setup.options.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    if output and Path(output) != default_directory(words[0]):
        words += ["-o", str(Path(output))]  # (with a slash at its end it would be the folder for the recording's)
    return Command(tuple(words), files)


def options_of(setup: Setup, folder: Path) -> dict[str, Any]:
    """The arguments of `conversion.convert` that mean a setup; files that they need are written to a folder."""
    chosen: dict[str, Any] = {"video": setup.source} | dict(setup.options)
    if setup.scene is not None:
        chosen["video"] = str(folder / SCENE)
        write_scene(setup, folder / SCENE, overwrite=True)
    if not is_plain(setup):
        return chosen | {"rig": setup.rig}
    events, frames = _two(setup)
    chosen |= {"sensor": events.sensor or PRESET, "overrides": texts_of(events.set)}
    if frames is not None:
        chosen |= {"cis": frames.sensor or PRESET}
        chosen["overrides"] = [*chosen["overrides"], *texts_of(frames.set, "cis.")]
    return chosen


def is_plain(setup: Setup) -> bool:
    """Whether options say all that there is to say of the cameras: an event camera in the place of the source's, and
    perhaps a frame camera there."""
    bare = tuple(each.model_copy(update={"sensor": None, "set": {}}) for each in setup.rig.cameras)
    default = any(Rig(source=setup.rig.source, cameras=bare) == default_rig(frames) for frames in (False, True))
    return default and not (setup.is_scene and setup.settled().scene.rig)


def sensor_text(setup: Setup, camera: int) -> str:
    """The file of a camera's sensor, as --sensor and --cis take it, with every value in it."""
    kind, spec, preset = setup.kind(camera), setup.spec(camera), setup.preset(camera)
    changed = ", ".join(setup.rig.cameras[camera].set)
    title = f"{preset}, with other {changed}" if changed else preset
    return sensor_file_text(kind.table, spec, title)


def scene_text(setup: Setup) -> str:
    """The file of a scene, with every number settled, as it is written where none of its files are."""
    return toml_text(with_own_files(setup.settled().tables(), _beside(Path(SCENE)))[0])


def write_scene(setup: Setup, path: Path, overwrite: bool = False) -> None:
    """Write the file of a scene, and the files that it names beside it, but for those that are there or below already.

    All of them or none.  Raises UsageError where a file is in the way, DataError where the disk cannot take them.
    """
    tables, files = with_own_files(named_from(setup.settled().tables(), path.parent), _beside(path))
    with writing(path, "choose another place"):
        for place in (path, *(path.parent / name for name in files)):
            check_new(place, overwrite)
        with TemporaryDirectory(dir=path.parent, prefix=f".{_beside(path)}.") as folder:
            made = Path(folder)
            copy_files(files, made)
            copied = [file for file in made.rglob("*") if file.is_file()]
            for file in copied:
                sync(file)
            for file in copied:
                place = path.parent / file.relative_to(made)
                place.parent.mkdir(parents=True, exist_ok=True)
                file.replace(place)
    write_text(path, toml_text(tables), overwrite)


def _beside(path: Path) -> str:
    """The folder of the files of a scene that is written somewhere."""
    return f"{path.stem}_files"


def _sensor_words(setup: Setup) -> list[str]:
    events, frames = _two(setup)
    words = [] if events.sensor is None else ["--sensor", events.sensor]
    if frames is not None:
        words += ["--frames"] if frames.sensor is None else ["--cis", frames.sensor]
    texts = [*texts_of(events.set), *texts_of(frames.set if frames else {}, "cis.")]
    return words + [word for text in texts for word in ("--set", text)]


def _two(setup: Setup) -> tuple[Camera, Camera | None]:
    events, *frames = setup.rig.cameras
    return events, frames[0] if frames else None
