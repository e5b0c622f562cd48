"""What pixels that go together do of each other: on a CPU each goes through its loops alone."""

from __future__ import annotations

from vid2ev.compiling.compiler import inner


@inner
def together():
    """Wait for the others."""


@inner
def rolled(times):
    """So many times, in a loop that need not be short of code."""
    return times


@inner
def anyone(does):
    """Whether any of those that go together does."""
    return does
