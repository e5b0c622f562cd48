"""Errors that people read: one sentence with the value, what was expected, and the remedy.

`UsageError` (exit code 2) is a request that cannot be meant: an unknown key, an impossible value, a wrong
option.  `DataError` (exit code 1) is a file, a disk or a recording that does not hold what was promised.
The command line prints the sentence without a traceback; in Python both are ordinary exceptions.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class Vid2evError(Exception):
    """Base of every error that vid2ev raises on purpose.

    What it quotes of files is shortened, and has no control characters: nobody's terminal does what a file says.
    """

    exit_code = 1

    def __init__(self, message: object = ""):
        super().__init__(_quoted(str(message)))


class UsageError(Vid2evError, ValueError):
    """A value, key or option that cannot be meant; exit code 2."""

    exit_code = 2


class DataError(Vid2evError, OSError):
    """A source or a disk that does not hold what was expected; exit code 1."""

    exit_code = 1


class SavedError(DataError):
    """What was kept to go on from does not hold what it should: to go on once more mends nothing."""


class DiskError(DataError):
    """A disk that does not take what is to be written: nobody's file is at fault, and all work ends there."""


@contextmanager
def read_as(
    path: Path, kind: str, stumbles: tuple[type[Exception], ...] = (OSError, ValueError, MemoryError)
) -> Iterator[None]:
    """What a reader of files of this kind stumbles over within becomes one sentence, a DataError."""
    try:
        yield
    except Vid2evError:
        raise
    except stumbles as error:
        raise DataError(
            f"{path} cannot be read as {kind}: it is cut short or damaged; make it again or get another copy"
        ) from error


def _quoted(message: str) -> str:
    return re.sub(r"\S{200,}", lambda word: f"{word[0][:80]}...{word[0][-40:]}", plain(message))


def plain(text: str) -> str:
    """A text without control characters."""
    return re.sub(r"[\x00-\x1f\x7f-\x9f]+", " ", text)


def nearest(word: str, words: Iterable[str]) -> str:
    """A hint at the one of the words that may have been meant, to go on a sentence with, however it is written in
    capitals; empty if none is near."""
    by_letters = {each.casefold(): each for each in words}
    close = difflib.get_close_matches(word.casefold(), list(by_letters), n=1)
    return f" (did you mean {by_letters[close[0]]}?)" if close else ""


def check_names(names: Iterable[str], known: Sequence[str]) -> None:
    """Raise UsageError for the name of an option that there is not."""
    for name in names:
        if name not in known:
            raise UsageError(f"option '{name}'{nearest(name, known)}: expected one of {', '.join(sorted({*known}))}")


def reason_of(complaint: Mapping[str, Any]) -> str:
    """What pydantic complains of in a value that somebody gave, as a clause; what lists lack is no field to them."""
    return "it has too few values" if complaint["type"] == "missing" else clause(complaint["msg"])


def clause(message: str) -> str:
    """What pydantic says of a value, as a clause within a sentence."""
    message = message.removeprefix("Value error, ").rstrip(".").replace("\n", " ")
    message = re.sub(r", (unable|got) .*", "", message)
    message = re.sub(r"^Tuple should have at (least|most) (\d+) items?.*", r"it must have at \1 \2 entries", message)
    message = re.sub(r"^String should have at least 1 character$", "it must not be empty", message)
    message = re.sub(r"^Unable to parse input .* integer.*", "it must be a whole number nearer to 0", message)
    message = re.sub(r"^Input should (be|have)", r"it must \1", message)
    return message.replace("a valid tuple", "a list").replace("valid dictionary", "table")
