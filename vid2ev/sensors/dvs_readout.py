"""DvsReadout: what comes behind the comparators: the delay, the event frames of a fixed rate, and a count."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vid2ev.physics.delay import Delayed
from vid2ev.physics.fixed_rate import EventFrames
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.events import Events
from vid2ev.stream.saved import entry


class DvsReadout:
    """Events of the comparators of a sensor of `size` (width, height) in, those that it sends out.

    polarities   int64 [2]: OFF and ON events sent so far
    at_once      whether each is sent as it comes, in whatever order
    """

    def __init__(self, spec: DvsSpec, size: tuple[int, int], labels: bool):
        self._labels = labels
        self._frames = EventFrames(spec, *size, labels) if spec.frame_rate_hz > 0 else None
        self._delayed = Delayed(spec.delay_us, size) if spec.delay_us > 0 else None
        self.polarities = np.zeros(2, np.int64)
        self.at_once = self._frames is None and self._delayed is None

    def begin(self, t_ns: int) -> None:
        """The first frame of light is at t_ns."""
        if self._frames is not None:
            self._frames.origin_us = t_ns // 1000

    def push(self, events: Events, t_ns: int) -> Events:
        """What of the events up to t_ns is sent by then."""
        if self._delayed is not None:
            events = self._delayed.push(events, t_ns // 1000)
        if self._frames is not None:
            events = self._frames.push(events, t_ns // 1000)
        return self.counted(events)

    def cut(self, t_ns: int) -> Events:
        """What is still sent where the light is another from t_ns on: event frames that are complete by then."""
        if self._delayed is not None:
            self._delayed.forget()
        none = Events.empty(self._labels)
        return none if self._frames is None else self.counted(self._frames.push(none, t_ns // 1000))

    def flush(self) -> Events:
        """Events held back because their event frame lies ahead."""
        return Events.empty(self._labels) if self._frames is None else self.counted(self._frames.flush())

    def counted(self, events: Events) -> Events:
        """The same events, which are sent."""
        on = int(np.count_nonzero(events.p))
        self.polarities += (len(events) - on, on)
        return events

    def state(self) -> dict[str, np.ndarray]:
        """The state as plain arrays (copies)."""
        state = {"polarities": self.polarities.copy()}
        for part in (self._frames, self._delayed):
            state |= part.state() if part is not None else {}
        return state

    def restoring(self, state: dict[str, np.ndarray]) -> Callable[[], None]:
        """What takes up a state, all of which is found right before.  Raises UsageError for another."""
        polarities = entry(state, "polarities", self.polarities.dtype, self.polarities.shape)
        parts = [part.restoring(state) for part in (self._frames, self._delayed) if part is not None]

        def take_up() -> None:
            self.polarities[...] = polarities
            for take_up_part in parts:
                take_up_part()

        return take_up
