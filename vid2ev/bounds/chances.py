"""What chance makes of a mean: numbers that are exceeded in less than 1 of 1000 cases, as 99.9 % bounds are.

What changes in one pixel is independent of what does in another.  A pixel changes from one of its events on, each as
likely to be the first as any other, or is another one from the beginning (`whole`).  So of m events it adds a number
that is even on 0 to m, with the chance 2 mu / m, or m with the chance mu / m, where mu is the mean.  For the sum of all
there are two bounds, of which the lesser counts:

    P(sum X > t) <= exp(sum log E exp(l X) - l t)   for all l > 0 (H. Chernoff), with
    log E exp(l X) <= 2 mu ((exp(l m) - 1) / (l m) - 1) / m   and   mu (exp(l m) - 1) / m

and, of pixels that change from one of their events on, where that is rare, their distribution: X is no more than the
sum of as many numbers as one of Poisson's says, of mean -log(1 - chance); numbers are rounded up to a grid, and their
sum is had by Fourier's transform.  The grid wraps around, and so all is weighed by exp(-20 x) before, which leaves 2e-9
of what comes round.

Sources: H. Chernoff, Annals of Mathematical Statistics 23, 1952; P. Embrechts and M. Frei, "Panjer recursion versus FFT
for compound distributions", Mathematical Methods of Operations Research 69, 2009, for weights by exponentials.
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev.bounds.scene import Scene

RARE = math.log(1000)  # a chance of 1 in 1000
CELLS = 1 << 14
WEIGHED = 20.0
FEW = 512  # events of a pixel: more are counted to a share of this
OFTEN = 0.4  # a pixel may change with a chance of this at most for the distribution to be looked at


def surely(scene: Scene, mean: float, share: float = 1.0, *, whole: bool = False) -> float:
    """The 99.9 % bound on a distance of this mean.  Of all pixels a share, or more, sends what is expected of it, the
    others nothing; infinite if that may be none."""
    if scene.still or mean == 0.0:
        return mean
    if share <= 0.0:
        return math.inf
    most, sent = _pixels(scene)
    means = mean * sent
    events, chance = _chernoff(most, share * means, whole), 2.0 * mean
    if chance < OFTEN and not whole:
        of_all = _chernoff(most, means, whole)  # (of fewer pixels no more change)
        events = min(events, _counted(most, means * (-math.log1p(-chance) / chance), of_all), of_all)
    return max(events / (share * scene.events), mean)  # (what changes every event a little is its mean)


def _pixels(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """How many events pixels send at most, and how many all those together that send so many: of busy ones to three
    digits, so that there are few."""
    numbers, travel = scene.by_pixel
    of = np.where(numbers < FEW, numbers, FEW + np.ceil(FEW * np.log2(np.maximum(numbers, FEW) / FEW)))
    _, first, group = np.unique(of[::-1], return_index=True, return_inverse=True)
    most = numbers[::-1][first] + 2.0
    return most, np.bincount(group, travel[::-1]) / scene.threshold


def _chernoff(most: np.ndarray, means: np.ndarray, whole: bool) -> float:
    """A sum that is exceeded by a chance of 1 in 1000 at most [events]."""
    tries = np.geomspace(1e-6, 20.0, 300)[:, None] / most.max()
    grown = np.expm1(tries * most)
    each = grown if whole else 2.0 * (grown / (tries * most) - 1.0)
    return float((((means / most * each).sum(axis=1) + RARE) / tries[:, 0]).min())


def _counted(most: np.ndarray, means: np.ndarray, limit: float) -> float:
    """The same by the distribution on a grid that reaches beyond a limit."""
    cell = 2.0 * limit / CELLS
    last = np.minimum(np.ceil(most / cell), CELLS - 1).astype(np.int64)
    rates = 2.0 * means / most
    each = rates * np.minimum(cell / most, 1.0)  # of the cells before the last
    by_cell = np.zeros(CELLS + 1)
    by_cell[1] = each.sum()
    np.subtract.at(by_cell, last, each)
    by_cell = np.cumsum(by_cell)
    np.add.at(by_cell, last, rates - each * (last - 1))
    by_cell, weights = by_cell[:CELLS], np.exp(-WEIGHED / CELLS * np.arange(CELLS))
    chances = np.fft.irfft(np.exp(np.fft.rfft(by_cell * weights) - by_cell.sum()), CELLS) / weights
    return cell * float(np.searchsorted(np.cumsum(chances), 1.0 - math.exp(-RARE)))


def at_most(mean: float) -> float:
    """A number that one of Poisson's exceeds in less than 1 of 1000 cases."""
    return mean + math.sqrt(2.0 * RARE * mean) + RARE / 1.5 if mean > 0 else 0.0


def at_least(mean: float) -> float:
    """A number that one of Poisson's falls short of in less than 1 of 1000 cases."""
    return max(mean - math.sqrt(2.0 * RARE * mean), 0.0)
