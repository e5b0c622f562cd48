"""Leak: the memory drifts down, so a pixel at rest sends ON events at `leak_rate_hz`.

    d memory / dt = -leak_rate_hz threshold_on      [nat/s]

The drift is added to the signal inside each interval, not per frame, so its rate does not depend on the sampling.

What leaving it out changes: after a time t the level is off by leak_rate_hz threshold_on t, always to one side, until
an event of shot noise sets it to the signal; and a pixel has sent leak_rate_hz t events more.

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
from vid2ev.physics.omission import echoes, light_events, noise_events, omitted, sent_share, tracks


class Leak(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the leak."""

    leak_rate_hz: float = Field(0.0, ge=0, le=1e6, description="ON events of a pixel at rest [Hz]")


def _off(scene: Scene, spec: Any) -> float:
    """Bound on the mean distance where levels drift apart, from the beginning of a shot on, and from each event of
    shot noise on, which sets both memories to the signal.

    Where that comes at a rate r, a level has drifted for (1 - exp(-r t)) / r at the time t, on average; for no longer
    than that of the mean of several t.
    """
    share = 1.0 - (1.0 - spec.shot_light_factor) * np.clip(scene.light_max, 0.0, 1.0)
    rate_hz = np.maximum(spec.shot_rate_hz * share, 1e-12)
    if tracks(spec):  # (one of the two may be blind to it)
        rate_hz[:] = 1e-12

    def drifted_s(t_s: np.ndarray | float) -> np.ndarray:
        return np.asarray(-np.expm1(-rate_hz * t_s) / rate_hz)

    longest_s = np.maximum(drifted_s(scene.longest_s), 1e-12)
    drift = spec.leak_rate_hz * spec.threshold_on
    levels = 1.0 + math.floor(drift * scene.longest_s / scene.threshold)
    parts = drifted_s(scene.pushed_when_s) / longest_s, drifted_s(scene.turned_when_s) / longest_s
    return off_by(scene, drift * longest_s, echoes=echoes(spec), one_way=True, levels=levels, parts=parts)


def omission(scene: Scene, spec: Any) -> Omission:
    """The leak."""
    per_pixel = spec.leak_rate_hz * scene.seconds
    figure = f"{spec.leak_rate_hz:.3g} events/pixel/s"
    moved = omitted(scene, spec, _off(scene, spec), figure, "")
    touched = min(per_pixel, 1.0) * elsewhere(scene) / max(sent_share(scene, spec), 1e-9) if echoes(spec) else 0.0
    extra = added(light_events(scene, spec) + noise_events(scene, spec)[0], per_pixel * scene.pixels, touched)
    why = f"{per_pixel:.2g} events more per pixel, and levels off by as many thresholds"
    anyway = omitted(scene, spec, math.inf, figure, "").distance
    return replace(moved, distance=min((moved.distance or 0.0) + 2.0 * extra, anyway or math.inf), why=why)
