"""rig.toml: the cameras of a rig, as a person writes them.

    [source]                    the camera that took the video; may be left out
    fov_deg = 60

    [[camera]]                  once for each camera; the keys are the fields of `Camera`
    name = "left"
    kind = "dvs"
    translation_mm = [15, 0, 0]
    set = { threshold_on = 0.2 }

A `sensor` that is a file is looked for beside the rig file.  `example_rig.toml` explains every key.
"""

from __future__ import annotations

import os
import re
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from vid2ev.errors import DataError, UsageError, clause, nearest
from vid2ev.recording.destination import check_new
from vid2ev.recording.disk import whole_file, writing
from vid2ev.rig.camera import Camera, Rig, Source
from vid2ev.toml_text import parsed_toml, toml_value
from vid2ev.untrusted import beside, check_file

EXAMPLE = Path(__file__).with_name("example_rig.toml")
Model = TypeVar("Model", bound=BaseModel)
TABLES = ("source", "camera")
LARGEST = 1 << 18  # bytes; no rig or calibration comes near


def read_rig(path: str | Path, to_use: bool = True) -> Rig:
    """The rig of a file.

    to_use  its sensors are to be read, too: files of theirs must be beside it or below (`vid2ev.untrusted`)
    Raises DataError for what cannot be read as TOML, UsageError for a file that is not there and for keys and values
    that cannot be meant.
    """
    path = Path(path)
    tables = _tables(path)
    unknown = next((key for key in tables if key not in TABLES), None)
    if unknown is not None:
        raise UsageError(
            f"{path}: '{unknown}' is unknown{nearest(unknown, TABLES)}; a rig file has a table [source] and a table"
            " [[camera]] for each camera"
        )
    listed = tables.get("camera", [])
    if not isinstance(listed, list) or not listed or not all(isinstance(table, dict) for table in listed):
        raise UsageError(f"{path}: there is no camera; write a table [[camera]] for each one, with its name and kind")
    source = made(Source, tables.get("source", {}), f"{path}: [source]")
    cameras = [_camera(table, index, path, to_use) for index, table in enumerate(listed)]
    try:
        return Rig(source=source, cameras=tuple(cameras))
    except ValidationError as error:
        raise UsageError(f"{path}: {clause(error.errors()[0]['msg'])}") from error


def write_rig(path: str | Path, rig: Rig, overwrite: bool = False) -> None:
    """Write a rig that reads back equal.  Raises UsageError where a file is in the way, DataError where the disk cannot
    take it."""
    path = Path(path)
    write_text(path, rig_text(rig, path.parent), overwrite)


def rig_text(rig: Rig, folder: Path = Path()) -> str:
    """The text of a rig file; `sensor` files are named as seen from `folder`."""
    tables = [] if rig.source == Source() else ["[source]\n" + _keys(rig.source)]
    for camera in rig.cameras:
        if camera.sensor is not None and is_file(camera.sensor):
            camera = camera.model_copy(update={"sensor": _seen_from(folder, camera.sensor)})
        tables.append("[[camera]]\n" + _keys(camera))
    return "\n".join(tables)


def out_of_reach(path: Path, rig: Rig) -> list[str]:
    """Why whoever reads a rig that is written to a file may not take its sensors from where they are, one clause for
    each of their files."""
    found: dict[str, None] = {}
    for sensor in (camera.sensor for camera in rig.cameras):
        try:
            if sensor is not None and is_file(sensor):
                beside(path, _seen_from(path.parent, sensor))
        except UsageError as error:
            found[str(error)] = None
    return [*found]


def _seen_from(folder: Path, sensor: str) -> str:
    return sensor if os.path.isabs(sensor) else os.path.relpath(sensor, folder)


def write_text(path: Path, text: str, overwrite: bool = False) -> None:
    """A text file, as a whole or not at all.  Raises UsageError where one is in the way, DataError where the disk
    cannot take it."""
    with writing(path, "choose another place"):
        check_new(path, overwrite)
        with whole_file(path) as file:
            file.write(text.encode())


