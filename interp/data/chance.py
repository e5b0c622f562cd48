"""Chance as a function of what it is asked for: the same seed and name, the same draws, whoever asks and when."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

SMALLEST = 1e-12  # of what may be 0: a draw that is nearer to 0 than 1e-100, which no sensor takes, then never comes


def _rises(ends: tuple[float, float]) -> tuple[float, float]:
    if not -math.inf < ends[0] <= ends[1] < math.inf:
        raise ValueError(f"range {ends[0]:g} to {ends[1]:g}: expected two finite numbers, the lower one first")
    return ends


Range = Annotated[tuple[float, float], AfterValidator(_rises)]
Share = Annotated[float, Field(ge=0, le=1e6)]  # sums of them, and parts of sums, are neither infinite nor rounded away


def within(least: float, most: float) -> AfterValidator:
    """That both ends of a range lie between these; those of one that is drawn in the logarithm above 0."""
    first, words = (SMALLEST, f"0, or from {SMALLEST:g}") if least == 0 else (least, f"from {least:g}")

    def lies(ends: tuple[float, float]) -> tuple[float, float]:
        if not all(end == 0 == least or first <= end <= most for end in ends):
            raise ValueError(f"range {ends[0]:g} to {ends[1]:g}: expected both ends {words} to {most:g}")
        return ends

    return AfterValidator(lies)


def has_some(shares: Sequence[float]) -> bool:
    """Whether there is something to choose from in these proportions."""
    return sum(shares) >= SMALLEST


def chance(seed: int, *name: object) -> np.random.Generator:
    """A generator of its own (Philox) for a seed and a name, such as chance(0, "clip", 17); numbers of any type."""
    plain = tuple(int(part) if isinstance(part, np.integer) else part for part in (seed, *name))
    digest = hashlib.sha256(repr(plain).encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))


def uniform(draw: np.random.Generator, ends: Range) -> float:
    """Anywhere in a range."""
    return float(draw.uniform(*ends))


def log_uniform(draw: np.random.Generator, ends: Range) -> float:
    """The same in the logarithm; both ends are above 0."""
    low, high = ends
    return min(low * (high / low) ** float(draw.random()), high)  # (which rounding may exceed)


def one_of(draw: np.random.Generator, shares: Sequence[float]) -> int:
    """An index, with chances in these proportions."""
    ends = np.cumsum(shares)
    return int(np.searchsorted(ends, draw.random() * ends[-1], side="right"))
