"""Where keys of events go: an array that grows, and how many of its entries are taken."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner


@inner
def room(out, n, more):
    """`out`, or a copy of at least twice the length where `more` keys after n would not fit."""
    if n + more <= out.size:
        return out
    longer = np.empty(max(2 * out.size, n + more), np.uint64)
    for i in range(n):  # (a slice would compile numpy's broadcasting, and its words for errors)
        longer[i] = out[i]
    return longer


@inner
def put(out, n, key, sent):
    """Put a key at n, where there is room; returns n, past it if the event is `sent`."""
    out[n] = key
    return n + np.int64(sent)


@inner
def put_two(out, n, first, second, some):
    """Put two keys at n, where there is room; returns n past the first `some` (0, 1, 2 or more) of them."""
    out[n], out[n + 1] = first, second
    return n + min(some, 2)


@inner
def replace_last(out, n, key):
    """Another key in the place of that before n."""
    out[n - 1] = key
