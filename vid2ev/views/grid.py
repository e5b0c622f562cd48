"""Grids: what events become as they are sent: those of a pixel in order of time, pixels in any order.

    NetCounts   planes[k, y, x] = N_ON - N_OFF in (edges[k], edges[k + 1]]     int8 or int16 [n, height, width]
    Windows     a representation of each of some windows (start, stop], which may overlap: voxel grids, counts, frames

Events at an edge belong to the interval that ends there, as in slices.  An event outside of all intervals, or of a
window, is not in it.  Counts beyond what the type holds stay at its end.

A pixel's values come from its own events alone, in order of time.  So a grid is the same to the bit whether it is given
a recording's events in their order or what a sensor sends as it sends it (`Dvs.fill`): each sum has the same terms in
the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.errors import UsageError
from vid2ev.stream.events import Events, check_within
from vid2ev.views.requests import parse_representation

if TYPE_CHECKING:
    from vid2ev.views.representation import Kind


class Grid(Protocol):
    """What events are put into."""

    def add(self, events: Events) -> None:
        """Take in events; those of a pixel come in order of time.  Raises ValueError for pixels outside."""

    def take(self) -> np.ndarray:
        """The array of the events since the last call."""


class NetCounts:
    """ON minus OFF events of a sensor of `size` (width, height) between each two of the ascending `edges_us`.

    dtype      int8, in which counts stay within -128 ... 127 event by event, or int16
    polarity   count OFF and ON events apart, as [n, 2, height, width]
    """

    def __init__(
        self,
        size: tuple[int, int],
        edges_us: Sequence[int] | np.ndarray,
        *,
        dtype: Any = np.int8,
        polarity: bool = False,
    ):
        self.size, self.dtype, self.edges_us = size, np.dtype(dtype), edges_of(edges_us)
        if self.dtype not in (np.int8, np.int16):
            raise UsageError(f"counts of type {self.dtype}: expected int8 or int16")
        self.shape = (len(self.edges_us) - 1, 2 if polarity else 1, size[1], size[0])
        self._planes = np.zeros(self.shape, self.dtype)

    def add(self, events: Events) -> None:
        """Count events."""
        check_within(events, self.size)
        _count(events.t, events.x, events.y, events.p, self.edges_us, np.iinfo(self.dtype).max, self._planes)

    def take(self) -> np.ndarray:
        """The planes of the events since the last call."""
        taken, self._planes = self._planes, np.zeros(self.shape, self.dtype)
        return taken[:, 0] if self.shape[1] == 1 else taken


class Windows:
    """A representation of `kind`, such as "voxel:5" (`views.requests`), of a sensor of `size` in each of `windows_us`
    [n, 2]."""

    def __init__(self, size: tuple[int, int], kind: Kind | str, windows_us: Sequence[Sequence[int]] | np.ndarray):
        kind = parse_representation(kind) if isinstance(kind, str) else kind
        self.windows_us, self._anew = windows_of(windows_us), partial(kind, size)
        self._views = [self._anew() for _ in self.windows_us]

    def add(self, events: Events) -> None:
        """Take in events, those that are in a window."""
        if len(events) == 0:
            return
        first, last = int(events.t.min()), int(events.t.max())
        for view, (start, stop) in zip(self._views, self.windows_us.tolist(), strict=True):
            if start < first and last <= stop:
                view.add(events, start, stop)
            elif first <= stop and last > start:
                view.add(events.select((events.t > start) & (events.t <= stop)), start, stop)

    def take(self) -> np.ndarray:
        """The arrays of the windows, [n, ...], of the events since the last call."""
        stops = self.windows_us[:, 1].tolist()
        taken = np.stack([view.take(stop) for view, stop in zip(self._views, stops, strict=True)])
        self._views = [self._anew() for _ in stops]  # (time surfaces remember what was before)
        return taken


def edges_of(edges_us: Sequence[int] | np.ndarray) -> np.ndarray:
    """Edges of intervals, int64 [us]; raises UsageError for fewer than two, or such as do not ascend."""
    edges = _whole(edges_us)
    if edges.ndim != 1 or len(edges) < 2 or (edges[1:] <= edges[:-1]).any():
        raise UsageError(f"edges of shape {edges.shape}: expected two or more times [us], each after the one before")
    return edges


def _whole(times_us: Any) -> np.ndarray:
    try:
        given = np.asarray(times_us)
        with np.errstate(invalid="ignore"):
            times = given.astype(np.int64)
    except (ValueError, TypeError, OverflowError) as error:
        raise UsageError(f"times {str(times_us)[:80]}: expected whole numbers of microseconds ({error})") from error
    if (times != given).any():
        raise UsageError(f"times {given[times != given][:3].tolist()} ...: expected whole numbers of microseconds")
    return times


def windows_of(windows_us: Sequence[Sequence[int]] | np.ndarray) -> np.ndarray:
    """Windows, int64 [n, 2] [us]; raises UsageError for none, or such as end before they start."""
    windows = _whole(windows_us)
    if windows.ndim != 2 or windows.shape[1:] != (2,) or len(windows) == 0 or (windows[:, 0] > windows[:, 1]).any():
        raise UsageError(f"windows of shape {windows.shape}: expected [n, 2], a start and a later stop [us]")
    return windows


@cached
def _count(t, x, y, p, edges, most, planes):  # type: ignore[no-untyped-def]
    apart, k, last = planes.shape[1] == 2, 0, len(edges) - 2
    for i in range(len(t)):
        if t[i] <= edges[0] or t[i] > edges[last + 1]:
            continue
        while t[i] <= edges[k]:
            k -= 1
        while t[i] > edges[k + 1]:
            k += 1
        channel = min(p[i], 1) if apart else 0
        net = planes[k, channel, y[i], x[i]] + (1 if apart or p[i] else -1)
        planes[k, channel, y[i], x[i]] = min(max(net, -most - 1), most)
