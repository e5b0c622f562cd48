"""A kind of option: a number within a range, which NaN is not."""

from __future__ import annotations

import math
from typing import Any

import click

from vid2ev.requests import number_of


class Finite(click.FloatRange):
    """A finite number within a range; click's own takes NaN, which is neither too small nor too large."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = number_of(value) if isinstance(value, str) else value
        if not math.isfinite(number):
            self.fail(f"'{value}' is no finite number", param, ctx)
        return super().convert(number, param, ctx)


SECONDS = Finite(0, 1e9)  # of a recording
