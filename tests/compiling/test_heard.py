"""Whoever waits for something to be compiled hears of it, once, and not of what is there already."""

from __future__ import annotations

import io
import sys
from functools import partial

import numba
import pytest

from vid2ev.commands import progress
from vid2ev.compiling.heard import telling_of, waiting


class Terminal(io.StringIO):
    """What a terminal is sent."""

    def isatty(self) -> bool:
        return True


def outer():
    """A function that calls another one, neither of which has been compiled."""
    inner = numba.njit(lambda x: x + 1)
    return numba.njit(lambda x: 2 * inner(x))


def test_what_is_compiled_is_heard_of_once_with_all_that_it_calls() -> None:
    told, function = list[bool](), outer()
    with telling_of(told.append):
        assert function(1) == 4
        assert told == [True, False]
        assert function(2) == 6
        assert told == [True, False]
        with waiting():
            assert told == [True, False, True]
        assert told == [True, False] * 2
        with pytest.raises(numba.TypingError):
            function("one")
        assert told == [True, False] * 3
    assert outer()(1) == 4 and told == [True, False] * 3


@pytest.mark.parametrize("quiet", [False, True])
def test_a_conversion_on_a_terminal_says_that_kernels_are_compiled(
    monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    monkeypatch.setattr(progress, "bar_of", partial(progress.bar_of, disable=False))
    with progress.bar(quiet, lambda: False):
        with waiting():
            assert ("compiling kernels, once" in screen.getvalue()) is not quiet
        assert not screen.getvalue().rpartition("\r")[0].rpartition("\r")[2].strip()  # (and takes that away)
