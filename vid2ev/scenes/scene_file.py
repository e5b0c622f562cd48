"""Scene files by name: the predefined ones, a person's own TOML file, and `key=value` on top of either.

A key is the way to it: `scene.duration_s` or just `duration_s`, `camera.fov_deg`, `objects.NAME.count`,
`lights.NAME.flicker.frequency_hz`.  A value is written as in TOML, ranges too; a bare word is a string.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vid2ev.errors import DataError, UsageError, nearest
from vid2ev.requests import value_of
from vid2ev.scenes.complaints import sentence
from vid2ev.scenes.ranges import Chance, chance_of, drawn, extremes, is_range
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.textures import ANY, IN_COLOUR, PHOTOGRAPHS
from vid2ev.toml_text import parsed_toml
from vid2ev.untrusted import beside, read_text

PREDEFINED = Path(__file__).with_name("predefined")
LISTS = ("objects", "lights")
MOST = 1000  # of anything that has a count
MOST_OF_ALL = 5000
LARGEST_SEED = (1 << 63) - 1


@dataclass(frozen=True)
class SceneFile:
    """A scene file as read, with its ranges; `name` is what it was found by."""

    name: str
    path: Path
    tables: Mapping[str, Any]
    asked: frozenset[str] = frozenset()  # files that were asked for beside it, which may be anywhere

    def resolved(self, seed: int = 0) -> Scene:
        """The scene of a seed, every number settled.  Raises UsageError if there can be none."""
        if not 0 <= seed <= LARGEST_SEED:
            raise UsageError(f"{self.name}: seed {seed}, expected a whole number from 0 to 2**63 - 1")
        return self._scene(chance_of(seed))

    def check(self) -> None:
        """Draw all ranges at both their ends, and every choice.  Raises UsageError for what is impossible there."""
        for chance in extremes(self.tables):
            self._scene(chance)

    def title(self) -> str:
        """What the file says it is, on one line."""
        about = self.tables.get("about")
        return str(about.get("title", "")) if isinstance(about, Mapping) else ""

    def _scene(self, chance: Chance) -> Scene:
        try:
            tables = {
                name: list(self._things(name, table, chance)) if name in LISTS else drawn(table, chance, name)
                for name, table in self.tables.items()
            }
        except UsageError as error:
            raise UsageError(f"{self.name}: {error}") from error
        self._find_files(tables, chance)
        return scene_of_tables(tables, self.name)

    def _things(self, kind: str, things: Any, chance: Chance) -> Iterator[Any]:
        """Each of a list of objects or lights, as often as its count says."""
        if not isinstance(things, list) or not all(isinstance(thing, Mapping) for thing in things):
            raise UsageError(f"{kind} = {things!r}: expected tables, each under a line [[{kind}]]")
        names = [_name_of(thing, kind, index) for index, thing in enumerate(things)]
        total, given = 0, set[str]()
        for name, thing in zip(names, things, strict=True):
            if names.count(name) > 1:
                raise UsageError(f"{kind}.{name}: {names.count(name)} have this name; give each its own, or a count")
            path = f"{kind}.{name}"
            content = {key: value for key, value in thing.items() if key not in ("count", "name")}
            count = drawn(thing["count"], chance, f"{path}.count") if "count" in thing else 1
            if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= MOST:
                raise UsageError(f"{path}.count = {count!r}: expected a whole number from 0 to {MOST}")
            if (total := total + count) > MOST_OF_ALL:
                raise UsageError(f"{kind}: there are {total:,}; expected at most {MOST_OF_ALL:,} in all")
            for k in range(count):
                numbered = f"{name}-{k + 1}" if "count" in thing else name
                if numbered in given:
                    raise UsageError(f"{kind}.{numbered}: one of several of a count has this name; give another")
                given.add(numbered)
                yield {"name": numbered} | drawn(content, chance, f"{path}#{k}", (k, count))

    def _find_files(self, tables: dict[str, Any], chance: Chance) -> None:
        """Make names of files those of this folder; of a folder of photographs, one is drawn."""
        for table, key, where in files_named(tables):
            table[key] = self._found(table[key], chance, where)

    def _found(self, text: str, chance: Chance, path: str) -> str:
        if text in PHOTOGRAPHS:
            return text
        if text == ANY:
            return IN_COLOUR[int(chance(f"{path}.any") * len(IN_COLOUR))]
        file = (self.path.parent / text).absolute() if text in self.asked else beside(self.path, text)
        if file.is_dir() and path.endswith(("texture", "environment")):
            return str(_one_of(file, chance(f"{path}.any"), f"{self.name}: {path}"))
        if not file.is_file() and text in rigs_that_come_along():
            return str(PREDEFINED / text)
        if not file.is_file():
            names = f"; photographs that come along are {', '.join(PHOTOGRAPHS)}" if "texture" in path else ""
            hint = nearest(text, [*PHOTOGRAPHS, ANY]) if names else ""
            raise UsageError(f"{self.name}: {path} = '{text}'{hint}: no such file in {file.parent}{names}")
        return str(file)


def _name_of(thing: Mapping[str, Any], kind: str, index: int) -> str:
    """The name of an object or a light; one without is called by its own kind, unless this is left to chance."""
    own = thing.get("kind")
    return str(thing.get("name", f"{own if isinstance(own, str) else kind}-{index}"))


def files_named(tables: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str, str]]:
    """Where the tables of a scene name a file or a photograph: the table, its key, and both as a path."""
    for kind in LISTS:
        for thing in tables.get(kind, []):
            for key in ("texture", "file"):
                if isinstance(thing.get(key), str):
                    yield thing, key, f"{kind}.{thing.get('name')}.{key}"
    setting = tables.get("scene")
    for key in ("environment", "rig"):
        if isinstance(setting, dict) and isinstance(setting.get(key), str):
            yield setting, key, f"scene.{key}"


def scene_of_tables(tables: Mapping[str, Any], name: str) -> Scene:
    """The scene of settled tables, of a file of a name.  Raises UsageError, in a sentence, for what cannot be."""
    try:
        return Scene.model_validate(frozen(tables))
    except ValidationError as error:
        raise UsageError(sentence(error, tables, name, Scene)) from error


def frozen(node: Any) -> Any:
    """A tree with tuples in the place of lists."""
    if isinstance(node, Mapping):
        return {key: frozen(value) for key, value in node.items()}
    return tuple(map(frozen, node)) if isinstance(node, list | tuple) else node


def _one_of(folder: Path, u: float, where: str) -> Path:
    from vid2ev.light.recognise import PICTURE_SUFFIXES, pictures_in

    found = sorted(pictures_in(folder))
    if not found:
        raise UsageError(f"{where}: no pictures in {folder}; expected {', '.join(PICTURE_SUFFIXES)}")
    return found[int(u * len(found))]


def rigs_that_come_along() -> list[str]:
    """The names of the rigs of predefined scenes, which any scene file may name."""
    return sorted(path.relative_to(PREDEFINED).as_posix() for path in PREDEFINED.glob("rigs/*.toml"))


def scene_names() -> list[str]:
    """The names of the predefined scenes."""
    return sorted(path.stem for path in PREDEFINED.glob("*.toml"))


def read_scene(name_or_path: str | Path, settings: Sequence[str] = ()) -> SceneFile:
    """A scene file, changed by `key=value` texts, and checked at the ends of all its ranges.

    Raises UsageError for an unknown scene or key and for a value that cannot be, DataError for a file that is no TOML.
    """
    name, path = _find(str(name_or_path))
    try:
        tables = parsed_toml(read_text(path))
    except DataError:
        raise
    except OSError as error:
        raise DataError(f"scene {path} cannot be read ({error.strerror}); give a readable TOML file") from error
    except UnicodeDecodeError as error:
        raise DataError(f"scene {path} cannot be read (it is not UTF-8 text); give a TOML file") from error
    except ValueError as error:
        raise DataError(f"scene {path} is not valid TOML: {error}; correct that line") from error
    if isinstance(tables.get("camera"), list):  # (of a scene it is one table)
        raise UsageError(f"{path} is a rig file, not a scene; use it with vid2ev convert VIDEO --rig {path}")
    if not tables:
        raise UsageError(f"scene {path} says nothing: expected tables such as [scene], [camera] and [[objects]]")
    for text in settings:
        tables = changed(tables, text, name)
    asked = (value_of(text.partition("=")[2].strip()) for text in settings)
    file = SceneFile(name, path, tables, frozenset(value for value in asked if isinstance(value, str)))
    file.check()
    return file


def changed(tables: Mapping[str, Any], setting: str, name: str) -> dict[str, Any]:
    """The tables with one `key=value` set.  Raises UsageError."""
    key, equals, value = (part.strip() for part in setting.partition("="))
    if not equals or not key or not value:
        raise UsageError(f"setting '{setting}' is not of the form key=value; write for example duration_s=1")
    steps = key.split(".") if "." in key else ["scene", key]
    whole = copy.deepcopy(dict(tables))
    node: Any = whole
    for depth, step in enumerate(steps[:-1]):
        node = _entered(node, step, steps[:depth], f"{name}: setting '{setting}'")
    if not isinstance(node, dict) or is_range(node):
        raise UsageError(f"{name}: setting '{setting}': {'.'.join(steps[:-1])} is no table; set it as a whole")
    node[steps[-1]] = value_of(value)
    return whole


def plain_size(setting: str) -> str:
    """`size=640x480` as the setting of the camera that it means."""
    said = re.fullmatch(r"\s*(?:camera\.)?size\s*=\s*(\d{1,6})x(\d{1,6})\s*", setting)
    return f"camera.size=[{said[1]}, {said[2]}]" if said else setting


def _entered(node: Any, step: str, before: Sequence[str], where: str) -> Any:
    """The table below a step of a key; tables that are not there yet are made, things that are not there are not."""
    if isinstance(node, list):
        names = [str(thing.get("name", k)) if isinstance(thing, dict) else str(k) for k, thing in enumerate(node)]
        if step in names:
            return node[names.index(step)]
        there = f"{'.'.join(before)} are {', '.join(names)}" if names else f"the scene has no {'.'.join(before)}"
        raise UsageError(f"{where}: no '{step}'{nearest(step, names)}; {there}")
    if not isinstance(node, dict):
        raise UsageError(f"{where}: {'.'.join(before)} is no table; set it as a whole")
    return node.setdefault(step, [] if not before and step in LISTS else {})


def _find(name_or_path: str) -> tuple[str, Path]:
    names = scene_names()
    if name_or_path in names:
        return name_or_path, PREDEFINED / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if path.is_file():
        return str(path), path
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise UsageError(f"scene file {path} does not exist; give an existing TOML file or one of {', '.join(names)}")
    hint = nearest(name_or_path, names)
    raise UsageError(f"scene '{name_or_path}' is unknown{hint}; scenes are {', '.join(names)}, or give a TOML file")
