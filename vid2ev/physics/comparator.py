"""Comparator: two absolute levels per pixel, an event where the signal reaches one.

    ON  when y >= c_on:   the memory becomes c_on,   and c_on, c_off move to memory + theta_on, memory - theta_off
    OFF when y <= c_off:  the memory becomes c_off,  likewise

Levels are float64 nats, so they do not drift.  The memory starts at the first signal, or, with `random_phase`, such
that c_on lies anywhere within one threshold above it, as leak has it after a rest: real pixels are not in step, and
without noise a scene that returns to its first value would sit exactly on a level.  So the first change of a clip that
is less than a threshold sends ON events in its share of the pixels, and no OFF events.

With `timing = "frame"` the signal stays as it is until the frame, where it jumps and all that is crossed is crossed at
once; a blind time that ends before it leaves the memory at the signal of the frame before (`refractory = "track"`).

Sources: the paper, section II.A (thresholds apart, the level updated at every potential crossing); timing `linear` is
ESIM (Rebecq, Gehrig, Scaramuzza, CoRL 2018).
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, field_validator

from vid2ev.compiling.compiler import inlined
from vid2ev.physics.random import PHASE, philox, unit

LEAST_NATS = 1e-6  # of a threshold: crossings are solved to 2e-6 nat, and from 1e-16 on a level adds up to no other


class Comparator(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the comparator."""

    threshold_on: float = Field(0.15, gt=0, le=100, description="mean ON threshold [nat]")
    threshold_off: float = Field(0.15, gt=0, le=100, description="mean OFF threshold [nat]")
    random_phase: bool = Field(
        True, description="pixels start with c_on anywhere within a threshold above the signal instead of in step"
    )
    timing: Literal["response", "linear", "frame"] = Field(
        "response",
        description="crossing times from the filter's response, from a line between frames (ESIM), or the frame's time",
    )
    max_crossings: int = Field(
        4096,
        ge=1,
        le=1_000_000,
        description="crossings solved per pixel and monotone stretch of an interval; the rest is one step, without"
        " noise, and counted",
    )

    @field_validator("threshold_on", "threshold_off")
    @classmethod
    def _is_above_rounding(cls, nats: float) -> float:
        if nats < LEAST_NATS:
            raise ValueError(f"it must be at least {LEAST_NATS:g} nat, half of what crossings are solved to")
        return nats


@inlined
def initial_phase(seed, camera, pixel):
    """Fraction of the ON threshold that lies between the first signal and the first ON level, in (0, 1)."""
    word, _, _, _ = philox(seed, PHASE + 256 * camera, pixel, 0)
    return unit(word)
