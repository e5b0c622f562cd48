"""Why something failed, as one sentence on the page."""

from __future__ import annotations

from vid2ev.errors import DataError, Vid2evError


def why_not(error: Exception) -> str:
    """What a person is told of an error, whatever it was."""
    if isinstance(error, Vid2evError):
        return str(error)
    if isinstance(error, OSError) and error.strerror and error.filename is not None:  # (a name that no disk takes)
        return str(DataError(f"{error.filename}: {error.strerror}; give another name"))
    return f"{type(error).__name__}: {error}"
