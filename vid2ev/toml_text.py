"""Tables as TOML text, and back.

Lists of tables become [[headings]], tables within them stand on their line.  Source: TOML 1.0.0, toml.io.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any


def parsed_toml(text: str) -> dict[str, Any]:
    """The tables of a text.

    Raises ValueError, in one line, for what is none, or nested too deeply, and for whole numbers beyond 64 bits, which
    TOML does not have.
    """
    try:
        tables = tomllib.loads(text)
        _check_whole_numbers(tables)
        return tables
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    except ValueError as error:  # (numbers of thousands of digits are ValueErrors of their own)
        raise ValueError(str(error).splitlines()[0]) from error


def _check_whole_numbers(node: Any) -> None:
    if isinstance(node, Mapping | list):
        for child in node.values() if isinstance(node, Mapping) else node:
            _check_whole_numbers(child)
    elif isinstance(node, int) and not -(2**63) <= node < 2**63:
        raise ValueError(f"a whole number of {node.bit_length()} bits: expected 64 at most")


def toml_text(tables: Mapping[str, Any]) -> str:
    """The text of a file: each value of `tables` is a table, or a list of tables."""
    blocks = []
    for name, table in tables.items():
        heading = f"[[{_key(name)}]]" if isinstance(table, list) else f"[{_key(name)}]"
        for one in table if isinstance(table, list) else [table]:
            lines = [f"{_key(key)} = {toml_value(value)}" for key, value in one.items() if value is not None]
            blocks.append("\n".join([heading, *lines]))
    return "\n\n".join(blocks) + "\n"


def toml_value(value: Any) -> str:
    """A value in one line."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {toml_value(child)}" for key, child in value.items() if child is not None)
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(child) for child in value)}]"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _string(key)


def _string(text: str) -> str:
    """Strings of TOML are those of JSON, but for the sign DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
