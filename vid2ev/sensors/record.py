"""`Record`: what specifications of all sensors have in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from vid2ev.errors import UsageError, clause

Spec = TypeVar("Spec", bound=BaseModel)
LEAST = 1e-100  # nearer to 0 is no measure of anything, and what is divided by it may be beyond all numbers


class Record(BaseModel, frozen=True, extra="forbid"):
    """Numbers that are 0, or measure something; they cannot be changed, and there are no others."""

    model_config = ConfigDict(allow_inf_nan=False, ser_json_inf_nan="constants")

    @model_validator(mode="after")
    def _something_or_nothing(self) -> Self:
        for name, value in self:
            if isinstance(value, float) and 0.0 < abs(value) < LEAST:
                above_0 = any(hasattr(each, "gt") for each in type(self).model_fields[name].metadata)
                raise ValueError(f"{name} {value}: expected {'' if above_0 else '0, or '}at least {LEAST}")
        return self


def changed(spec: Spec, changes: Mapping[str, Any]) -> Spec:
    """The specification with these changes.  Raises UsageError where it cannot be."""
    try:
        return type(spec)(**(spec.model_dump() | {**changes}))
    except ValidationError as error:
        said = ", ".join(f"{key}={value}" for key, value in changes.items())
        raise UsageError(f"{said}: {first_said(error)}") from error


def first_said(error: ValidationError) -> str:
    """What is said of the first value that cannot be, as a clause; of one that may be of two kinds, of both."""
    first, *others = error.errors()
    kinds = [each for each in others if each["loc"][:1] == first["loc"][:1] and isinstance(each["loc"][-1], str)]
    said = [clause(each["msg"]) for each in (first, *kinds)]
    return " or ".join([said[0], *(other.removeprefix("it must be ") for other in said[1:])])
