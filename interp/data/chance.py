"""Chance as a function of what it is asked for: the same seed and name, the same draws, whoever asks and when."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator


def _rises(ends: tuple[float, float]) -> tuple[float, float]:
    if not -math.inf < ends[0] <= ends[1] < math.inf:
        raise ValueError(f"range {ends[0]:g} to {ends[1]:g}: expected two finite numbers, the lower one first")
    return ends


Range = Annotated[tuple[float, float], AfterValidator(_rises)]


def chance(seed: int, *name: object) -> np.random.Generator:
    """A generator of its own (Philox) for a seed and a name, such as chance(0, "clip", 17)."""
    digest = hashlib.sha256(repr((seed, *name)).encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))


def uniform(draw: np.random.Generator, ends: Range) -> float:
    """Anywhere in a range."""
    return float(draw.uniform(*ends))


def log_uniform(draw: np.random.Generator, ends: Range) -> float:
    """The same in the logarithm; both ends are above 0."""
    low, high = ends
    return low * (high / low) ** float(draw.random())


def one_of(draw: np.random.Generator, shares: Sequence[float]) -> int:
    """An index, with chances in these proportions."""
    ends = np.cumsum(shares)
    return int(np.searchsorted(ends, draw.random() * ends[-1], side="right"))
