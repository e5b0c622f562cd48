"""Ctrl-C while compiled code runs.

Python hears signals between its own instructions.  The first ones after compiled code are those of a function by which
Numba (0.68) makes arrays of what that code returns, and Numba does not look whether it raised: a KeyboardInterrupt
there comes out as a SystemError, which nobody takes for Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

RETURNING = "_numba_unpickle"


def is_lost(at: FrameType | None) -> bool:
    """Whether an exception that a signal raises there is lost."""
    return at is not None and at.f_code.co_name == RETURNING


@contextmanager
def found_again() -> Iterator[None]:
    """Within it, a KeyboardInterrupt that compiled code has made a SystemError of is one again."""
    try:
        yield
    except SystemError as error:
        if not isinstance(error.__cause__, KeyboardInterrupt):
            raise
        raise KeyboardInterrupt from error
