"""What is done of an evaluation, on disk, so that one that was interrupted goes on to the same bytes.

    job.json                       what decides all numbers; only the same is continued
    kept/SEQUENCE/METHOD.jsonl     a line for each group, when it is done: {"group": 3, "rows": [[...], ...]}
    kept/SEQUENCE/about.json       what is known of the sequence; there when it is done

A line is written at once and brought to the disk; half a line at the end, of a kill, is cut off.  What fails before the
first line leaves nothing.
"""

from __future__ import annotations

import json
import math
import operator
import os
import reprlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, get_type_hints

from interp.evaluate.row import Row
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing
from vid2ev.recording.held import LOCK, Held
from vid2ev.recording.manifest import as_stated, difference
from vid2ev.untrusted import json_of, read_text

JOB = "job.json"
KEPT = "kept"
ABOUT = "about.json"


class KeptRows:
    """The rows in the folder of an evaluation; one process at a time writes those of a sequence."""

    def __init__(self, folder: Path):
        self.folder = folder

    def rows(self, sequence: str, method: str) -> dict[int, list[Row]]:
        """The rows of each group that is done; what was written in part is cut off.  Raises DataError."""
        path = self._path(sequence, method)
        if not path.exists():
            return {}
        whole, _, rest = path.read_bytes().rpartition(b"\n")
        if rest:
            with writing(path, THEN_RESUME):
                os.truncate(path, len(whole) + bool(whole))
        try:
            lines = [json_of(line) for line in whole.splitlines()]
            return {operator.index(line["group"]): [row_of(values) for values in line["rows"]] for line in lines}
        except (ValueError, TypeError, KeyError) as error:
            said = str(error)[:200].replace("\n", " ")
            raise DataError(f"{path} cannot be read ({said}); remove it, and it is made again") from error

    def add(self, sequence: str, method: str, group: int, rows: Sequence[Row]) -> None:
        """The rows of a group are done."""
        path = self._path(sequence, method)
        with writing(path, THEN_RESUME):
            path.parent.mkdir(parents=True, exist_ok=True)
            with open(path, "ab") as file:
                file.write(_line({"group": group, "rows": [values_of(row) for row in rows]}))
                file.flush()
                os.fsync(file.fileno())

    def forget(self, sequence: str, method: str) -> None:
        """The rows of a method are to be made again."""
        path = self._path(sequence, method)
        with writing(path, THEN_RESUME):
            path.unlink()

    def about(self, sequence: str) -> dict[str, Any] | None:
        """What is known of a sequence all groups of which are done for some methods; None before.  Raises DataError."""
        path = self.folder / KEPT / sequence / ABOUT
        if not path.exists():
            return None
        found = _read(path, f"remove {path.parent}, and it is made again")
        with as_stated(path):
            if min(operator.index(count) for count in (found["groups"], *dict(found["missing"]).values())) < 0:
                raise ValueError("a count below zero")
            if dict(found["unfit"]).keys() != dict(found["missing"]).keys():
                raise ValueError("not the same methods throughout")
        return found

    def finish(self, sequence: str, about: Mapping[str, Any]) -> None:
        """A sequence is done; `about` says for which methods."""
        with writing(self.folder, THEN_RESUME):
            (self.folder / KEPT / sequence).mkdir(parents=True, exist_ok=True)
            with whole_file(self.folder / KEPT / sequence / ABOUT) as file:
                file.write(_line(about))

    def _path(self, sequence: str, method: str) -> Path:
        return self.folder / KEPT / sequence / f"{method}.jsonl"


