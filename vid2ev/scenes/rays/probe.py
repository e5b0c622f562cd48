"""Keys at any place of a picture, and where they change."""

from __future__ import annotations

import math

import numpy as np

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.meet import key_of, meet
from vid2ev.scenes.rays.pixel import shadows_of

HALVINGS = 9  # an edge is found to 1 / 1000 of a cell


@law
def ray_at(rays, x, y):
    """The ray (x, y, 1) through any place of the picture [px], from those through the centres of its pixels."""
    # (a GPU's floor is a float)
    column = min(max(np.int64(math.floor(x)) + 1, 0), rays.shape[1] - 2)
    line = min(max(np.int64(math.floor(y)) + 1, 0), rays.shape[0] - 2)
    right, low = x + 1.0 - column, y + 1.0 - line
    w00, w01 = (1.0 - right) * (1.0 - low), right * (1.0 - low)
    w10, w11 = (1.0 - right) * low, right * low
    return (
        w00 * rays[line, column, 0] + w01 * rays[line, column + 1, 0]
        + w10 * rays[line + 1, column, 0] + w11 * rays[line + 1, column + 1, 0],
        w00 * rays[line, column, 1] + w01 * rays[line, column + 1, 1]
        + w10 * rays[line + 1, column, 1] + w11 * rays[line + 1, column + 1, 1],
    )  # fmt: skip


@law
def key_at(world, rays, x, y, count, scratch):
    """The key and the depth at any place of the picture."""
    rx, ry = ray_at(rays, x, y)
    meeting = meet(world, scratch.things, count, rx, ry, scratch.stack)
    shadows = shadows_of(world, meeting, rx, ry, scratch.stack)
    return key_of(world, meeting[0], meeting[1], meeting[2], shadows, scratch.split[0]), meeting[1]


@law
def change_between(world, rays, x0, y0, x1, y1, key, next_key, count, scratch):
    """The share of the way from one place to another at which the key is no longer that of the first.

    Sets `scratch.odd` if it is not that of the second either: a third is between them.
    """
    low, high, beyond = 0.0, 1.0, next_key
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found, _ = key_at(world, rays, x0 + middle * (x1 - x0), y0 + middle * (y1 - y0), count, scratch)
        if found == key:
            low = middle
        else:
            high, beyond = middle, found
    if beyond != next_key:
        scratch.odd[0] = 1
    return 0.5 * (low + high)
