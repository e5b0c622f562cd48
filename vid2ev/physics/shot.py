"""Shot noise: events at random times, fewer in bright light.

    rate(light) = shot_rate_hz (1 - (1 - f) light)   for light up to 1,   f = shot_light_factor = 0.25

ON and OFF together, half each; each resets the memory to the signal, and is sent if the pixel is not in its refractory
period.  They are a Poisson process: candidates come at `shot_rate_hz` in each aligned block of 2048 pixels and each
cell of a fixed 1 ms clock, and each is kept with the probability that the light at its instant asks for, so neither
frames nor tiles change anything.

What leaving it out changes: at most shot_rate_hz share(least light) events per pixel and second come or go, and the
events after one of them in its pixel come from other levels.

Source: v2e (Hu, Liu, Delbruck 2021), rate falling to a quarter at full scale, there at most one event per frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.chances import at_most
from vid2ev.bounds.distance import added
from vid2ev.bounds.scene import DISTANCE_TAU_S, Omission, Scene
from vid2ev.compiling.compiler import compiled
from vid2ev.physics.omission import kind_of, light_events, reset, set_anew

CELL_NS, CELL_PIXELS = 1_000_000, 2048


class Shot(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the shot noise."""

    shot_rate_hz: float = Field(0.0, ge=0, le=5e4, description="noise events of a dark pixel, ON and OFF together [Hz]")
    shot_light_factor: float = Field(0.25, ge=0, le=1, description="the rate at light 1, relative to the dark")


@compiled
def shot_share(light, factor):
    """The share of the dark rate that is left at a light."""
    return 1.0 - (1.0 - factor) * min(max(light, 0.0), 1.0)


def omission(scene: Scene, spec: Any) -> Omission:
    """The shot noise."""
    least = np.clip(scene.light_min, 0.0, 1.0)
    rate_hz = spec.shot_rate_hz * float(np.mean(1.0 - (1.0 - spec.shot_light_factor) * least))
    extra = at_most(rate_hz * scene.pixels * scene.seconds)
    bunched = 1.0 + 2.0 * spec.shot_rate_hz * DISTANCE_TAU_S
    distance = added(light_events(scene, spec), extra, 0.0) * bunched
    distance += set_anew(scene, spec, reset(scene, spec))
    why = f"{extra:.0f} events at most, and their pixels' levels"
    return Omission(distance, kind_of(spec), f"{rate_hz:.3g} events/pixel/s", why)
