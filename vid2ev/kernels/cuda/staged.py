"""In the place of `vid2ev.kernels.sink`: keys wait in a few registers, and go to the events of all threads together.

The keys of a pixel come to lie in the order in which they were put, whatever other threads do between: a stable sort by
time and pixel leaves them so.  What finds no room is counted, and lost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.cuda.counter import take

STAGED = 4


class Staged(NamedTuple):
    """The keys of one thread."""

    waiting: np.ndarray  # uint64 [STAGED]
    keys: np.ndarray  # uint64, of all threads
    taken: np.ndarray  # int64 [1], how many of these
    base: np.uint64  # added to the keys of an interval


@inner
def room(out, n, more):
    """`out`, in which there always is."""
    return out


@inner
def put(out, n, key, sent):
    """A key waits with n others, if its event is `sent`; returns how many wait then."""
    if not sent:
        return n
    if n == STAGED:
        n = send_waiting(out, n)
    out.waiting[n] = key + out.base
    return n + np.int64(1)


@inner
def put_two(out, n, first, second, some):
    """The first `some` (0, 1, 2 or more) of two keys wait with n others; returns how many wait then."""
    n = put(out, n, first, some > 0)
    return put(out, n, second, some > 1)


@inner
def replace_last(out, n, key):
    """Another key in the place of the last, which still waits."""
    out.waiting[n - 1] = key + out.base


@inner
def send_waiting(out, n):
    """Send all that wait; returns how many wait then: none."""
    first = take(out.taken, 0, n)
    for i in range(n):
        if first + i < out.keys.size:
            out.keys[first + i] = out.waiting[i]
    return np.int64(0)
