"""Names of what is evaluated: those that can be those of files, and short ones."""

from __future__ import annotations

import hashlib
import re

LONGEST = 120  # bytes; 255 are what disks take, and names of pictures have more than this in them


def plain(name: str) -> str:
    """A name that can be that of a file; of a long one the beginning, and what tells it from others."""
    found = re.sub(r"[^\w.=+-]+", "-", name).strip("-.") or "unnamed"
    if len(coded := found.encode()) <= LONGEST:
        return found
    digest = hashlib.sha256(name.encode()).hexdigest()[:8]
    return f"{coded[: LONGEST - 9].decode(errors='ignore')}-{digest}"


def apart(names: list[str]) -> list[str]:
    """Names that can be those of files, the second of one name with a number."""
    found = list[str]()
    for name in map(plain, names):
        other, number = name, 2
        while other in found:
            other, number = f"{name}_{number}", number + 1
        found.append(other)
    return found


def shortened(name: str, letters: int) -> str:
    """A name of so many letters at most, without its middle: names that begin alike differ at their ends."""
    if len(name) <= letters:
        return name
    end = (letters - 1) // 2
    return f"{name[: letters - 1 - end]}…{name[len(name) - end :]}"
