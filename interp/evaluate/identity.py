"""What tells one thing to be evaluated from another, wherever it lies."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

HEAD = 1 << 20  # bytes of the beginning of a file by which it is known


def contents(path: Path) -> dict[str, Any]:
    """Files, bytes and a digest of a file, or of the names and sizes of all files in a folder; times do not count, so
    that a copy is the same."""
    files = sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path]
    sizes = [(each.relative_to(path).as_posix(), each.stat().st_size) for each in files]
    digest = hashlib.sha256(repr(sizes).encode())
    if files:
        with open(files[0], "rb") as file:
            digest.update(file.read(HEAD))
    return {"files": len(files), "bytes": sum(size for _, size in sizes), "sha256": digest.hexdigest()}


def plain(name: str) -> str:
    """A name that can be that of a file."""
    return re.sub(r"[^\w.=+-]+", "-", name).strip("-.") or "unnamed"


def apart(names: list[str]) -> list[str]:
    """Names that can be those of files, the second of one name with a number."""
    found = list[str]()
    for name in map(plain, names):
        other, number = name, 2
        while other in found:
            other, number = f"{name}_{number}", number + 1
        found.append(other)
    return found
