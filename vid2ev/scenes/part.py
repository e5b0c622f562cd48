"""What all tables of a scene file have in common: frozen, strict, and no key that is not known."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class Part(BaseModel):
    """A table of a scene file."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, ignored_types=(cached_property,)
    )

    def __eq__(self, other: object) -> bool:
        """Whether all values are the same; what is found from them and kept (arrays, too) is not looked at."""
        return type(self) is type(other) and all(
            getattr(self, name) == getattr(other, name) for name in type(self).model_fields
        )


Metres = Annotated[float, Field(ge=-1e5, le=1e5)]
Seconds = Annotated[float, Field(ge=-1e6, le=1e6)]
Degrees = Annotated[float, Field(ge=-1e7, le=1e7)]
Light = Annotated[float, Field(ge=0, le=1e6)]
Length = Annotated[float, Field(ge=0, le=1e5)]
Along = Annotated[float, Field(ge=-1e9, le=1e9)]  # (squares of larger ones are infinite somewhere)

Point = tuple[Metres, Metres, Metres]  # x, y, z
Turn = tuple[Degrees, Degrees, Degrees]  # a rotation vector
Direction = tuple[Along, Along, Along]  # of any length but 0
Colour = tuple[Light, Light, Light]  # linear red, green, blue
