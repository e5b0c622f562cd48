"""`made_on_card`: the clips of some numbers, made on a GPU: `made`, but for the last bits of the light.

Light, its two cameras and the counts of events stay on the device; what comes back is the clip.  Clips whose event
cameras switch on the same effects, and watch as many pictures of one size, are walked together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np

from interp.data.cameras import Cameras
from interp.data.clip import Clip
from interp.data.making import looked_at, made, wanted
from interp.data.settings import ClipSettings
from interp.data.shot import Shot
from interp.data.simulate import MOST, Frames, clip_of
from vid2ev.sensors.batch_on_card import DvsBatchOnCard
from vid2ev.sensors.card_events import CardSent
from vid2ev.sensors.cis_on_card import CisOnCard
from vid2ev.sensors.compiled import flags_of
from vid2ev.sensors.devices import Device
from vid2ev.stream.upload import as_array

FRAMES = 16  # that are walked at a time: room for events is made for those of so many
WAITING = 1 << 27  # pixels of the pictures that wait until more go with them: half a gigabyte


class Seen:
    """A clip of which the frame camera has seen all, and the light [n, h, w] that waits for the event camera."""

    def __init__(self, shot: Shot, cameras: Cameras, settings: ClipSettings, device: Device):
        light, luminance = shot.on_device(device, cameras.steps, cameras.first, cameras.last)
        gain = cameras.gain(as_array(light[0]))
        self.cameras, self.about = cameras, cameras.about(shot, gain)
        self.frames = Frames(cameras, settings, partial(CisOnCard, memory=device.memory))
        for j, frame in enumerate(light * float(gain), cameras.first):
            self.frames.add(j, frame)
        self.luminance = luminance[: cameras.steps - cameras.first + 1] * float(gain)


class CountsOnCard:
    """Events of some clips, counted in equal parts of the time from one gap after 0 to two, by polarity."""

    def __init__(self, memory: Any, cameras: list[Cameras], bins: int):
        (width, height), self._memory, self._bins = cameras[0].size_of_events, memory, bins
        self._gap_us, self._pixels = memory.put(np.array([one.gap_us for one in cameras])), width * height
        self._shape = len(cameras), 2, bins, height, width
        self._sums = memory.zeros(int(np.prod(self._shape)), np.int32)

    def add(self, sent: CardSent) -> None:
        """Count events."""
        gap_us = self._gap_us[sent.clip]
        part = ((sent.t - gap_us) * self._bins - 1) // gap_us  # (as of `count_events`)
        inside = (part >= 0) & (part < self._bins)
        place = (((2 * sent.clip + sent.p) * self._bins + part) * self._pixels + sent.pixel)[inside]
        self._memory.add_at(self._sums, place, self._memory.cast(place * 0 + 1, np.int32))

    def take(self) -> np.ndarray:
        """OFF and ON events, uint8 [clips, 2, S, h, w]."""
        counts = self._memory.cast(self._sums.clip(0, MOST), np.uint8)
        return self._memory.get(counts).reshape(self._shape)  # type: ignore[no-any-return]


def made_on_card(
    settings: ClipSettings, seed: int, numbers: Iterable[int], device: Device
) -> Iterator[tuple[int, Clip]]:
    """The clips of some numbers, each with its number, in whatever order they are ready.

    Raises UsageError, DataError for files of the settings that cannot be read.
    """
    waiting: dict[Any, list[tuple[int, Seen]]] = {}
    for number in numbers:
        want = wanted(settings, seed, number)
        if want.source == "recordings":
            yield number, made(settings, seed, number)
            continue
        shot, cameras = looked_at(want, settings, seed, number)
        waiting.setdefault(_kind(cameras), []).append((number, Seen(shot, cameras, settings, device)))
        if sum(one.luminance.shape.numel() for group in waiting.values() for _, one in group) >= WAITING:
            yield from _all_walked(waiting, settings, device)
            waiting = {}
    yield from _all_walked(waiting, settings, device)


def _kind(cameras: Cameras) -> tuple[Any, ...]:
    """What clips have in common that go together."""
    return flags_of(cameras.dvs, labels=False), cameras.size_of_events, cameras.steps - cameras.first


def _all_walked(
    groups: dict[Any, list[tuple[int, Seen]]], settings: ClipSettings, device: Device
) -> Iterator[tuple[int, Clip]]:
    for group in groups.values():
        yield from _walked(group, settings, device)


def _walked(group: list[tuple[int, Seen]], settings: ClipSettings, device: Device) -> Iterator[tuple[int, Clip]]:
    """The clips of a group, with the events that their event cameras send."""
    import torch

    cameras = [one.cameras for _, one in group]
    light = torch.stack([one.luminance for _, one in group], dim=1)
    times_ns = np.array([[one.t_ns(j) for j in range(one.first, one.steps + 1)] for one in cameras]).T
    specs, seeds = [one.dvs for one in cameras], [one.seed for one in cameras]
    batch = DvsBatchOnCard(specs, cameras[0].size_of_events, seeds, memory=device.memory)
    counts = CountsOnCard(device.memory, cameras, settings.bins)
    batch.restart(light[0], times_ns[0].tolist())
    for k in range(1, len(light), FRAMES):
        batch.fill(counts, light[k : k + FRAMES], times_ns[k : k + FRAMES])
    for (number, one), off_on in zip(group, counts.take(), strict=True):
        yield number, clip_of(one.cameras, one.frames, off_on, one.about)