def read_text(path: Path) -> str:
    """The text of a small file.  Raises UsageError if it is not there, DataError if it cannot be read."""
    check_file(path)
    if path.is_file() and path.stat().st_size > LARGEST:
        raise DataError(
            f"{path}: {path.stat().st_size:,} bytes are too many for a rig or calibration file; give another file"
        )
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise UsageError(
            f"{path}: no such file; give a rig file, such as `vid2ev init rig.toml` writes, or a calibration file"
        ) from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not UTF-8 text; give a rig file or a calibration file") from error
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}; give a rig file or a calibration file") from error


def is_rig_file(path: Path) -> bool:
    """Whether a file is a rig's: by its suffix, or a line [[camera]] or [source].  Raises as `read_text` does."""
    return (
        path.suffix == ".toml" or re.search(r"^\s*\[(\[camera\]|source)\]", read_text(path), re.MULTILINE) is not None
    )


def _tables(path: Path) -> dict[str, Any]:
    text = read_text(path)
    try:
        return parsed_toml(text)
    except ValueError as error:
        calibrated = f"; vid2ev init rig.toml --from {path} makes a rig of a calibration file"
        remedy = "" if path.suffix == ".toml" else calibrated
        raise DataError(f"{path}: not valid TOML: {error}; correct that line{remedy}") from error


def _camera(table: Mapping[str, Any], index: int, path: Path, to_use: bool) -> Camera:
    name = table.get("name")
    where = f"{path}: camera '{name}'" if isinstance(name, str) else f"{path}: camera {index + 1}"
    camera = made(Camera, table, where)
    if camera.sensor is not None and is_file(camera.sensor):
        if to_use:
            beside(path, camera.sensor)
        camera = camera.model_copy(update={"sensor": os.path.normpath(path.parent / camera.sensor)})
    return camera


def is_file(sensor: str) -> bool:
    """Whether a sensor is named by a file; a preset's name has neither suffix nor folder."""
    return sensor.endswith(".toml") or len(Path(sensor).parts) > 1


def made(model: type[Model], values: Any, where: str) -> Model:
    """A record of a table's values.  Raises UsageError, one sentence that says what is wrong with them."""
    if not isinstance(values, dict):
        raise UsageError(f"{where} is no table; write [source] on a line, and its keys below")
    try:
        return model(**values)
    except ValidationError as error:
        raise UsageError(_complaint(error, model, values, where)) from error


def _complaint(error: ValidationError, model: type[BaseModel], values: Mapping[str, Any], where: str) -> str:
    """The first of pydantic's complaints as one sentence: where, key, value, what is possible."""
    first = error.errors()[0]
    if not first["loc"]:
        return f"{where}: {clause(first['msg'])}"
    key = str(first["loc"][0])
    if first["type"] == "extra_forbidden":
        keys = model.model_fields
        of_sensor = "; of its sensor they are KEYs in set = { KEY = VALUE }" if "set" in keys else ""
        return f"{where}: '{key}' is unknown{nearest(key, keys)}; the keys are {', '.join(keys)}{of_sensor}"
    meaning = model.model_fields[key].description
    if first["type"] == "missing" and len(first["loc"]) == 1:
        return f"{where}: {key} is missing ({meaning})"
    counts = {"missing": "it has too few values", "too_long": "it has too many values"}
    why = counts.get(first["type"]) or clause(first["msg"])
    return f"{where}: {key} = {reprlib.repr(values[key])} is impossible: {why} ({meaning})"


def _keys(record: BaseModel) -> str:
    """The keys of a record that differ from their defaults, as lines of TOML."""
    values = record.model_dump(exclude_defaults=True)
    order = ["name", "kind", *(key for key in values if key not in ("name", "kind"))]
    return "".join(f"{key} = {toml_value(values[key])}\n" for key in order if key in values)
