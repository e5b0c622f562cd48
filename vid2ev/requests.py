"""What people ask for, in texts."""

from __future__ import annotations

from collections.abc import Sequence


def names_in(texts: str | Sequence[str]) -> tuple[str, ...]:
    """The names in texts that may hold several, with commas; each once."""
    parts = [texts] if isinstance(texts, str) else texts
    return tuple(dict.fromkeys(name.strip() for text in parts for name in text.split(",")))
