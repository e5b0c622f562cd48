"""Events that were made before, each part of the pixels or of the time by itself, for a recording put together of them.

The noise of a pixel depends on no other, so the events of a part are those of the whole at its pixels; and all are
ordered by (t, y, x), so there is one way to put them together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.formats import read_events
from vid2ev.physics.fixed_rate import EventFrames
from vid2ev.recording.manifest import read_manifest
from vid2ev.recording.probe import merged, one_after_the_other
from vid2ev.seen.mounts import Mount
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame

BLOCK = 1 << 18  # events of a part that are read at a time


@dataclass(frozen=True)
class Made:
    """The recordings of all parts, in folders of their own.

    in_time  they are parts of the time, one after the other, and not of the pixels
    """

    folders: tuple[Path, ...]
    in_time: bool = False

    def sensor(self, mount: Mount, labels: bool) -> Dvs:
        """What sends the events of a camera; to a track it is the camera."""
        return Replayed(mount, self.folders, labels)  # type: ignore[return-value]

    def probed(self, mount: Mount, pixels: Sequence[tuple[int, int]]) -> Iterator[bytes]:
        """The lines of probe.csv of a camera."""
        tables = [folder / mount.within / "probe.csv" for folder in self.folders]
        tables = [table for table in tables if table.exists()]
        return one_after_the_other(tables) if self.in_time else merged(tables, pixels)

    def seen(self, recipe: Recipe, preview: bool) -> Recipe:
        """The recipe for the frames that the recording still needs: those of the source, but for frame cameras, and for
        a preview of event frames, which shows them once a frame has completed them."""
        specs = [mount.sensor.spec for mount in recipe.mounts]
        by_clock = preview and any(isinstance(spec, DvsSpec) and spec.frame_rate_hz > 0 for spec in specs)
        if recipe.source.dense or by_clock or not all(isinstance(spec, DvsSpec) for spec in specs):
            return recipe
        return replace(recipe, upsample="none", subframes="auto")

    @property
    def subframes(self) -> tuple[int, int]:
        """How many there were, and how many intervals were limited."""
        counts = [_counts(_manifest(part)) for part in (self.folders if self.in_time else self.folders[:1])]
        return sum(each["subframes"] for each in counts), sum(each["limited_intervals"] for each in counts)


@contextmanager
def reading(part: Path) -> Iterator[None]:
    """What is wrong with the recording of a part is said with how to go on: DataError."""
    try:
        yield
    except (DataError, UsageError) as error:
        raise DataError(f"{part}, a part that was made, is damaged ({error}); remove it and --resume") from error


def _manifest(part: Path, within: str = "") -> dict[str, Any]:
    """The manifest of a part, or of one of its cameras."""
    with reading(part):
        return read_manifest(part / within)


def _counts(manifest: dict[str, Any]) -> dict[str, int]:
    """What a recording says of its light, whatever its cameras."""
    return next(iter(manifest.get("results", {"": manifest}).values()))["counts"]


class Replayed:
    """The sensor of a mount whose events were made before: what a track asks of a `Dvs`, but for what is inside."""

    at_once = 1
    slept = (0, 0)

    def __init__(self, mount: Mount, parts: Sequence[Path], labels: bool):
        assert isinstance(mount.sensor.spec, DvsSpec)
        self.size, self.spec, self.labels = mount.size, mount.sensor.spec, labels
        self._mount, self._folders = mount, parts
        self._parts = [_Stream(part, mount.within) for part in parts]
        self._frames = EventFrames(self.spec, *self.size, labels) if self.spec.frame_rate_hz > 0 else None

    @property
    def counts(self) -> dict[str, int]:
        """See `Dvs.counts`."""
        of_parts = [_manifest(part, self._mount.within)["counts"] for part in self._folders]
        names = ("on", "off", "swallowed", "capped", "not_finite")
        return {name: sum(counts[name] for counts in of_parts) for name in names}

    def see(self, frame: Frame) -> Events:
        """The first frame, in which a sensor settles."""
        if self._frames:
            self._frames.origin_us = frame.t_ns // 1000
        return Events.empty(self.labels)

    def see_all(self, frames: Sequence[Frame]) -> list[Events]:
        """The events up to each frame, or of the event frames that are complete by then."""
        return [self._until(self._sent_us(frame.t_ns // 1000)) for frame in frames]

    def flush(self) -> Events:
        """What is left."""
        return self._until(np.iinfo(np.int64).max)

    def maps(self) -> dict[str, np.ndarray]:
        """See `Dvs.maps`."""
        return self._mount.dvs(self.labels).maps()

    def state(self) -> dict[str, np.ndarray]:
        """How many events of each part are sent."""
        origin = {"origin": np.array(self._frames.origin_us, np.int64)} if self._frames else {}
        return {"sent": np.array([part.sent for part in self._parts], np.int64)} | origin

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state."""
        origin_us = int(state["origin"]) if self._frames else None
        self._parts = [
            _Stream(part, self._mount.within, int(sent))
            for part, sent in zip(self._folders, state["sent"], strict=True)
        ]
        if self._frames:
            self._frames.origin_us = origin_us

    def _sent_us(self, t_us: int) -> int:
        """The last instant of which all is sent by a time [us]."""
        if self._frames is None:
            return t_us
        return int(self._frames.instant_us(self._frames.frame_of(np.array([t_us])))[0]) - 1

    def _until(self, last_us: int) -> Events:
        events = Events.concatenate(part.until(last_us) for part in self._parts)
        if not len(events):
            return Events.empty(self.labels)
        return events.select(np.lexsort((events.x, events.y, events.t)))  # (which keeps the order within a pixel)


class _Stream:
    """The events of a camera in one part, in their order; the first `sent` are left out."""

    def __init__(self, part: Path, within: str, sent: int = 0):
        self.sent, self._part = 0, part
        self._blocks: Iterator[Events] = read_events(part / within, block=BLOCK)
        self._held = Events.empty()
        while self.sent < sent:
            if not self._fill():
                raise UsageError(f"state of {sent} events sent of a part that has {self.sent}")
            self._take(min(len(self._held), sent - self.sent))

    def until(self, last_us: int) -> Events:
        """Those up to an instant."""
        taken = []
        while self._fill():
            due = int(np.searchsorted(self._held.t, last_us, side="right"))
            taken.append(self._take(due))
            if len(self._held):
                break
        return Events.concatenate(taken)

    def _fill(self) -> bool:
        """Whether there are events, after reading some if need be."""
        while not len(self._held):
            with reading(self._part):
                block = next(self._blocks, None)
            if block is None:
                return False
            self._held = block
        return True

    def _take(self, count: int) -> Events:
        taken, self._held = self._held.stretch(0, count), self._held.stretch(count, len(self._held))
        self.sent += count
        return taken
