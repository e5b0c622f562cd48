"""The events between two frames as counts per sub-interval: what networks are given for any number of target times.

OFF and ON events of each of S equal sub-intervals are counted apart.  Voxels of any window are then one product of
matrices (`bins.py`), the same for recordings and for what is simulated while training.

    change    sum over events of +c_ON or -c_OFF [nat]: by how much the log of light has changed
    voxels    change per bin / (3 * 0.15 nat), within -10 ... 10: an event of the usual threshold is a third

The gain is fixed: how many events there are says how large contrast and motion are, which a division by their
standard deviation would take away, and there is nothing to divide by where there are none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch.nn import functional as F

from interp.precision import in_full_precision
from interp.representation.bins import bin_weights
from interp.representation.dead_time import DeadTime, look_back_us
from interp.rows import by_rows
from vid2ev.errors import UsageError
from vid2ev.requests import is_whole

if TYPE_CHECKING:
    from vid2ev import Events

USUAL_NATS = 0.15  # the paper's threshold
PER_VOXEL_NATS = 3 * USUAL_NATS
MOST_NATS = 100.0  # that a threshold may be (`vid2ev.physics.comparator`)
LARGEST = 10.0
WHOLE16 = 2048  # the largest up to which float16 has all whole numbers


@dataclass(frozen=True, slots=True)
class Places:
    """Where pixels of B frames look at an event camera.

    where   [B, H, W, 2] px of the event camera (x, y); NaN is a place that is not known
    across  how many of its pixels one of the frame is wide, of each of B, in the middle of all
    """

    where: torch.Tensor
    across: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class EventCounts:
    """Counts of B pairs of frames.

    off_on     [B, 2, S, H, W], of any type: OFF and ON events of the sub-intervals, with what dead time hid if known
    contrast   [B, 2] nats that an OFF and an ON event stand for
    footprint  pixels across of the frames that a pixel of the event camera looks at, where it has been laid over them
    places     where pixels of frames look, if that is known and counts have not been carried there yet: for part after
               part of large frames (`carried.over`)
    """

    off_on: torch.Tensor
    contrast: torch.Tensor
    footprint: int = 1
    places: Places | None = None

    @property
    def steps(self) -> int:
        """S, the number of sub-intervals."""
        return self.off_on.shape[2]

    def change(self, start: torch.Tensor, stop: torch.Tensor) -> torch.Tensor:
        """Change of log light [B, N, H, W] nats in windows [B, N], in 0 ... 1 of the time between the frames."""
        return _in_bins(self.off_on, self._signs(), start, stop, 1).squeeze(2)

    def number(self, start: torch.Tensor, stop: torch.Tensor) -> torch.Tensor:
        """Number of events, OFF and ON, [B, N, H, W] in windows [B, N]."""
        return _in_bins(self.off_on, torch.ones_like(self._signs()), start, stop, 1).squeeze(2)

    def voxels(self, start: torch.Tensor, stop: torch.Tensor, bins: int) -> torch.Tensor:
        """Voxel grids [B, N, bins, H, W] of windows [B, N]."""
        return as_voxels(_in_bins(self.off_on, self._signs(), start, stop, bins))

    def halves(self, times: torch.Tensor, bins: int) -> torch.Tensor:
        """Voxel grids [B, N, 2 bins, H, W]: from each time back to the first frame, then on to the second.

        Backwards what got darker gets brighter: signs and bins are turned around, so that both halves look alike.
        """
        before, after = self.voxels(*before_and_after(times), bins).chunk(2, 1)
        return torch.cat([-before.flip(2), after], dim=2)

    def whole(self, bins: int) -> torch.Tensor:
        """The voxel grid [B, bins, H, W] of all the time between the frames."""
        start = self.contrast.new_zeros(len(self.contrast), 1)
        return self.voxels(start, start + 1, bins).squeeze(1)

    def _signs(self) -> torch.Tensor:
        """What an OFF and an ON event count as, [B, 2] nats."""
        return self.contrast.float() * self.contrast.new_tensor([-1, 1])

    def padded(self, right: int, below: int) -> EventCounts:
        """In float32, with so many pixels more, in which nothing happens."""
        return replace(self, off_on=F.pad(self.off_on.float(), (0, right, 0, below)))

    def pooled(self, factor: int) -> EventCounts:
        """Means of squares of pixels, as a sensor of larger pixels would count; at edges of those there are."""
        if factor == 1:
            return self
        counts = F.avg_pool2d(self.off_on.float().flatten(1, 2), factor, ceil_mode=True, count_include_pad=False)
        return replace(self, off_on=counts.unflatten(1, (2, self.steps)))

    def summed(self) -> EventCounts:
        """All of the time as one sub-interval, in float32."""
        return replace(self, off_on=by_rows(lambda counts: counts.float().sum(2, keepdim=True), self.off_on))

    def to(self, device: torch.device | str) -> EventCounts:
        """The same on a device."""
        places = self.places and replace(self.places, where=self.places.where.to(device))
        return replace(self, off_on=self.off_on.to(device), contrast=self.contrast.to(device), places=places)

    @staticmethod
    def none(batch: int, size: tuple[int, int], steps: int = 1, contrast: float = USUAL_NATS) -> EventCounts:
        """No events, for sizes (height, width)."""
        return EventCounts(torch.zeros(batch, 2, steps, *size), torch.full((batch, 2), contrast))


def contrast_of(parameters: Mapping[str, Any]) -> tuple[float, float]:
    """What an OFF and an ON event stand for [nat], of a sensor's parameters.

    Raises KeyError, TypeError, ValueError for what no sensor has.
    """
    off, on = (float(parameters[name]) for name in ("threshold_off", "threshold_on"))
    if not (0 < off <= MOST_NATS and 0 < on <= MOST_NATS):
        raise ValueError(f"thresholds {(off, on)}")
    return off, on


def before_and_after(times: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Start and stop [B, 2 N] of the windows from the first frame to each of the times [B, N], then from those on."""
    return torch.cat([torch.zeros_like(times), times], 1), torch.cat([times, torch.ones_like(times)], 1)


