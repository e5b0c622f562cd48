"""Trained networks as methods."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import torch
from torch.nn import functional as F

from interp.methods.around_tiles import around_tiles
from interp.methods.gap import Gap
from interp.methods.running import PLAIN, Running
from interp.methods.tiling import Tiling, part
from interp.networks.around import Around
from interp.networks.event_fed import EventFed, States
from interp.networks.frame_fed import FrameFed
from interp.weights import load
from vid2ev.errors import DataError, UsageError

AT_ONCE_PX = 1 << 21  # pixels of images that a network makes at a time: some 200 bytes each of the smallest networks
ON_GPU_PX, BYTES_PER_PX = 1 << 24, 1024  # on a GPU, where few at a time leave it waiting; and what large networks take


@dataclass(frozen=True, slots=True)
class OfFrames:
    """A network that takes two frames; the first flow once per gap."""

    name: str
    network: FrameFed
    needs_events: bool
    running: Running = PLAIN
    sequential: bool = False

    def begin(self) -> Self:
        """Itself."""
        return self

    @torch.inference_mode()
    def between(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> torch.Tensor:
        """See `interp.methods.gap.Method`."""
        _check(self, gap)
        gap = gap if self.needs_events else replace(gap, events=None)
        with self.running.on(gap.frame_0.device):
            if tiling is None or len(tiling) == 1:
                images = self._made(gap, times)
            else:
                images = self._in_tiles(gap, times, tiling)
        return _finite(self, images)

    def _in_tiles(self, gap: Gap, times: torch.Tensor, tiling: Tiling) -> torch.Tensor:
        """Each tile is a gap for itself: what is done once per gap is done once per tile."""
        some = _at_once(gap) if self.network.spec.guided else len(times)  # (motion to targets is large)
        images = []
        for group in times.split(some):
            around = around_tiles(self.network, gap, group, tiling)
            whole = gap.frame_0.new_zeros(len(group), *gap.frame_0.shape)
            for tile in tiling:
                made = self._made(part(gap, tile), group, replace(around, corner=(tile.top, tile.left)))
                whole[(..., *tile.within)] += made * tiling.weights(tile).to(made)
            images.append(whole)
        return torch.cat(images)

    def _made(self, gap: Gap, times: torch.Tensor, around: Around | None = None) -> torch.Tensor:
        pair = self.network.prepare(gap.frame_0[None], gap.frame_1[None], gap.events, around)
        images = [self.network.at(pair, some).images[0] for some in times.split(_at_once(gap))]
        return torch.cat(images).float()


@dataclass(slots=True)
class OfEvents:
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

    @torch.inference_mode()
    def between(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> torch.Tensor:
        """See `interp.methods.gap.Method`."""
        _check(self, gap)
        assert gap.events is not None
        edges = torch.cat([times.new_zeros(1), times, times.new_ones(1)])[None]
        bins: int = self.network.spec.bins  # type: ignore[assignment, union-attr]
        voxels = gap.events.voxels(edges[:, :-1], edges[:, 1:], bins)
        with self.running.on(voxels.device):
            images, self.states = self.network.sequence(voxels, self.states)
        if not len(times):
            return gap.frame_0.new_zeros(0, *gap.frame_0.shape)
        laid = F.interpolate(images[0, :-1].float(), gap.frame_0.shape[-2:], mode="bilinear", align_corners=False)
        return _finite(self, laid.expand(-1, len(gap.frame_0), -1, -1))


def of_weights(
    path: Path, device: torch.device | str = "cpu", name: str | None = None, running: Running = PLAIN
) -> OfFrames | OfEvents:
    """The network of a file as a method; it is called like the file unless told otherwise."""
    network: Any = running.ready(load(path).to(device))
    name = name or path.stem
    if isinstance(network, FrameFed):
        return OfFrames(name, network, network.spec.takes_events, running)
    if isinstance(network, EventFed):
        return OfEvents(name, network, running)
    raise UsageError(f"{path} holds a network that rebuilds no frames in between; give one of frames or of events")


def _at_once(gap: Gap) -> int:
    """How many images are made at a time."""
    most = AT_ONCE_PX
    if gap.frame_0.is_cuda:
        most = min(ON_GPU_PX, torch.cuda.mem_get_info(gap.frame_0.device)[0] // BYTES_PER_PX)
    return max(1, most // gap.frame_0[0].numel())


def _finite(method: OfFrames | OfEvents, images: torch.Tensor) -> torch.Tensor:
    """The images of a network.  Raises DataError where they are no numbers, which weights can lead to."""
    if not bool(torch.isfinite(images).all()):
        raise DataError(f"network '{method.name}' made values that are no numbers; take other weights")
    return images


def _check(method: OfFrames | OfEvents, gap: Gap) -> None:
    if method.needs_events and gap.events is None:
        raise UsageError(
            f"network '{method.name}' was trained with events, and there are none; choose a frames-only one, or flow"
        )
