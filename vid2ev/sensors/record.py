"""`Record`: what specifications of all sensors have in common."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, model_validator

LEAST = 1e-100  # nearer to 0 is no measure of anything, and what is divided by it may be beyond all numbers


class Record(BaseModel, frozen=True, extra="forbid"):
    """Numbers that are 0, or measure something; they cannot be changed, and there are no others."""

    model_config = ConfigDict(allow_inf_nan=False, ser_json_inf_nan="constants")

    @model_validator(mode="after")
    def _something_or_nothing(self) -> Self:
        for name, value in self:
            if isinstance(value, float) and 0.0 < abs(value) < LEAST:
                raise ValueError(f"{name} {value}: expected 0, or at least {LEAST}")
        return self