class Kept(KeptRows):
    """The folder of an evaluation, as a context: no other process writes it meanwhile.

    job       what decides all numbers, ready for JSON
    methods   what decides those of each method, by their names; others may be added later
    Raises UsageError where the folder is taken, or was begun with something else, DataError where it cannot be written.
    """

    def __init__(self, folder: Path, job: Mapping[str, Any], methods: Mapping[str, Any], resume: bool):
        super().__init__(folder)
        wanted = json.loads(json.dumps({**job, "methods": methods}))
        _known_methods(folder, wanted, resume)  # (before anything is written where something else is)
        self._begins = False
        with writing(folder):
            self._held = Held(folder)
            self._held.take()
            try:
                known = _known_methods(folder, wanted, resume)  # (another may have begun there until now)
                self._begins = not (folder / JOB).exists()
                with whole_file(folder / JOB) as file:
                    file.write(_line(wanted | {"methods": known | wanted["methods"]}))
            except BaseException:
                self._leave(nothing=self._begins)
                raise

    def __enter__(self) -> Kept:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._leave(nothing=kind is not None and self._begins and not any((self.folder / KEPT).rglob("*.jsonl")))

    def _leave(self, nothing: bool) -> None:
        """Let others at the folder, after `nothing` was done there as it was before."""
        for each in self.folder.iterdir() if nothing else ():
            if each.is_dir():
                shutil.rmtree(each, ignore_errors=True)
            elif each.name != LOCK:
                each.unlink(missing_ok=True)
        self._held.close()


def _known_methods(folder: Path, wanted: Mapping[str, Any], resume: bool) -> dict[str, Any]:
    """What decides the numbers of the methods that a folder knows.  Raises UsageError where it is taken, or was begun
    with something else than is wanted."""
    if not (folder / JOB).exists():
        # (what is left of an evaluation that was killed before it had begun is no reason not to begin)
        if folder.exists() and {each.name for each in folder.iterdir()} - {LOCK, f"{JOB}.new"}:
            raise UsageError(f"{folder} holds something else; choose another folder with -o")
        return {}
    if not resume:
        raise UsageError(f"{folder} holds an evaluation; --resume goes on with it, or choose another with -o")
    before = read_job(folder)
    known: dict[str, Any] = before["methods"]
    shared = {name: of for name, of in wanted["methods"].items() if name in known}
    begun, asked = (before | {"methods": {name: known[name] for name in shared}}, {**wanted, "methods": shared})
    if changed := difference(begun, asked):
        raise UsageError(f"{folder} was begun with {changed}; --resume needs the same, or choose another with -o")
    return known


def read_job(folder: Path) -> dict[str, Any]:
    """The job of an evaluation.  Raises DataError."""
    remedy = f"remove {folder} and evaluate again"
    found = _read(folder / JOB, remedy)
    if not isinstance(found.get("methods"), dict):
        raise DataError(f"{folder / JOB} names no methods; {remedy}")
    return found


def _read(path: Path, remedy: str) -> dict[str, Any]:
    try:
        found = json_of(read_text(path))
    except (OSError, ValueError) as error:
        raise DataError(f"{path} cannot be read ({str(error)[:200]}); {remedy}") from error
    if not isinstance(found, dict):
        raise DataError(f"{path} holds no names with values; {remedy}")
    return found


def values_of(row: Row) -> list[Any]:
    """The values of a row, ready for JSON: None for NaN."""
    return [None if isinstance(value, float) and math.isnan(value) else value for value in astuple(row)]


def row_of(values: Sequence[Any]) -> Row:
    """The row of `values_of`.  Raises TypeError for values of another length."""
    names = [each.name for each in fields(Row)]
    if len(values) != len(names):
        raise TypeError(f"{len(values)} values, expected {len(names)}")
    known: list[Any] = [math.nan if value is None else value for value in values]
    row = Row(**dict(zip(names, known, strict=True)))
    for name, kind in get_type_hints(Row).items():
        value = getattr(row, name)
        if not isinstance(value, (int, float) if kind is float else kind) or isinstance(value, bool):
            raise TypeError(f"{name} = {reprlib.repr(value)}")
    return row


def _line(facts: Mapping[str, Any]) -> bytes:
    return f"{json.dumps(facts, allow_nan=False)}\n".encode()
