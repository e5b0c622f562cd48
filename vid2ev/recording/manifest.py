"""manifest.json: everything that made a recording.

Its keys, but for `run`, are the same for every run with the same result; `run` says when, where and how fast.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.untrusted import json_of, read_text

JOB = "job.json"  # what is made, and nothing else, while it is
OF_A_PART = ("part", "since_ns")  # what a job has only where it is not of all pixels, or all of the time
LONGEST = 100  # characters of a value that is not as it was
LIBRARIES = ("vid2ev", "numpy", "numba", "av", "opencv-contrib-python-headless", "h5py")
HEAD, LEAST = 1 << 20, 4096  # bytes of all beginnings by which files are known, and of each at least; of ends as many


def versions(more: Sequence[str] = ()) -> dict[str, str]:
    """The versions of what takes part in making events, and of more distributions."""
    return {"python": platform.python_version()} | {name: _version(name) for name in (*LIBRARIES, *more)}


def machine() -> dict[str, Any]:
    """Where the run took place."""
    return {"system": platform.platform(), "processor": _processor(), "cores": os.cpu_count()}


def identity(path: Path, *, copies: bool = False, deep: bool = False, besides: Collection[Path] = ()) -> dict[str, Any]:
    """What tells a file or a folder of files from another: bytes, time of change, and a digest of the names, the sizes,
    the beginnings and the ends of all of them.

    copies   a copy is the same: without the time of change
    deep     with the folders in a folder
    besides  files and folders that are no part of it, wherever they are: what is made of it may be put there
    """
    within = path.rglob("*") if deep else path.iterdir() if path.is_dir() else ()
    others = {Path(os.path.realpath(other)) for other in besides}  # (of links in a ring, Path's raises)
    files = sorted(child for child in within if child.is_file()) if path.is_dir() else [path]
    if others:
        files = [file for file in files if not others & {(whole := file.resolve()), *whole.parents}]
    stats = [file.stat() for file in files]
    sizes = [(file.relative_to(path).as_posix(), stat.st_size) for file, stat in zip(files, stats, strict=True)]
    digest, part = hashlib.sha256(repr(sizes).encode()), max(HEAD // max(len(files), 1), LEAST)
    for file, stat in zip(files, stats, strict=True):
        with open(file, "rb") as content:
            digest.update(content.read(part))
            content.seek(max(part, stat.st_size - part))
            digest.update(content.read(part))
    changed = {} if copies else {"changed_ns": max((stat.st_mtime_ns for stat in stats), default=0)}
    return {"bytes": sum(stat.st_size for stat in stats), **changed, "sha256": digest.hexdigest()}


def sha256(path: Path) -> str:
    """The digest of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_manifest(path: Path, manifest: Mapping[str, Any]) -> None:
    """Write a manifest; raises OSError."""
    path.write_text(json.dumps(manifest, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def read_manifest(path: Path) -> dict[str, Any]:
    """Read the manifest of a recording folder, or a file; raises DataError."""
    path = path / "manifest.json" if path.is_dir() else path
    try:
        manifest = json_of(read_text(path))
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file; give a folder that `vid2ev convert` wrote") from error
    except DataError:
        raise
    except (OSError, ValueError) as error:
        raise DataError(f"{path} cannot be read as JSON ({error}); make the recording again") from error
    stated = manifest.get("versions") if isinstance(manifest, dict) else None
    if not isinstance(stated, dict) or "vid2ev" not in stated:
        raise DataError(f"{path} is not the manifest of a vid2ev recording; give a folder that `vid2ev convert` wrote")
    return manifest


def is_recording(folder: Path) -> bool:
    """Whether a folder is a recording, by its manifest; others have files of that name, too."""
    try:
        read_manifest(folder / "manifest.json")
    except DataError:
        return False
    return True


@contextmanager
def as_stated(path: Path) -> Iterator[None]:
    """What a manifest or a journal lacks, or has of another kind, becomes one sentence: DataError."""
    try:
        yield
    except Vid2evError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        said = f"{type(error).__name__}: {error}"[:100].replace("\n", " ")
        raise DataError(f"{path} does not say what it should ({said}); it is damaged: make it again") from error


def is_of_job(path: Path, job: Mapping[str, Any], output: Path, overwrite: bool) -> bool:
    """Whether the job or manifest in a file is of this job; if it is not, that is a UsageError unless `output` may be
    overwritten."""
    earlier = read_manifest(path)
    known = {*earlier} if path.name == JOB else {*job, *OF_A_PART}  # (a manifest says what came of it, too)
    changed = difference({key: earlier[key] for key in earlier if key in known}, job)
    if changed and not overwrite:
        raise UsageError(
            f"{output} was begun with {changed}; --resume needs the options it was begun with, --overwrite starts again"
        )
    return not changed


def difference(one: Any, other: Any, name: str = "") -> str:
    """The first value that differs between two pieces of JSON, as "name = one, not other"; empty if none does."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in [*one, *(key for key in other if key not in one)]:
            found = difference(one.get(key), other.get(key), f"{name}.{key}" if name else key)
            if found:
                return found
        return ""
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        pairs = enumerate(zip(one, other, strict=True))
        return next(filter(None, (difference(*pair, f"{name}[{_place(k, *pair)}]") for k, pair in pairs)), "")
    return "" if one == other else f"{name} = {_short(one)}, not {_short(other)}"


def _place(index: int, one: Any, other: Any) -> int | str:
    """What tells an element of a list from the others: its name, if it has the same in both."""
    names = [each.get("name") if isinstance(each, dict) else None for each in (one, other)]
    return names[0] if isinstance(names[0], str) and names[0] == names[1] else index


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


@cache
def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
