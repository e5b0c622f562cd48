"""Names of what is evaluated that can be those of files."""

from __future__ import annotations

import re


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
