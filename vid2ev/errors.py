"""Errors that people read: one sentence with the value, what was expected, and the remedy.

`UsageError` (exit code 2) is a request that cannot be meant: an unknown key, an impossible value, a wrong
option.  `DataError` (exit code 1) is a file, a disk or a recording that does not hold what was promised.
The command line prints the sentence without a traceback; in Python both are ordinary exceptions.
"""


class Vid2evError(Exception):
    """Base of every error that vid2ev raises on purpose."""

    exit_code = 1


class UsageError(Vid2evError, ValueError):
    """A value, key or option that cannot be meant; exit code 2."""

    exit_code = 2


class DataError(Vid2evError, OSError):
    """A source or a disk that does not hold what was expected; exit code 1."""

    exit_code = 1