def count_events(
    events: Events,
    size: tuple[int, int],
    start_us: int,
    stop_us: int,
    steps: int = 32,
    contrast: tuple[float, float] = (USUAL_NATS, USUAL_NATS),
    dead_time: DeadTime | None = None,
) -> EventCounts:
    """Counts, B = 1, of the events in (start_us, stop_us] on a sensor of `size` (width, height).

    events     in order of time; of a dead time with those before that matter to it (`look_back_us`)
    steps      S; an event at the edge of two sub-intervals is in the earlier one
    contrast   nats that an OFF and an ON event stand for
    dead_time  of the pixels: an event counts for the crossings that it hides, too; None if that is not known
    Raises UsageError for events outside of the sensor and for less than one sub-interval.
    """
    if not is_whole(steps, 1):
        raise UsageError(f"{steps} sub-intervals between frames: expected at least 1; choose for example 32")
    width, height = size
    times_us = np.asarray(events.t).astype(np.int64)
    known = (times_us > start_us - look_back_us(dead_time)) & (times_us <= stop_us)
    t, x, y, p = (np.asarray(each)[known].astype(np.int64) for each in (events.t, events.x, events.y, events.p))
    if len(x) and (min(x.min(), y.min()) < 0 or x.max() >= width or y.max() >= height):
        raise UsageError(f"events outside of the {width}x{height} sensor; give the size of the sensor that sent them")
    worth = dead_time.crossings(t, y * width + x, p) if dead_time else None
    inside = t > start_us
    t, x, y, p = (each[inside] for each in (t, x, y, p))
    worth = None if worth is None else worth[inside]
    step = ((t - start_us) * steps - 1) // max(stop_us - start_us, 1)
    place = (np.minimum(p, 1) * height + y) * width + x
    narrow, most, wide = (np.uint8, 255, np.int32) if worth is None else (np.float16, WHOLE16, np.float32)
    counts = np.zeros((2, steps, height, width), narrow)
    for k, chosen in enumerate(_parts(step, steps)):
        part = np.bincount(place[chosen], None if worth is None else worth[chosen], 2 * height * width)
        if counts.dtype == narrow and part.max(initial=0) > most:
            counts = counts.astype(wide)
        counts[:, k] = part.reshape(2, height, width)
    return EventCounts(torch.from_numpy(counts)[None], torch.tensor([contrast], dtype=torch.float32))


def _parts(step: np.ndarray, steps: int) -> Iterator[np.ndarray]:
    """The places of the events of each sub-interval."""
    order = np.argsort(step, kind="stable")
    edges = np.searchsorted(step[order], np.arange(steps + 1))
    yield from (order[start:stop] for start, stop in pairwise(edges))


def as_voxels(nats: torch.Tensor) -> torch.Tensor:
    """Change of log light [nat] in the units that networks take."""
    return (nats / PER_VOXEL_NATS).clamp(-LARGEST, LARGEST)


@in_full_precision
def _in_bins(
    off_on: torch.Tensor, worth: torch.Tensor, start: torch.Tensor, stop: torch.Tensor, bins: int
) -> torch.Tensor:
    """[B, N, bins, H, W] of counts [B, 2, S, H, W]; worth [B, 2]: what an OFF and an ON event count as."""
    weights = bin_weights(start, stop, bins, off_on.shape[2])
    both = torch.cat([weights * share[:, None, None, None] for share in worth.unbind(1)], -1)
    return by_rows(lambda counts: _added_up(both, counts), off_on)


def _added_up(weights: torch.Tensor, off_on: torch.Tensor) -> torch.Tensor:
    """Sums [B, N, bins, H, W] of counts [B, 2, S, H, W] by weights [B, N, bins, 2 S]."""
    found = weights.flatten(1, 2) @ off_on.float().flatten(1, 2).flatten(2)
    return found.unflatten(1, weights.shape[1:3]).unflatten(3, off_on.shape[3:])
