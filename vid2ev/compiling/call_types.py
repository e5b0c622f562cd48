"""What numba answers when it is asked for the type of a call, kept: to ask anew takes a sixth of a compilation.

For `a + b` alone numba goes through what it has for numbers, strings, lists and sets, each time that it comes by one.
The answer depends on the types of the arguments and on how the caller is compiled; for functions of numba's own it is
always the same.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from numba.core.targetconfig import ConfigStack
from numba.core.types.functions import BaseFunction

_ask = BaseFunction.get_call_type


@contextlib.contextmanager
def kept_call_types() -> Iterator[None]:
    """Within it numba is asked for the type of a call once."""
    before = BaseFunction.get_call_type  # (one function is compiled while another is)
    BaseFunction.get_call_type = _kept  # type: ignore[assignment, method-assign]
    try:
        yield
    finally:
        BaseFunction.get_call_type = before  # type: ignore[method-assign]


class _Ways:
    """Numbers of the ways in which functions are compiled; comparing two of them takes as long as numba's answer."""

    def __init__(self) -> None:
        self._seen: list[Any] = []
        self._last: tuple[Any, int] = (None, -1)

    def number(self, flags: Any) -> int:
        if flags is not self._last[0]:
            if flags not in self._seen:
                self._seen.append(flags)
            self._last = flags, self._seen.index(flags)
        return self._last[1]


_ways = _Ways()


def _kept(function: Any, context: Any, args: tuple, kws: dict) -> Any:
    answers = function.__dict__.setdefault("_kept_call_types", {})
    key = context, args, tuple(kws.items()), _ways.number(ConfigStack.top_or_none())
    if key not in answers:
        answers[key] = _ask(function, context, args, kws)
    return answers[key]
