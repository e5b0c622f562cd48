"""Counters that threads share: simulated, where one thread runs at a time."""

from __future__ import annotations

from vid2ev.compiling.compiler import inner


@inner
def take(counter, place, some):
    """Add `some` to an entry of a counter; returns what it was."""
    before = counter[place]
    counter[place] += some
    return before
