"""How many of the frames each method has: means over few of them say nothing beside means over all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from interp.evaluate.remarks import several
from interp.evaluate.report.numbers import number
from interp.evaluate.row import Row

Frame = tuple[int, str, int, int]


def frames_of(rows: Sequence[Row]) -> dict[str, set[Frame]]:
    """The frames that each method has."""
    found: dict[str, set[Frame]] = {}
    for row in rows:
        found.setdefault(row.method, set()).add((row.multiple, row.sequence, row.group, row.position))
    return found


def fullest(rows: Sequence[Row]) -> list[str]:
    """The methods that have the most frames, and the same ones: those that can be the best."""
    frames = frames_of(rows)
    alike = Counter(frozenset(own) for own in frames.values())
    most = max(alike, key=lambda own: (len(own), alike[own]), default=frozenset())
    return [method for method, own in frames.items() if own == most]


def shares(rows: Sequence[Row]) -> dict[str, str]:
    """How many of all frames each method has, in words; nothing where all have all of them."""
    frames = frames_of(rows)
    every = set[Frame]().union(*frames.values())
    if all(own == every for own in frames.values()):
        return {}
    return {method: f"{number(len(own), 0)} of {many(len(every), 'frame')}" for method, own in frames.items()}


def uneven(rows: Sequence[Row]) -> str:
    """That methods have scores of different frames, in a sentence; nothing where they have not."""
    told = shares(rows)
    if not told:
        return ""
    full = fullest(rows)
    others = several(f"{method} has {share}" for method, share in told.items() if method not in full)
    common = len(set.intersection(*frames_of(rows).values()))
    have = f"{many(common, 'frame')} {'has' if common == 1 else 'have'} those of all"
    best = "only methods with the most frames, and the same ones, can be the best"
    return f"Not all methods have scores of all frames: {others}; {have}; {best}."


def many(count: int, name: str) -> str:
    """A number of things that have a name."""
    return f"{number(count, 0)} {name}{'s' * (count != 1)}"
