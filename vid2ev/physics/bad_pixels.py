"""Hot and cold pixels: some fire all the time, some never.

    hot    ON events, Poisson, hot_rate_hz [Hz], whatever the light    P(hot) = hot_probability
    cold   no events                                            P(cold) = cold_probability (1 - P(hot))

A hot pixel makes ON events as a Poisson process of `hot_rate_hz`, whatever the light; of these it sends those that are
not within the refractory period R of the last, hot_rate_hz / (1 + hot_rate_hz R): 909 of 1000 Hz by default.  A cold
pixel sends none.  Which pixels are bad is drawn once per camera and seed.

What leaving them out changes: hot pixels send as many events more, and those of light come from other levels; the
events of cold pixels come back.

Source: the paper, "bad pixel probability", drawn anew at each conversion; the rate is ours (the paper: "always
emitted").
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.chances import at_most, surely
from vid2ev.bounds.distance import added, together
from vid2ev.bounds.scene import DISTANCE_TAU_S, Omission, Scene
from vid2ev.compiling.compiler import compiled
from vid2ev.physics.omission import by_itself, kind_of, light_events, noise_events, sent_share, trembling
from vid2ev.physics.random import HOT_MAP, philox, unit


class BadPixels(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the bad pixels."""

    hot_probability: float = Field(0.0, ge=0, le=1, description="share of pixels that fire all the time")
    hot_rate_hz: float = Field(1000.0, ge=0, le=1e5, description="event rate of a hot pixel that is never blind [Hz]")
    cold_probability: float = Field(0.0, ge=0, le=1, description="share of the other pixels that never fire")


@compiled
def bad_pixel_map(n, seed, camera, hot_probability, cold_probability):
    """uint8 [n]: 0 a good pixel, 1 a hot one, 2 a cold one."""
    kind = np.zeros(n, np.uint8)
    for pixel in range(n):
        words = philox(seed, HOT_MAP + 256 * camera, pixel, 0)
        hot, cold = unit(words[0]) < hot_probability, unit(words[1]) < cold_probability
        kind[pixel] = np.uint8(1) if hot else np.uint8(2) * np.uint8(cold)
    return kind


def omission_of_hot(scene: Scene, spec: Any) -> Omission:
    """The hot pixels: their events, and those of light that they do not send.

    Of Poisson's events, each is by itself, and their mean rate adds to that of the events of light, which may be of
    the other sign: the root of what both change is no more than the sum of the two.
    """
    extra = at_most(at_most(spec.hot_probability * scene.pixels) * spec.hot_rate_hz * scene.seconds)
    others = light_events(scene, spec) + noise_events(scene, spec.model_copy(update={"hot_probability": 0.0}))[0]
    share = added(others, extra, 0.0)
    of_light = min(surely(scene, spec.hot_probability, sent_share(scene, spec), whole=True), 1.0)
    of_light *= 0.0 if scene.still else 0.5 * by_itself(scene, spec)
    distance = share + together(share * 2.0 * spec.hot_rate_hz * DISTANCE_TAU_S, of_light)
    figure = f"{spec.hot_probability * spec.hot_rate_hz:.3g} events/pixel/s"
    return Omission(distance, kind_of(spec), figure, f"{extra:.0f} events at most")


def omission_of_cold(scene: Scene, spec: Any) -> Omission:
    """The cold pixels."""
    share = surely(scene, spec.cold_probability, sent_share(scene, spec), whole=True)
    noisy = spec.leak_rate_hz > 0 or spec.shot_rate_hz > 0 or spec.photoreceptor_noise > 0
    if noisy:
        share = max(share, at_most(spec.cold_probability * scene.pixels) / scene.pixels)
    share = min(share, 1.0)
    bunched = max(by_itself(scene, spec), 1.0 + 2.0 * spec.shot_rate_hz * DISTANCE_TAU_S, trembling(scene, spec)[1])
    distance = 0.0 if scene.still and not noisy else share / (2.0 - share) * bunched
    return Omission(distance, "99.9 % bound", f"{spec.cold_probability:.3g} of the events", "silent pixels")
