"""Trained networks as methods."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import torch
from torch.nn import functional as F

from interp.methods.around_tiles import around_tiles
from interp.methods.gap import Gap, Together
from interp.methods.running import PLAIN, Running, finite
from interp.methods.tiling import Tiling, part
from interp.networks.around import Around
from interp.networks.event_fed import EventFed, States
from interp.networks.frame_fed import FrameFed, Pair
from interp.pretrained import name_of
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts
from interp.weights import load
from vid2ev.errors import UsageError

AT_ONCE_PX = 1 << 21  # pixels of images that a network makes at a time: some 200 bytes each of the smallest networks
HELD = 1 << 27  # values of images that are put together of tiles at a time, 4 bytes each
ON_GPU_PX, BYTES_PER_PX = 1 << 24, 1024  # on a GPU, where few at a time leave it waiting; and what large networks take


@dataclass(frozen=True, slots=True)
class OfFrames(Together):
    """A network that takes two frames; the first flow once per gap."""

    name: str
    network: FrameFed
    needs_events: bool
    running: Running = PLAIN
    sequential: bool = False

    def begin(self) -> Self:
        """Itself."""
        return self

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """See `interp.methods.gap.Method`."""
        _check(self, gap)
        if not len(times):
            return iter(())
        gap = gap if self.needs_events else replace(gap, events=None)
        if tiling is not None and len(tiling) > 1:
            # (motion to targets is large)
            some = _at_once(gap) if self.network.spec.guided else max(1, HELD // gap.frame_0.numel())
            return (self._in_tiles(gap, group, tiling) for group in _evenly(times, some))
        with torch.inference_mode(), self.running.on(gap.frame_0.device):
            pair = self._prepared(gap)
        return (self._at(pair, group) for group in times.split(_at_once(gap)))

    @torch.inference_mode()
    def _in_tiles(self, gap: Gap, times: torch.Tensor, tiling: Tiling) -> torch.Tensor:
        """Each tile is a gap for itself: what is done once per gap is done once per tile."""
        with self.running.on(gap.frame_0.device):
            around = around_tiles(self.network, gap, times, tiling)
        whole = gap.frame_0.new_zeros(len(times), *gap.frame_0.shape)
        for tile in tiling:
            seen = part(gap, tile)
            with self.running.on(gap.frame_0.device):
                pair = self._prepared(seen, replace(around, corner=(tile.top, tile.left)))
            # (motion to targets is of all of them; a GPU may have less free memory by now)
            some = len(times) if self.network.spec.guided else _at_once(seen)
            made = torch.cat([self._at(pair, group) for group in times.split(some)])
            whole[(..., *tile.within)] += made * tiling.weights(tile).to(made)
        return whole

    def _prepared(self, gap: Gap, around: Around | None = None) -> Pair:
        return self.network.prepare(gap.frame_0[None], gap.frame_1[None], gap.events, around)

    @torch.inference_mode()
    def _at(self, pair: Pair, times: torch.Tensor) -> torch.Tensor:
        with self.running.on(pair.frame_0.device):
            return finite(self.network.at(pair, times).images[0].float(), self.name, self.running)


@dataclass(slots=True)
class OfEvents(Together):
    """A network that takes events alone, window after window, from each time to the next; its images are grey."""

    name: str
    network: EventFed
    running: Running = PLAIN
    needs_events: bool = True
    sequential: bool = True
    states: States = field(default=(), repr=False)

    def begin(self) -> Self:
        """With no memory."""
        return replace(self, states=())

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """See `interp.methods.gap.Method`."""
        _check(self, gap)
        assert gap.events is not None
        height, width = gap.frame_0.shape[-2:]
        events = gap.events if gap.events.places is None else over(gap.events, (height, width))
        edges = torch.cat([times.new_zeros(1), times, times.new_ones(1)])[None]
        for k in range(len(times)):
            yield self._after(gap, events, edges[:, k : k + 2])
        self._after(gap, events, edges[:, -2:])

    @torch.inference_mode()
    def _after(self, gap: Gap, events: EventCounts, window: torch.Tensor) -> torch.Tensor:
        """The image [1, C, H, W] after the events of a window [1, 2], which are remembered."""
        voxels = events.voxels(window[:, :1], window[:, 1:], int(self.network.spec.bins))  # type: ignore[arg-type, union-attr]
        with self.running.on(voxels.device):
            image, self.states = self.network(voxels[:, 0], self.states)
        laid = F.interpolate(image.float(), gap.frame_0.shape[-2:], mode="bilinear", align_corners=False)
        return finite(laid, self.name, self.running).expand(-1, len(gap.frame_0), -1, -1)


def of_weights(
    path: Path, device: torch.device | str = "cpu", name: str | None = None, running: Running = PLAIN
) -> OfFrames | OfEvents:
    """The network of a file as a method; it is called as `interp.pretrained.name_of` says unless told otherwise.

    Raises UsageError for a network that rebuilds no frames, or takes no sRGB codes; DataError for a file that holds
    none.
    """
    network: Any = running.ready(load(path).to(device))
    name = name or name_of(path)
    if isinstance(network, FrameFed):
        if network.transfer != "srgb":
            raise UsageError(f"{path} holds a network for linear light, and frames are sRGB codes; give others")
        return OfFrames(name, network, network.spec.takes_events, running)
    if isinstance(network, EventFed):
        return OfEvents(name, network, running)
    raise UsageError(f"{path} holds a network that rebuilds no frames in between; give others, as rrin_light-tiny")


def _at_once(gap: Gap) -> int:
    """How many images are made at a time."""
    most = AT_ONCE_PX
    if gap.frame_0.is_cuda:
        most = min(ON_GPU_PX, torch.cuda.mem_get_info(gap.frame_0.device)[0] // BYTES_PER_PX)
    return max(1, most // gap.frame_0[0].numel())


def _evenly(times: torch.Tensor, some: int) -> tuple[torch.Tensor, ...]:
    """Groups of at most so many, about as large as each other."""
    return times.tensor_split(-(-len(times) // some))


def _check(method: OfFrames | OfEvents, gap: Gap) -> None:
    if method.needs_events and gap.events is None:
        raise UsageError(
            f"network '{method.name}' was trained with events, and there are none; choose a frames-only one, or flow"
        )
