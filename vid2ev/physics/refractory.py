"""Refractory period: after an event a pixel is blind for a while.

    quantised   a crossing within `refractory_us` of the last event moves the memory and sends nothing (the paper)
    track       no crossing is seen; when the period ends the memory becomes the signal (silicon: the switch reopens)

Sources: the paper, algorithm step 2e; `track` as the reset of the differencing amplifier in Lichtsteiner et al. 2008.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field


class Refractory(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the refractory period."""

    refractory_us: float = Field(
        100.0, ge=0, le=1e12, description="time after an event in which a pixel sends none [us]"
    )
    refractory: Literal["quantised", "track"] = Field(
        "quantised",
        description="in the refractory period the memory follows the crossings, or jumps to the signal at its end",
    )
