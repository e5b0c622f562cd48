"""What is wrong with a scene file, in one sentence: the file, the key, the value, what is possible."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from vid2ev.errors import clause, nearest

TAGS = ("fixed", "straight", "spin", "orbit", "keyframes", "shake", "look-at", "str", "Pattern")  # of unions


def sentence(error: ValidationError, tables: Mapping[str, Any], name: str, scene: type[BaseModel]) -> str:
    """The first of pydantic's complaints about the tables of a file."""
    complaints = error.errors()
    # (of a value that may be several things, the complaint that went deepest knows best what was meant)
    first = complaints[0]["loc"]
    deep = 3 if isinstance(first[min(1, len(first) - 1)], int) else 2  # (of things in lists, by their numbers)
    complaint = max((c for c in complaints if c["loc"][:deep] == first[:deep]), key=lambda c: len(c["loc"]))
    path = _path(complaint["loc"], tables)
    kind, value = complaint["type"], reprlib.repr(complaint["input"])
    if kind == "extra_forbidden":
        last = path.rpartition(".")[2]
        hint = nearest(last, all_keys(scene) - {last})
        return f"{name}: key '{path}' is unknown{hint}; {_keys_there(complaint['loc'], scene)}"
    if kind == "missing":
        return f"{name}: {path} is missing; give it a value"
    if kind == "union_tag_not_found":
        return f"{name}: {path} has no kind; give it one of {_tags(complaint)}"
    if kind == "union_tag_invalid":
        tag = complaint.get("ctx", {}).get("tag")
        return f"{name}: {path}.kind = {tag!r} is impossible: it must be one of {_tags(complaint)}"
    if isinstance(complaint["input"], dict):
        return f"{name}: {path}: {clause(complaint['msg'])}"
    return f"{name}: {path} = {value} is impossible: {clause(complaint['msg'])}"


@cache
def all_keys(scene: type[BaseModel]) -> frozenset[str]:
    """The keys of all tables of a scene file."""
    return frozenset({"count", *scene.model_fields}.union(*(part.model_fields for part in _parts())))


@cache
def _parts() -> tuple[type[BaseModel], ...]:
    """All kinds of tables."""
    from vid2ev.scenes.part import Part

    found: list[type[BaseModel]] = [Part]
    for part in found:
        found += part.__subclasses__()
    return tuple(found)


def _keys_there(loc: tuple[int | str, ...], scene: type[BaseModel]) -> str:
    """The keys of the table in which a key stands."""
    tables: list[type[BaseModel]] = [scene]
    for step in loc[:-1]:
        if isinstance(step, str):
            chosen = [part for part in _parts() if step in (part.__name__, _kind(part))]  # (of a union)
            fields = [table.model_fields[step] for table in tables if step in table.model_fields]
            tables = chosen or [part for field in fields for part in _parts_of(field.annotation)] or tables
    return f"the keys are {', '.join(dict.fromkeys(key for table in tables for key in table.model_fields))}"


def _kind(part: type[BaseModel]) -> object:
    """The kind that makes a table of a union this one."""
    kinds = get_args(part.model_fields["kind"].annotation) if "kind" in part.model_fields else ()
    return kinds[0] if len(kinds) == 1 else None


def _parts_of(annotation: object) -> list[type[BaseModel]]:
    """The tables that a field may hold."""
    if isinstance(annotation, type) and annotation in _parts():
        return [annotation]
    return [part for inner in get_args(annotation) for part in _parts_of(inner)]


def _path(loc: tuple[int | str, ...], tables: Any) -> str:
    """Where in the file: entries of lists by their names, if they have some."""
    words: list[str] = []
    node: Any = tables
    for step in loc:
        if isinstance(node, list) and isinstance(step, int):
            node = node[step] if step < len(node) else None
            words.append(str((node.get("name") if isinstance(node, Mapping) else None) or step))
        elif isinstance(node, Mapping) and step in node:
            node = node[step]
            words.append(str(step))
        elif not isinstance(step, str) or (step not in TAGS and not step.startswith("function-")):
            words.append(str(step))
    return ".".join(words) or "the file"


def _tags(complaint: Any) -> str:
    return str(complaint.get("ctx", {}).get("expected_tags", ", ".join(TAGS[:7]))).replace("'", "")
