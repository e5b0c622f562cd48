"""What people ask for, in texts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.toml_text import parsed_toml


def names_in(texts: str | Sequence[str]) -> tuple[str, ...]:
    """The names in texts that may hold several, with commas; each once."""
    parts = [texts] if isinstance(texts, str) else texts
    return tuple(dict.fromkeys(name.strip() for text in parts for name in text.split(",")))


def setting(text: str, example: str) -> tuple[str, Any]:
    """Key and value of a text key=value: a TOML value, else a number as Python reads it (`.2`), else the text itself.

    Raises UsageError, with the example, for a text that is none.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key.rpartition(".")[2] or not value:
        raise UsageError(f"Setting '{text}' is not of the form key=value; write for example {example}.")
    return key, _value(value)


def _value(text: str) -> Any:
    try:
        parsed = parsed_toml(f"value = {text}")
    except ValueError:
        parsed = {}
    if list(parsed) == ["value"]:
        return parsed["value"]
    try:
        return float(text)
    except ValueError:
        return text
