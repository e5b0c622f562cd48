"""Delay: all events later by the same time.

    t' = t + delay_us,   rounded to the microsecond

It stands for what follows the comparator, or for a pole of the photoreceptor that is much faster than the light
changes: such a pole delays by its time constant.  What would come after the last frame, or after a cut, is not sent, as
it would not be by that pole.

Sources: the mean of an exponential response is its time constant (any text on linear systems); a pure latency is how
makers state their pixels' response (Lichtsteiner, Posch, Delbruck, IEEE JSSC 2008).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.chances import surely
from vid2ev.bounds.scene import DISTANCE_TAU_S, Omission, Scene
from vid2ev.physics.omission import apart_at_most, late_noise, readout_shifts
from vid2ev.stream.events import Events
from vid2ev.stream.saved import events_of

FIELDS = ("t", "x", "y", "p", "label")


class Delay(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the delay."""

    delay_us: float = Field(0.0, ge=0, le=1e12, description="time by which all events are later [us]")


def omission(scene: Scene, spec: Any) -> Omission:
    """The delay: that of a pair of events costs no more than its share of tau, and those near it as much again."""
    share = spec.delay_us * 1e-6 / DISTANCE_TAU_S * readout_shifts(scene, spec)
    apart = apart_at_most(scene, spec)
    distance = surely(scene, min(1.0, share) * apart) + late_noise(scene, spec, spec.delay_us)
    why = "all times are later; never left out"
    return Omission(distance, "99.9 % bound", f"{spec.delay_us:g} us", why)


class Delayed:
    """Events made later; the state is those that are not due yet."""

    def __init__(self, delay_us: float, size: tuple[int, int]):
        self.size = size
        self.delay_us = math.floor(delay_us + 0.5)
        self.held = Events.empty()

    def push(self, events: Events, until_us: int) -> Events:
        """Add events; returns those that are due up to `until_us`, in their order."""
        later = Events(events.t + self.delay_us, events.x, events.y, events.p, events.label)
        waiting = Events.concatenate([self.held, later])
        due = int(np.searchsorted(waiting.t, until_us, side="right"))
        self.held = waiting.stretch(due, len(waiting))
        return waiting.stretch(0, due) if due else Events.empty(events.label is not None)

    def forget(self) -> None:
        """Drop what is held, as at a cut."""
        self.held = Events.empty()

    def state(self) -> dict[str, np.ndarray]:
        """The state as plain arrays."""
        arrays = {name: getattr(self.held, name) for name in FIELDS}
        return {f"delayed_{name}": np.array(() if part is None else part, np.int64) for name, part in arrays.items()}

    def restoring(self, state: dict[str, np.ndarray]) -> Callable[[], None]:
        """What takes up a state, all of which is found right before.  Raises UsageError for another."""
        labelled = np.size(state.get("delayed_label", ())) > 0
        held = events_of(state, "delayed_", self.size, labelled, dict.fromkeys(FIELDS, np.int64))

        def take_up() -> None:
            self.held = held

        return take_up
