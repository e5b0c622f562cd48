"""Holes filled from the background around them.

From each pixel of a hole the nearest pixels without one are looked up to the left, to the right, above and below.  Of
these four, those on the farthest surface count, in proportion to 1 / distance**2: what opens up beside a thing in front
shows what is behind it.  Pixels that see nothing in their row or column take what their filled neighbours have.

What is filled in that way is streaked.  It is made smooth by means over three by three pixels of the hole and the same
surface, several times, of all pixels at once: streaks would flicker when things move.

The pixel at the rim of a hole is often a mixture with the thing in front, because the photograph's lens and pixels mix
there; `inset` looks so many pixels further on, where these are of the same surface.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vid2ev.compiling.cache import cached

F = np.float32
NOTHING = -1
ALIKE = F(1.05)  # inverse depths of one surface: up to so many times that of the farthest,
SPREAD = F(0.1)  # or up to this share of the way from the farthest to the nearest
FRINGE = F(0.02)  # what a sliver of background counts, too narrow to look `inset` pixels further on


class Fill(NamedTuple):
    """How holes are filled: each pixel as a sum of others, round by round, since later ones take from earlier ones."""

    rounds: tuple[int, ...]  # where in `holes` each round ends, 0 before the first
    holes: np.ndarray  # [n] flat index of the pixel
    sources: np.ndarray  # [n, 4] flat indices of those it is made of; -1 for none
    weights: np.ndarray  # [n, 4] float32, which sum to 1
    around: np.ndarray  # [n, 9] flat indices of pixels of the hole with which it is made smooth, itself among them
    shares: np.ndarray  # [n, 9] float32, which sum to 1


def fill_of(inverse: np.ndarray, inset: int = 0) -> Fill:
    """How to fill the pixels of inverse depth [h, w] float32 that are negative.  Nothing can be done if all are."""
    holes = np.flatnonzero(inverse < 0)
    if holes.size in (0, inverse.size):
        holes = holes[:0]
    found = np.array(inverse)
    rounds = [(holes[:0], np.zeros((0, 4), np.int64), np.zeros((0, 4), F))]
    while holes.size:
        hits = np.full((holes.size, 4), NOTHING, np.int64)
        _look_around(found, holes, hits)
        seen = (hits != NOTHING).any(axis=1)
        weights = np.zeros((holes.size, 4), F)
        _weigh(found, holes, hits, inset if len(rounds) == 1 else 0, weights)
        rounds.append((holes[seen], hits[seen], weights[seen]))
        _apply(*rounds[-1], found.reshape(-1, 1))
        holes = holes[~seen]
    ends = tuple(np.cumsum([len(filled) for filled, _, _ in rounds]).tolist())
    holes, sources, weights = (np.concatenate(parts) for parts in zip(*rounds, strict=True))
    around = np.full((holes.size, 9), NOTHING, np.int64)
    _find_around(inverse, found, holes, around)
    shares = (around != NOTHING).astype(F)
    return Fill(ends, holes, sources, weights, around, shares / shares.sum(axis=1, keepdims=True))


def apply_fill(fill: Fill, picture: np.ndarray, smoothings: int = 0) -> None:
    """Fill the holes of a picture [h, w, C] float32, contiguous, in place, and make smooth what is filled in."""
    if fill.holes.size:
        pixels = picture.reshape(-1, picture.shape[2])
        for first, last in pairwise(fill.rounds):
            _apply(fill.holes[first:last], fill.sources[first:last], fill.weights[first:last], pixels)
        for _ in range(smoothings):
            _apply(fill.holes, fill.around, fill.shares, pixels)


@cached
def _look_around(inverse, holes, hits):
    height, width = inverse.shape
    last = np.full(width, NOTHING, np.int64)  # in each column
    k = 0
    for y in range(height):
        left = NOTHING
        for x in range(width):
            if inverse[y, x] >= F(0):
                left, last[x] = y * width + x, y * width + x
            elif k < holes.size and holes[k] == y * width + x:
                hits[k, 0], hits[k, 2] = left, last[x]
                k += 1
    last[:] = NOTHING
    k = holes.size - 1
    for y in range(height - 1, -1, -1):
        right = NOTHING
        for x in range(width - 1, -1, -1):
            if inverse[y, x] >= F(0):
                right, last[x] = y * width + x, y * width + x
            elif k >= 0 and holes[k] == y * width + x:
                hits[k, 1], hits[k, 3] = right, last[x]
                k -= 1


@cached
def _weigh(inverse, holes, hits, inset, weights):
    height, width = inverse.shape
    depths = inverse.reshape(-1)
    for k in range(holes.size):
        y, x = holes[k] // width, holes[k] % width
        farthest, nearest = F(np.inf), F(0)
        for way in range(4):
            if hits[k, way] != NOTHING:
                farthest, nearest = min(farthest, depths[hits[k, way]]), max(nearest, depths[hits[k, way]])
        limit, total = max(ALIKE * farthest, farthest + SPREAD * (nearest - farthest)), F(0)
        for way in range(4):
            hit = hits[k, way]
            if hit == NOTHING:
                continue
            if depths[hit] > limit:
                hits[k, way] = NOTHING
                continue
            row, column = hit // width, hit % width
            away = max(abs(row - y), abs(column - x))
            weights[k, way] = F(1) / F(away * away)
            if inset:
                row += inset * ((way == 3) - (way == 2))
                column += inset * ((way == 1) - (way == 0))
                if 0 <= row < height and 0 <= column < width and F(0) <= inverse[row, column] <= ALIKE * depths[hit]:
                    hits[k, way] = row * width + column
                else:
                    weights[k, way] *= FRINGE
            total += weights[k, way]
        for way in range(4):
            weights[k, way] /= max(total, F(1e-30))


@cached
def _find_around(inverse, filled, holes, around):
    height, width = inverse.shape
    for k in range(holes.size):
        y, x = holes[k] // width, holes[k] % width
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                one, two = filled[y, x], filled[row, column]
                if inverse[row, column] < F(0) and max(one, two) <= ALIKE * min(one, two):
                    around[k, 3 * (row - y + 1) + column - x + 1] = row * width + column


@cached
def _apply(holes, sources, weights, pixels):
    filled = np.empty((holes.size, pixels.shape[1]), np.float32)
    for k in range(holes.size):
        for c in range(pixels.shape[1]):
            base, total = F(np.nan), F(0)
            for way in range(sources.shape[1]):
                if sources[k, way] != NOTHING:
                    light = pixels[sources[k, way], c]
                    if base != base:
                        base = light
                    total += weights[k, way] * (light - base)  # (differences: flat light stays exactly flat)
            filled[k, c] = base + total
    for k in range(holes.size):
        pixels[holes[k]] = filled[k]
