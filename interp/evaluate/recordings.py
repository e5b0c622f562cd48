"""Recordings on disk as footage: own ones, and those in the HS-ERGB or BS-ERGB layout."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from interp.data.between import events_between
from interp.data.layouts import Sequence, windows
from interp.data.layouts.ergb import Ergb
from interp.data.layouts.own import Own
from interp.evaluate.cameras import CamerasOf
from interp.evaluate.group import Cameras, Group
from interp.evaluate.pairing import Numbers
from interp.evaluate.protocol import Protocol
from interp.representation.carried import over
from vid2ev.errors import DataError
from vid2ev.recording.manifest import identity
from vid2ev.terminal import counted


class Recording:
    """A sequence on disk.

    name    by which it is called
    called  what folders of others' pictures of it may be called; as it is if that is not known
    limit   groups that are scored, from the first on; None for all
    besides   folders that are made of it, wherever they are
    """

    def __init__(
        self,
        sequence: Sequence,
        protocol: Protocol,
        name: str,
        limit: int | None = None,
        called: tuple[str, ...] = (),
        besides: Collection[Path] = (),
    ):
        self.name, self._sequence, self.protocol, self.limit = name, sequence, protocol, limit
        self.called = called or (name,)
        self._own_keys = self._sequence.key_frames if isinstance(self._sequence, Own) else []
        self.begin = self._own_keys[0] if self._own_keys else 0
        self.frames = len(self._sequence.times_us)
        self.numbers = Numbers.of_names(self._sequence.pictures).of if isinstance(self._sequence, Ergb) else []
        found = windows(self._sequence, protocol.multiple, protocol.multiple, self.begin)
        self._not_scored = dict(found.unusable)
        self._firsts = [int(first) for first in found.first][:limit]
        if left := len(found.first) - len(self._firsts):
            self._not_scored[f"beyond the limit of {limit}"] = left
        self.expected, self._scored = len(self._firsts), 0
        self.identity: dict[str, Any] = identity(sequence.folder, copies=True, deep=True, besides=besides)

    def groups(self) -> Iterator[Group]:
        """See `interp.evaluate.group.Footage`; groups with a file that cannot be read are counted."""
        cameras = CamerasOf(self._sequence) if isinstance(self._sequence, Own) else None
        failed: dict[str, int] = {}
        self._scored, before = 0, dict(self._not_scored)
        for first in self._firsts:
            try:
                group = self._group(first, cameras)
            except DataError as error:
                failed[str(error)] = failed.get(str(error), 0) + 1
                continue
            yield group
            self._scored += 1
        self._not_scored = before | failed

    def about(self) -> dict[str, Any]:
        """See `interp.evaluate.group.Footage`."""
        times = self._sequence.times_us
        typical_us = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        rate_hz = 1e6 / typical_us if typical_us > 0 else 0.0  # (0 where there is no telling, as of films)
        return {
            "kind": type(self._sequence).__name__.lower(), "frames": self.frames, "size": list(self._sequence.size),
            "event_size": list(self._sequence.event_size), "rate_hz": round(rate_hz, 3), "groups": self._scored,
            "not_scored": self._not_scored, "remarks": [*self._sequence.remarks, *self._remarks()],
        }  # fmt: skip

    def _group(self, first: int, cameras: CamerasOf | None) -> Group:
        protocol, sequence = self.protocol, self._sequence
        last = first + protocol.multiple
        times_us = np.asarray(sequence.times_us[first : last + 1])
        keys = np.stack([sequence.key(k) for k in (first, last)])
        truth = np.stack([sequence.frame(first + k) for k in protocol.positions])
        start_us, stop_us = int(times_us[0]), int(times_us[-1])
        events = events_between(sequence, keys, (start_us, stop_us), protocol.steps)
        number = (first - self.begin) // protocol.multiple
        known = cameras.at((start_us + stop_us) // 2, (first, last)) if cameras else Cameras()
        if events.places is not None:
            events = over(events, (keys.shape[1], keys.shape[2]))
        return Group(number, first, keys, protocol.positions, truth, times_us, events, known, sequence.curve)

    def _remarks(self) -> list[str]:
        multiple, remarks = self.protocol.multiple, list[str]()
        if self.frames - self.begin < 2:
            remarks.append("a single frame from its first key frame on, with none after it to rebuild")
        if left := max(self.frames - 1 - self.begin, 0) % multiple:
            remarks.append(f"not rebuilt: {counted(left, 'frame')} after the last complete group of {multiple}")
        if self.begin:
            remarks.append(f"not rebuilt: {counted(self.begin, 'frame')} before the first key frame")
        used = {k for first in self._firsts for k in (first, first + multiple)}
        if self._own_keys and (others := sum(k not in self._own_keys for k in used)):
            apart = self._own_keys[1] - self._own_keys[0] if len(self._own_keys) > 1 else 0
            remarks.append(
                f"{others} of {len(used)} key frames are frames of the truth, as the frame camera took one in {apart};"
                f" --skip {apart - 1} takes its own"
            )
        return remarks
