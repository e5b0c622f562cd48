"""`made_on_card`: the clips of some numbers, made on a GPU: `made`, but for the last bits of the light.

Light and its two cameras stay on the device; what comes back are frames and events, which are counted by threads here.
Clips whose event cameras switch on the same effects, and watch as many pictures of one size, are walked together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

from interp.data.cameras import Cameras
from interp.data.clip import Clip
from interp.data.making import looked_at, made, wanted
from interp.data.settings import ClipSettings
from interp.data.shot import Shot
from interp.data.simulate import Frames, clip_of, counts_of
from vid2ev import Events
from vid2ev.sensors.batch_on_card import DvsBatchOnCard
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
    sent: list[list[Events]] = [[] for _ in group]
    batch.restart(light[0], times_ns[0].tolist())
    for k in range(1, len(light), FRAMES):
        walked = batch.steps(light[k : k + FRAMES], times_ns[k : k + FRAMES])
        for clip, events in enumerate(sent):
            events += walked.of(clip)
    with ThreadPoolExecutor() as threads:
        counted = threads.map(partial(counts_of, settings=settings), cameras, sent)
        for (number, one), off_on in zip(group, counted, strict=True):
            yield number, clip_of(one.cameras, one.frames, off_on, one.about)
