"""Fixed-rate mode: events are read out in event frames, at most one per pixel and frame.

    frame k is at 1e6 k / frame_rate_hz us after the first light frame, rounded to the microsecond, halves upwards
    nearest   an event goes to the event frame nearest to its time, the earlier of two that are equally near
    causal    to the next one, as a scanner that reads what has happened

The first crossing wins; later ones of the same pixel and frame are dropped.  As the nearest frame may lie ahead of the
light that is known, events of a frame not yet complete are held back; `flush` gives the last of them.

Source: the paper, algorithm step 3, "rounded to the closest event frame timestamp".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field, field_validator

from vid2ev.bounds.distance import together
from vid2ev.bounds.scene import Omission, Scene
from vid2ev.physics.omission import by_itself, late_noise, noise_again, omitted
from vid2ev.stream.events import Events
from vid2ev.stream.saved import clock, entry, events_of
from vid2ev.stream.ticks import Ticks

SLOWEST_HZ = 1e-9  # of event frames: 32 years from one to the next
KINDS = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.uint8, "label": np.uint8}  # of events held back


class FixedRate(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the fixed-rate mode."""

    frame_rate_hz: float = Field(0.0, ge=0, le=1e6, description="event frames per second; 0: free-running")
    rounding: Literal["nearest", "causal"] = Field("nearest", description="to the nearest event frame, or to the next")

    @field_validator("frame_rate_hz")
    @classmethod
    def _within_a_lifetime(cls, value: float) -> float:
        if 0.0 < value < SLOWEST_HZ:
            raise ValueError(f"{value} Hz: expected 0, or at least {SLOWEST_HZ}")
        return value


class EventFrames:
    """Events into event frames; the state is `origin_us`, the last frame of each pixel, and the events held back."""

    def __init__(self, spec: FixedRate, width: int, height: int, labels: bool = False):
        self.spec, self.width, self.height, self.labels = spec, width, height, labels
        self._ticks = Ticks.of(spec.frame_rate_hz, 10**6)
        self.origin_us: int | None = None
        self.last = np.full(width * height, -1, np.int64)
        self.held = Events.empty(labels)

    def instant_us(self, k: np.ndarray) -> np.ndarray:
        """Times [us] of event frames k."""
        assert self.origin_us is not None
        return self.origin_us + self._ticks.all_at(k)

    def frame_of(self, t_us: np.ndarray) -> np.ndarray:
        """The event frame that an event of time t goes to."""
        assert self.origin_us is not None
        since_us = t_us - self.origin_us
        k = self._ticks.first_from(since_us)
        if self.spec.rounding == "nearest":
            before_us, after_us = self._ticks.all_at(k - 1), self._ticks.all_at(k)
            k = k - (since_us - before_us <= after_us - since_us)
        return np.maximum(k, 0)

    def push(self, events: Events, until_us: int) -> Events:
        """Add events of times up to `until_us`; returns those of the event frames that are complete."""
        frame = self.frame_of(events.t)
        pixel = events.y.astype(np.int64) * self.width + events.x
        order = np.lexsort((np.arange(len(pixel)), frame, pixel))
        sorted_pixel, sorted_frame = pixel[order], frame[order]
        first = np.ones(len(order), bool)
        first[1:] = (sorted_pixel[1:] != sorted_pixel[:-1]) | (sorted_frame[1:] != sorted_frame[:-1])
        first &= sorted_frame > self.last[sorted_pixel]
        np.maximum.at(self.last, sorted_pixel, sorted_frame)
        kept = np.sort(order[first])
        events, frame = events.select(kept), frame[kept]
        events = Events(self.instant_us(frame), events.x, events.y, events.p, events.label)
        events = Events.concatenate([self.held, events])
        # What comes later than `until_us` can still go to its own event frame, but to none before.
        ready = self.frame_of(events.t) < self.frame_of(np.array([until_us]))[0]
        self.held = events.select(~ready)
        return self._ordered(events.select(ready))

    def flush(self) -> Events:
        """The events held back."""
        held, self.held = self.held, Events.empty(self.labels)
        return self._ordered(held)

    @staticmethod
    def _ordered(events: Events) -> Events:
        return events.select(np.lexsort((events.x, events.y, events.t)))

    def state(self) -> dict[str, np.ndarray]:
        """The state as plain arrays."""
        held = self.held
        label = np.empty(0, np.uint8) if held.label is None else held.label
        origin = np.array([self.origin_us], np.int64)
        parts = {"t": held.t, "x": held.x, "y": held.y, "p": held.p, "label": label}
        return {"frame_origin": origin, "frame_last": self.last.copy()} | {f"held_{k}": v for k, v in parts.items()}

    def restoring(self, state: dict[str, np.ndarray]) -> Callable[[], None]:
        """What takes up a state, all of which is found right before.  Raises UsageError for another."""
        (origin_us,) = clock(state, "frame_origin", 1)
        last = entry(state, "frame_last", np.int64, self.last.shape)
        held = events_of(state, "held_", (self.width, self.height), self.labels, KINDS)

        def take_up() -> None:
            self.origin_us, self.held = origin_us, held
            self.last[...] = last

        return take_up


def omission(scene: Scene, spec: Any) -> Omission:
    """The readout's clock: without it times are others, those of noise too, and what comes in the same event frame is
    sent, as near together as it is."""
    why, figure = "all times are those of the readout; never left out", f"at most {latest_us(spec):.3g} us"
    free = spec.model_copy(update={"frame_rate_hz": 0.0})
    dense = max(by_itself(scene, spec), by_itself(scene, free))
    light = omitted(scene, spec, math.inf, figure, why, lag_s=1e-6 * latest_us(spec), dense=dense)
    noise = late_noise(scene, spec, latest_us(spec)), noise_again(scene, spec, free, 1.0 / spec.frame_rate_hz)
    return replace(light, distance=together(light.distance or 0.0, *noise))


def latest_us(spec: Any) -> float:
    """How much later than what it tells of an event may be."""
    return 1e6 / spec.frame_rate_hz * (0.5 if spec.rounding == "nearest" else 1.0) if spec.frame_rate_hz > 0 else 0.0
