"""What options are made of: those that commands share, and finite numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import click

from vid2ev.requests import number_of


def adding(*options: Callable[..., Any]) -> Callable[..., Any]:
    """A decorator that adds options to a command, in their order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


class Finite(click.types.FloatParamType):
    """A finite number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = number_of(value) if isinstance(value, str) else value
        if not math.isfinite(number):
            self.fail(f"'{value}': expected a finite number", param, ctx)
        return super().convert(number, param, ctx)


class FiniteRange(Finite, click.FloatRange):
    """A finite number within a range; click's own takes NaN, which is neither too small nor too large."""


class Rate(FiniteRange):
    """Frames a second: a number, or one over another (30000/1001), which stays exact."""

    def __init__(self, most: float | None = None) -> None:
        super().__init__(0, most, min_open=True)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        above, slash, below = value.partition("/") if isinstance(value, str) else ("", "", "")
        if not slash:
            return super().convert(value, param, ctx)
        if not number_of(above) > 0 or not number_of(below) > 0:
            self.fail(f"'{value}': expected a number, or one over another, such as 30000/1001", param, ctx)
        super().convert(number_of(above) / number_of(below), param, ctx)
        return Fraction(above) / Fraction(below)


SECONDS = FiniteRange(0, 1e9)  # of a recording
