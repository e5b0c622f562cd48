"""What people ask for, in texts and numbers."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Sequence
from numbers import Real
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.toml_text import parsed_toml

NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


def number_of(text: str) -> float:
    """The number that a text is as people write them: 20, .5 or 1e-3.  NaN, which is within no limits, of any other
    text: also of those that Python takes, such as 1_0, inf, or one with blanks around it; and of what is too large."""
    number = float(text) if NUMBER.fullmatch(text) else math.nan
    return number if math.isfinite(number) else math.nan


def is_whole(number: Any, least: int, most: int | None = None) -> bool:
    """Whether a number is whole, and within these limits; true and false are no numbers."""
    try:
        whole = operator.index(number)
    except TypeError:
        return False
    return not isinstance(number, bool) and least <= whole and (most is None or whole <= most)


def is_finite(number: Any) -> bool:
    """Whether it is a number, and a finite one; texts, true and false are no numbers."""
    return isinstance(number, Real) and not isinstance(number, bool) and math.isfinite(number)


def names_in(texts: str | Sequence[str]) -> tuple[str, ...]:
    """The names in texts that may hold several, with commas; each once."""
    parts = [texts] if isinstance(texts, str) else texts
    return tuple(dict.fromkeys(name.strip() for text in parts for name in text.split(",")))


def setting(text: str, example: str) -> tuple[str, Any]:
    """Key and value of a text key=value: a TOML value, else a number (`.2` is none in TOML), else the text itself.

    Raises UsageError, with the example, for a text that is none.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key.rpartition(".")[2] or not value:
        raise UsageError(f"Setting '{text}' is not of the form key=value; write for example {example}.")
    return key, value_of(value)


def value_of(text: str) -> Any:
    """A TOML value, else a number as people write them, else the text itself."""
    try:
        parsed = parsed_toml(f"value = {text}")
    except ValueError:
        parsed = {}
    if list(parsed) == ["value"]:
        return parsed["value"]
    number = number_of(text)
    return text if math.isnan(number) else number
