"""Leak: the memory drifts down, so a pixel at rest sends ON events at `leak_rate_hz`.

    d memory / dt = -leak_rate_hz threshold_on      [nat/s]

The drift is added to the signal inside each interval, not per frame, so its rate does not depend on the sampling.

What leaving it out changes: after a time t the level is off by leak_rate_hz threshold_on t, always to one side, and a
pixel has sent leak_rate_hz t events more.

Source: junction and parasitic photocurrent leakage of the reset switch, about 0.1 Hz (Nozaki, Delbruck, IEEE TED 2017).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.distance import added, elsewhere, off_by
from vid2ev.bounds.scene import Omission, Scene
from vid2ev.physics.omission import echoes, light_events, noise_events, omitted, sent_share


class Leak(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the leak."""

    leak_rate_hz: float = Field(0.0, ge=0, le=1e6, description="ON events of a pixel at rest [Hz]")


def omission(scene: Scene, spec: Any) -> Omission:
    """The leak."""
    per_pixel = spec.leak_rate_hz * scene.seconds
    figure = f"{spec.leak_rate_hz:.3g} events/pixel/s"
    error = np.full(len(scene.travel), per_pixel * spec.threshold_on)
    moved = omitted(scene, spec, off_by(scene, error, echoes=echoes(spec), one_way=True), figure, "")
    touched = min(per_pixel, 1.0) * elsewhere(scene) / max(sent_share(scene, spec), 1e-9) if echoes(spec) else 0.0
    extra = added(light_events(scene, spec) + noise_events(scene, spec)[0], per_pixel * scene.pixels, touched)
    why = f"{per_pixel:.2g} events more per pixel, and levels off by as many thresholds"
    anyway = omitted(scene, spec, math.inf, figure, "").distance
    return replace(moved, distance=min((moved.distance or 0.0) + 2.0 * extra, anyway or math.inf), why=why)
