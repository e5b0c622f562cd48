"""Videos and rendered scenes as footage: frames are dropped, and the event camera sees the light of all of them.

Truth are original frames and nothing else; light between them, for the event camera, is carried along the motion, as
`vid2ev convert` does it.  A video is gone through once, a group at a time.  What frames are scored should be close to
each other in time: the field's have 240 frames a second (GoPro) and 150 or so (HS-ERGB).
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from interp.data.layouts.sequence import NO_LATER
from interp.evaluate.group import Cameras, Group
from interp.evaluate.pairing import Numbers
from interp.evaluate.protocol import Protocol
from interp.evaluate.simulated import Seen, Simulated
from interp.own_codes import curve_of
from interp.representation.dead_time import DeadTime, look_back_us
from interp.representation.event_counts import count_events
from vid2ev import Events
from vid2ev.errors import DataError, UsageError
from vid2ev.light.recognise import pictures_in
from vid2ev.recording.manifest import identity
from vid2ev.sources import is_scene
from vid2ev.terminal import counted

SLOW_HZ = 240.0
CUT = "a cut between the key frames"


@dataclass
class Told:
    """What has become known of a film while it was gone through."""

    frames: int = 0
    groups: int = 0
    first_us: int = 0
    last_us: int = 0
    not_scored: dict[str, int] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def see(self, t_us: int) -> None:
        """A frame."""
        self.first_us = t_us if self.frames == 0 else self.first_us
        self.frames, self.last_us = self.frames + 1, t_us

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return 1e6 * (self.frames - 1) / (self.last_us - self.first_us) if self.last_us > self.first_us else 0.0


class Film:
    """A video, or `scene:NAME`, of which frames are dropped.

    name    by which it is called
    called  what folders of others' pictures of it may be called; as it is if that is not known
    limit   groups that are scored, from the first on; None for all
    besides   folders that are made of it, wherever they are
    Raises UsageError for a source that is not there, or is a recording, DataError for one that cannot be read.
    """

    def __init__(
        self,
        video: str,
        protocol: Protocol,
        name: str,
        simulated: Simulated,
        limit: int | None = None,
        called: tuple[str, ...] = (),
        besides: Collection[Path] = (),
    ):
        self.name, self.video, self.protocol, self.limit = name, video, protocol, limit
        self.called = called or (name,)
        self.begin, self._simulated, self._told = 0, simulated, Told()
        source = simulated.opened(video)
        if not source.rewindable:
            raise UsageError(f"{video} can be read once only; save it as a file to score methods on it")
        about = source.describe()
        self.size, self.curve = source.size, curve_of(about)
        self._stored = str(about.get("pixel_format", ""))
        count = max((source.frames_expected or 0) - 1, 0) // protocol.multiple
        self.expected = count if limit is None else min(count, limit)
        self.identity: dict[str, Any] = _identity(video, about, besides)

    @cached_property
    def frames(self) -> int:
        """How many it has: headers do not always say, so that a video is read for it."""
        source, count = self._simulated.opened(self.video), 0
        if is_scene(self.video) and source.frames_expected is not None:
            return source.frames_expected
        with suppress(DataError):  # (of a damaged one as many as there are)
            for _ in source.frames():
                count += 1
        return count

    @property
    def numbers(self) -> list[int]:
        """Of a folder of pictures that is scored from its first to its last."""
        if not Path(self.video).is_dir() or {"start", "stop"} & self._simulated.options.keys():
            return []
        found = Numbers.of_names(pictures_in(Path(self.video))).of
        return found if len(found) == self.frames else []

    def groups(self) -> Iterator[Group]:
        """See `interp.evaluate.group.Footage`; those across a cut, or of no time, are counted."""
        told = self._told = Told()
        part, known, number = list[Seen](), Events.empty(), 0
        back_us = look_back_us(DeadTime.of(self._simulated.spec.model_dump()))
        source = self._simulated.opened(self.video)
        try:
            with closing(self._simulated.seen(self.video, source)) as coming:
                for seen in coming:
                    if told.groups == self.limit:
                        told.remarks.append(f"limited to the first {self.limit} group{'s' * (self.limit != 1)}")
                        break
                    told.see(seen.t_us)
                    part.append(seen)
                    if len(part) <= self.protocol.multiple:
                        continue
                    events = Events.concatenate([known, *(each.events for each in part[1:])])
                    if reason := _unfit(part):
                        told.not_scored[reason] = told.not_scored.get(reason, 0) + 1
                    else:
                        yield self._group(number, part, events)
                        told.groups += 1
                    known, part, number = _after(events, seen.t_us - back_us), [seen], number + 1
        except DataError as error:
            told.remarks.append(f"ended early: {error}")
        told.remarks += source.warnings
        if left := len(part) - 1:
            told.remarks.append(
                f"not rebuilt: {counted(left, 'frame')} after the last complete group of {self.protocol.multiple}"
            )

    def about(self) -> dict[str, Any]:
        """See `interp.evaluate.group.Footage`."""
        told, remarks = self._told, list[str]()
        if 0 < told.rate_hz < 0.98 * SLOW_HZ:
            remarks.append(
                f"{told.rate_hz:.4g} frames a second, and frames that are dropped are scored: expected at least"
                f" {SLOW_HZ:g}, as between slower ones light is made up; give --slowdown if it plays slower than the"
                " world went"
            )
        return {
            "kind": "scene" if is_scene(self.video) else "video", "frames": told.frames, "size": list(self.size),
            "event_size": list(self.size), "sensor": self._simulated.name, "rate_hz": round(told.rate_hz, 3),
            "curve": self.curve, "stored": self._stored, "groups": told.groups, "not_scored": told.not_scored,
            "remarks": [*remarks, *told.remarks],
        }  # fmt: skip

    def _group(self, number: int, part: list[Seen], events: Events) -> Group:
        protocol, spec = self.protocol, self._simulated.spec
        start_us, stop_us = part[0].t_us, part[-1].t_us
        contrast = spec.threshold_off, spec.threshold_on
        dead_time = DeadTime.of(spec.model_dump())
        counts = count_events(events, self.size, start_us, stop_us, protocol.steps, contrast, dead_time)
        keys = np.stack([part[0].codes, part[-1].codes])
        truth = np.stack([part[k].codes for k in protocol.positions])
        times_us = np.array([each.t_us for each in part])
        cameras = Cameras(disparity_px=0.0, offset_us=0.0)  # (one place, one clock; how it was exposed, nobody knows)
        first, positions = number * protocol.multiple, protocol.positions
        return Group(number, first, keys, positions, truth, times_us, counts, cameras, self.curve)


def _identity(video: str, about: Mapping[str, Any], besides: Collection[Path]) -> dict[str, Any]:
    """What tells a film from another: what is in its files, and times that lie beside them, or of a scene every number
    of it, and its photographs and meshes."""
    path = Path(video)
    if os.path.exists(path) and not is_scene(video):
        times = {"times": of_times} if (of_times := about.get("timestamps_sha256")) else {}
        return {"video": path.name, **identity(path, copies=True, deep=True, besides=besides), **times}
    return {"video": video, "sha256": hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()}


def _unfit(part: list[Seen]) -> str:
    """Why the frames of a gap cannot be scored; empty if they can."""
    if any(each.shot for each in part[1:]):
        return CUT
    # (more than a million a second have the same microsecond, and a gap of no length has no time in between)
    return NO_LATER if any(b.t_us <= a.t_us for a, b in pairwise(part)) else ""


def _after(events: Events, t_us: int) -> Events:
    """Those later than a time: sensors of a fixed rate may put an event after the light that it is of."""
    return events.select(events.t > t_us)
