"""The events of any event file, stretch after stretch, in memory that does not grow with its length."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from vid2ev import Events
from vid2ev.formats import open_events, survey
from vid2ev.formats.event_file import EventFile


class EventCursor:
    """Reads forwards; what lies before the last stretch is read again from the beginning.

    back_us       how long before a stretch its events begin
    size          width and height of the sensor [px]; where the file does not state it, the smallest that holds all
    covered_us    from where the file begins, 0 if it does not say, to its last event, or as it says
    seen_us       from the first event to the end; None without events
    silent_us     before that it has no event, and does not say that there were none
    Raises UsageError for a path where nothing is, DataError for what is no event file.
    """

    def __init__(self, path: Path, back_us: int = 0):
        self.file: EventFile = open_events(path)
        self._back_us = back_us
        self._recording = survey(self.file)
        self.size = self._recording.size
        self.count = self._recording.count
        begin_us = self._recording.start_us
        self.covered_us = begin_us, begin_us + self._recording.duration_us
        first = next(self._recording.blocks(), None)
        self.seen_us = None if first is None else (int(first.t[0]), self.covered_us[1])
        self.silent_us = begin_us if self.seen_us is None or self.file.says_start else self.seen_us[0]
        self._blocks: Iterator[Events] = iter(())
        self._held, self._from_us = Events.empty(), None if self.count else begin_us

    def between(self, start_us: int, stop_us: int) -> Events:
        """The events in (start_us - back_us, stop_us]."""
        start_us -= self._back_us
        if self._from_us is None or start_us < self._from_us:
            self._blocks, self._held = self._recording.blocks(), Events.empty()
        read = [self._held]
        seen_us = self._held.t[-1] if len(self._held) else start_us
        while seen_us <= stop_us and (following := next(self._blocks, None)) is not None:
            if len(following) and (seen_us := following.t[-1]) > start_us:  # (what lies before may be hours)
                read.append(following)
        events = Events.concatenate(read)
        self._from_us = stop_us - self._back_us
        self._held = events.select(events.t > self._from_us)
        return events.select((events.t > start_us) & (events.t <= stop_us))
