"""Sensors by name: preset files, a person's own TOML file, and `key=value` on top of either.

The file of an event sensor has a table `[dvs]`, whose keys are the fields of `DvsSpec`, that of a frame sensor a table
`[cis]` of `CisSpec`; keys left out have their defaults.  A table `[about]` may hold `title`, `size`, `sources` and
`differences`.  In a preset the comment above a key names the source of its value; `read_sensor` keeps it, so that
`vid2ev sensors NAME` can cite it.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from vid2ev.errors import DataError, UsageError, clause, nearest
from vid2ev.requests import setting
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.record import first_said
from vid2ev.sensors.spec import DvsSpec
from vid2ev.toml_text import parsed_toml, toml_text, toml_value
from vid2ev.untrusted import read_text

PRESET = "paper"  # of cameras that name no sensor


@dataclass(frozen=True)
class Kind:
    """A kind of sensor: the table of its files, their specification, where its presets are, a setting to show, and the
    option that takes one."""

    table: str
    spec: type[BaseModel]
    presets: Path
    example: str
    option: str

    def names(self) -> list[str]:
        """The names of the presets that come with vid2ev, in alphabetical order."""
        return sorted(path.stem for path in self.presets.glob("*.toml"))


HERE = Path(__file__).parent
DVS = Kind("dvs", DvsSpec, HERE / "preset_files", "threshold_on=0.2", "--sensor")
CIS = Kind("cis", CisSpec, HERE / "cis_files", "cis.exposure_us=500", "--cis")
KINDS = (DVS, CIS)


@dataclass(frozen=True, slots=True)
class SensorFile:
    """A sensor file as read: its name, what it says about itself, its values and the comment above each."""

    name: str
    about: Mapping[str, Any]
    values: Mapping[str, Any]
    sources: Mapping[str, str]


def preset_names() -> list[str]:
    """The names of the event sensors that come with vid2ev, in alphabetical order."""
    return DVS.names()


def cis_names() -> list[str]:
    """The names of the frame sensors that come with vid2ev, in alphabetical order."""
    return CIS.names()


def load_sensor(name_or_path: str | Path, overrides: Sequence[str] = ()) -> DvsSpec:
    """The specification of an event sensor: a preset or a TOML file, changed by `key=value` texts.

    An override names a key of `DvsSpec`, bare or with `dvs.` before it; its value is a TOML number, boolean,
    string or list, and a bare word is a string.  Later overrides win.

    Raises UsageError for an unknown preset or key and for a value that cannot be, DataError for a file that
    cannot be read as TOML.
    """
    spec = load(DVS, name_or_path, overrides)
    assert isinstance(spec, DvsSpec)
    return spec


def load_cis(name_or_path: str | Path, overrides: Sequence[str] = ()) -> CisSpec:
    """The specification of a frame sensor; as `load_sensor`, with `cis.` before a key, or bare."""
    spec = load(CIS, name_or_path, overrides)
    assert isinstance(spec, CisSpec)
    return spec


def load(kind: Kind, name_or_path: str | Path, overrides: Sequence[str] = ()) -> BaseModel:
    """The specification of a sensor of a kind; see `load_sensor`."""
    sensor = read_sensor(name_or_path, kind)
    values = dict(sensor.values)
    check_overrides(overrides, kind)
    for override in overrides:
        key, value = setting(override, kind.example)
        values[key.removeprefix(f"{kind.table}.")] = value
    for key, value in values.items():
        field = kind.spec.model_fields.get(key)
        truth = any(isinstance(each, bool) for each in (value if isinstance(value, list) else [value]))
        if truth and field is not None and _takes_numbers(field.annotation):  # (pydantic: 1 or 0)
            what = "list of numbers" if get_origin(field.annotation) is tuple else "number"
            raise UsageError(
                f"{key} = {toml_value(value)} in sensor {sensor.name} is impossible: it must be a {what}"
                f" (default {_as_written(field.default)})."
            )
    try:
        return kind.spec(**values)
    except ValidationError as error:
        raise UsageError(_sentence(error, sensor.name, kind)) from error


def _takes_numbers(annotation: Any) -> bool:
    """Whether numbers are of a type, or in what it holds."""
    return annotation in (int, float) or any(map(_takes_numbers, get_args(annotation)))


def check_overrides(overrides: Any, kind: Kind = DVS) -> None:
    """Raise UsageError for what is no list of texts."""
    if isinstance(overrides, str) or not all(isinstance(override, str) for override in overrides):
        raise UsageError(f"overrides {overrides!r}: expected a list of texts, such as [{kind.example!r}]")


def read_sensor(name_or_path: str | Path, kind: Kind = DVS) -> SensorFile:
    """A sensor file with its comments; the values are not checked yet.  Raises as `load_sensor` does."""
    name, path = _find(str(name_or_path), kind)
    text, tables = _tables(path)
    unknown = [key for key in tables if key not in (kind.table, "about")]
    other = next((each for each in KINDS if each.table in unknown), None)
    if other and kind.table in tables:
        raise UsageError(f"Sensor file {path} has tables [dvs] and [cis]: expected one sensor; give each its own file.")
    if other:
        raise UsageError(
            f"Sensor file {path} is of another kind, [{other.table}]: expected a table [{kind.table}]; {_place(other)}."
        )
    if unknown:
        raise UsageError(
            f"Sensor file {path} has '{unknown[0]}' outside its tables [{kind.table}] and [about]; "
            f"put the sensor's keys under [{kind.table}]."
        )
    values, about = tables.get(kind.table), tables.get("about", {})
    if not isinstance(values, dict) or not isinstance(about, dict):
        raise UsageError(
            f"Sensor file {path} has no table [{kind.table}]; put the sensor's keys under a line [{kind.table}]."
        )
    return SensorFile(name, about, values, _comments(text, kind))


def sensor_file_text(table: str, spec: BaseModel, title: str) -> str:
    """The text of a sensor file: a specification with every value in it, in the `table` of its kind."""
    return toml_text({"about": {"title": title}, table: spec.model_dump(mode="json")})


def kinds_of(name_or_path: str | Path) -> list[Kind]:
    """The kinds of sensor that a name or a file stands for; where it stands for none, one in which it is not far off.

    Raises DataError for a file that cannot be read as TOML.
    """
    name, path = str(name_or_path), Path(name_or_path)
    known = [kind for kind in KINDS if name in kind.names()]
    if not known and path.is_file():
        known = [kind for kind in KINDS if kind.table in _tables(path)[1]]
    return known or [kind for kind in KINDS if nearest(name, kind.names())][:1] or [DVS]


def _tables(path: Path) -> tuple[str, dict[str, Any]]:
    """The text of a TOML file, and what is in it."""
    try:
        text = read_text(path)
    except DataError:
        raise
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise DataError(f"Sensor file {path} cannot be read ({reason}); give a readable TOML file.") from error
    try:
        return text, parsed_toml(text)
    except ValueError as error:
        raise DataError(f"Sensor file {path} is not valid TOML: {error}; correct that line.") from error


def _find(name_or_path: str, kind: Kind) -> tuple[str, Path]:
    names = kind.names()
    if name_or_path in names:
        return name_or_path, kind.presets / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if path.is_file():
        return str(path), path
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise UsageError(f"Sensor file {path} does not exist; give an existing TOML file or one of {_list(names)}.")
    if other := next((each for each in KINDS if name_or_path in each.names()), None):
        raise UsageError(
            f"Sensor '{name_or_path}' is of another kind, {other.table}: expected one of {_list(names)}, or a TOML"
            f" file; {_place(other)}."
        )
    hint = nearest(name_or_path, names)
    raise UsageError(f"Sensor '{name_or_path}' is not a preset{hint}; presets are {_list(names)}, or give a TOML file.")


def _place(kind: Kind) -> str:
    """Where a sensor of a kind goes, as a clause."""
    return f'such a sensor is given with {kind.option}, or to a camera of kind "{kind.table}" of a rig'


def _comments(text: str, kind: Kind) -> dict[str, str]:
    """The comment lines directly above each key of the table of a kind, joined to one line."""
    found: dict[str, str] = {}
    block: list[str] = []
    table = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("#"):
            block.append(line.lstrip("# "))
            continue
        if line.startswith("["):
            table = line
        assignment = re.match(r"([\w-]+)\s*=", line)
        if assignment and block and table == f"[{kind.table}]":
            found[assignment[1]] = " ".join(block)
        block = []
    return found


def _sentence(error: ValidationError, name: str, kind: Kind) -> str:
    """The first of pydantic's complaints as one sentence: key, value, what is possible, default."""
    complaint = error.errors()[0]
    where = f"in sensor {name}"
    if not complaint["loc"]:
        return f"The values {where} do not go together: {clause(complaint['msg'])}."
    key = str(complaint["loc"][0])
    if complaint["type"] == "extra_forbidden":
        other = next((each for each in KINDS if each is not kind and key in each.spec.model_fields), None)
        elsewhere = f" (did you mean {other.table}.{key}, of cameras of that kind?)" if other else ""
        hint = elsewhere or nearest(key, kind.spec.model_fields)
        return f"Key '{key}' {where} is unknown{hint}; `vid2ev sensors {name}` lists the keys."
    default, value = _as_written(kind.spec.model_fields[key].default), reprlib.repr(complaint["input"])
    return f"{key} = {value} {where} is impossible: {first_said(error)} (default {default})."


def _as_written(default: Any) -> str:
    """A default as it is in a file; of words with the quotes of sentences."""
    return repr(default) if isinstance(default, str) else toml_value(default)


def _list(names: Sequence[str]) -> str:
    return ", ".join(names)
