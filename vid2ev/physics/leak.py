"""Leak: the memory drifts down, so a pixel at rest sends ON events at `leak_rate_hz`.

    d memory / dt = -leak_rate_hz threshold_on      [nat/s]

The drift is added to the signal inside each interval, not per frame, so its rate does not depend on the sampling.

Source: junction and parasitic photocurrent leakage of the reset switch, about 0.1 Hz (Nozaki, Delbruck, IEEE TED 2017).
"""

from __future__ import annotations

from pydantic import BaseModel, Field


class Leak(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the leak."""

    leak_rate_hz: float = Field(0.0, ge=0, le=1e6, description="ON events of a pixel at rest [Hz]")
