"""A kind of option: a whole number, or one word."""

from __future__ import annotations

import re
from typing import Any

import click


class Auto(click.ParamType):
    """A whole number from `least`, or one word."""

    def __init__(self, word: str, least: int, name: str):
        self.word, self.least, self.name = word, least, name

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return f"{self.word}|N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | str:
        if value == self.word or isinstance(value, int):
            return value
        if not re.fullmatch(r"-?[0-9]{1,1000}", value):
            self.fail(f"'{value}' is neither '{self.word}' nor a whole number", param, ctx)
        number = int(value)
        if number < self.least:
            self.fail(f"{number} is less than {self.least}", param, ctx)
        return number
