"""Ranges: what a scene file leaves to chance, drawn anew for every seed.

    { uniform = [a, b] }       anywhere from a to b
    { log_uniform = [a, b] }   the same in the logarithm, 0 < a <= b
    { normal = [mean, sd] }    Gaussian, cut off at 3 sd on both sides
    { integer = [a, b] }       a whole number, both ends included
    { choice = [x, y, ...] }   one of these, which may have ranges in them
    { direction = length }     a vector of this length, anywhere on the sphere
    { spread = [a, b] }        for things with a count n: each its own n-th of a to b, in an order left to chance

A range stands wherever a value may.  The ends of all but `choice` and `direction` may be lists of one length, whose
numbers are drawn one by one: { uniform = [[-1, -1, 2], [1, 1, 4]] } is a place in a box.

A draw is a function of the seed and of the path of its key alone,

    u = SHA-256("seed path") / 2**256,

so that changing, adding or leaving out one range leaves all others as they are.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterator, Mapping
from statistics import NormalDist
from typing import Any

from vid2ev.errors import UsageError

Chance = Callable[[str], float]  # a number 0 <= u < 1 for a path; thing k of those with a count has #k in its path
Place = tuple[int, int]  # which of how many things with a count, from 0

BELOW_ONE = math.nextafter(1.0, 0.0)
SIGMAS = 3.0
PAIRS = ("uniform", "log_uniform", "normal", "integer", "spread")
KINDS = (*PAIRS, "choice", "direction")


def chance_of(seed: int) -> Chance:
    """The draws of a seed."""

    def chance(path: str) -> float:
        digest = hashlib.sha256(f"{seed} {path}".encode()).digest()
        return int.from_bytes(digest[:8], "big") // 2**11 / 2**53

    return chance


def extremes(tree: Any) -> Iterator[Chance]:
    """Draws that between them take both ends of all ranges in a tree, and every choice."""
    for ways in dict.fromkeys([(0.0,), *_ways(tree), (BELOW_ONE,)]):
        # (of what is chosen among what was chosen, the path tells how deep it is)
        yield lambda path, ways=ways: ways[min(path.count(".choice"), len(ways) - 1)]  # type: ignore[misc]


def is_range(node: Any) -> bool:
    """Whether a value of a file is a range."""
    return isinstance(node, Mapping) and len(node) == 1 and next(iter(node)) in KINDS


def drawn(node: Any, chance: Chance, path: str, place: Place = (0, 1)) -> Any:
    """A tree of tables, lists and values with all its ranges drawn.  Raises UsageError for a range that is none."""
    if is_range(node):
        return _draw(next(iter(node)), next(iter(node.values())), chance, path, place)
    if isinstance(node, Mapping):
        return {key: drawn(value, chance, f"{path}.{key}".lstrip("."), place) for key, value in node.items()}
    if isinstance(node, list):
        return [drawn(value, chance, f"{path}.{index}", place) for index, value in enumerate(node)]
    return node


def _draw(kind: str, ends: Any, chance: Chance, path: str, place: Place) -> Any:
    if kind == "choice":
        if not isinstance(ends, list) or not ends:
            raise UsageError(f"{path} = {{ choice = {ends!r} }}: expected a list of one or more things to choose from")
        return drawn(ends[int(chance(path) * len(ends))], chance, f"{path}.choice", place)
    if kind == "direction":
        if not _is_number(ends) or ends < 0:
            raise UsageError(f"{path} = {{ direction = {ends!r} }}: expected the length of the vector, from 0")
        return _direction(float(ends), chance, path)
    low, high = _ends(kind, ends, path)
    if isinstance(low, list):
        pairs = enumerate(zip(low, high, strict=True))
        return [_number(kind, one, other, chance, f"{path}.{axis}", place) for axis, (one, other) in pairs]
    return _number(kind, low, high, chance, path, place)


def _number(kind: str, low: Any, high: Any, chance: Chance, path: str, place: Place) -> float | int:
    u = chance(path)
    if kind == "spread":
        u = (_rank(chance, path, place) + u) / place[1]
    if kind == "integer":
        return min(low + int(u * (high - low + 1)), high)
    if kind == "normal":
        tail = NormalDist().cdf(-SIGMAS)
        return low + high * NormalDist().inv_cdf(tail + u * (1 - 2 * tail))
    if kind == "log_uniform":
        return min(low * (high / low) ** u, high)  # (rounding leads beyond the end)
    return low + (high - low) * u


def _rank(chance: Chance, path: str, place: Place) -> int:
    """The place of a thing among its like, in an order of this path's own."""
    k, n = place
    stem = re.sub(r"(.*)#\d+", r"\1", path, flags=re.DOTALL)  # (the last one: names may have some of their own)
    keys = [(chance(f"{stem} order {other}"), other) for other in range(n)]
    return sorted(keys).index(keys[k])


def _direction(length: float, chance: Chance, path: str) -> list[float]:
    """Even on the sphere: height and angle are even (Archimedes)."""
    height, angle = 2 * chance(f"{path}.0") - 1, 2 * math.pi * chance(f"{path}.1")
    across = math.sqrt(1 - height * height)
    return [length * across * math.cos(angle), length * across * math.sin(angle), length * height]


def _ends(kind: str, ends: Any, path: str) -> tuple[Any, Any]:
    wanted = "a mean and a standard deviation from 0" if kind == "normal" else "a lower and an upper end"
    if isinstance(ends, list) and len(ends) == 2:
        low, high = ends
        same = isinstance(low, list) and isinstance(high, list) and len(low) == len(high) > 0
        pairs = list(zip(low, high, strict=True)) if same else [(low, high)]
        if all(_fits(kind, one, other) for one, other in pairs):
            return low, high
    numbers = " of whole numbers" * (kind == "integer") + " above 0" * (kind == "log_uniform")
    raise UsageError(f"{path} = {{ {kind} = {ends!r} }}: expected two ends{numbers}, {wanted}")


def _fits(kind: str, low: Any, high: Any) -> bool:
    if not (_is_number(low) and _is_number(high)):
        return False
    if kind == "integer":
        return isinstance(low, int) and isinstance(high, int) and low <= high
    return high >= 0 if kind == "normal" else (low > 0 or kind != "log_uniform") and low <= high


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _ways(node: Any, before: tuple[float, ...] = ()) -> Iterator[tuple[float, ...]]:
    """The draws, one for each choice within the last, that lead to either end of each range in a tree."""
    things = node.get("choice") if is_range(node) else None
    if isinstance(things, list):
        for k, thing in enumerate(things):
            way = (*before, (k + 0.5) / len(things))
            yield way
            yield from _ways(thing, way)
    elif is_range(node):
        yield from ((*before, end) for end in (0.0, BELOW_ONE))
    elif isinstance(node, Mapping | list):
        for child in node.values() if isinstance(node, Mapping) else node:
            yield from _ways(child, before)
