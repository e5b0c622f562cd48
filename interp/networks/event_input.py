"""Events as input of a network that refines flows: bins, as the paper has them, or halves.

    bins     the time between the frames in B bins; of these the first, the last, and the one at the target
    halves   from the target back to the first frame and on to the second, B bins each

Optionally a convolutional recurrent network first walks over the bins, one after the other, and gives as many; and a
UNet changes them by what it sees in both frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import torch
from pydantic import Field
from torch import nn

from interp.blocks.recurrent import ConvGru, State
from interp.networks.frame_fed import Pair, run
from interp.networks.spec import FrameFedSpec

Events = Literal["none", "bins", "halves"]
HIDDEN = 8


class EventInputSpec(FrameFedSpec):
    """Options of networks that refine flows with events."""

    events: Events = Field(
        default="halves",
        description="into the UNet that refines flows: none, bins (first, last, target; 3 channels) or halves (2 bins"
        " channels); 1,568 parameters and 1.568 kMAC/px for each channel in Super SloMo's (at tiny a quarter of that),"
        " 288 parameters and 0.288 kMAC/px in RRINSloMoEvents'",
    )
    bins: int = Field(default=5, ge=1, le=64, description="of events, in each half or between the frames; see events")

    @property
    def takes_events(self) -> bool:
        return self.events != "none"


class BinWalk(nn.Module):
    """A GRU of 8 channels that walks over bins: as many again, each with what was before it."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = ConvGru(1, HIDDEN)
        self.head = nn.Conv2d(HIDDEN, 1, 3, padding=1)

    def forward(self, bins: torch.Tensor) -> torch.Tensor:
        """[B, bins, H, W] of the same."""
        state: State | None = None
        made = []
        for one in bins.split(1, dim=1):
            h, state = self.cell(one, state)
            made.append(one + self.head(h).float())
        return torch.cat(made, 1)


class EventInput(nn.Module):
    """Events of a pair as channels of a network."""

    def __init__(
        self, events: Events, bins: int, recurrent: bool = False, prepare: Callable[[int], nn.Module] | None = None
    ):
        super().__init__()
        self.events, self.bins = events, bins
        self.walk = BinWalk() if recurrent and events != "none" else None
        prepared = {"none": 0, "bins": bins, "halves": 2 * bins}[events]
        self.prepare = prepare(prepared) if prepare and prepared else None
        self.channels = {"none": 0, "bins": 3, "halves": 2 * bins}[events]

    def once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """What does not depend on the target: all bins [B, bins, H, W], if bins are taken."""
        if self.events != "bins":
            return ()
        whole = pair.events.whole(self.bins)
        return (self._prepared(pair, self.walk(whole) if self.walk else whole),)

    def at(self, pair: Pair, once: tuple[torch.Tensor, ...], times: torch.Tensor) -> list[torch.Tensor]:
        """Channels [B, N, channels, H, W] at times [B, N], in a list that is empty without events."""
        if self.events == "none":
            return []
        if self.events == "bins":
            return [first_last_and_target(once[0], times)]
        halves = pair.events.halves(times, self.bins)
        if self.walk is not None:
            both = halves.unflatten(2, (2, self.bins))
            halves = self.walk(both.flatten(0, 2)).unflatten(0, both.shape[:3]).flatten(2, 3)
        return [self._prepared(pair, halves)]

    def _prepared(self, pair: Pair, bins: torch.Tensor) -> torch.Tensor:
        """Bins [B, bins, H, W] or [B, N, bins, H, W], changed by what both frames show."""
        if self.prepare is None:
            return bins
        change = run(self.prepare, [pair.frame_0, pair.frame_1, bins if bins.ndim == 5 else bins[:, None]])
        return bins + change.reshape(bins.shape)


def first_last_and_target(bins: torch.Tensor, times: torch.Tensor) -> torch.Tensor:
    """Of bins [B, bins, H, W] the first, the last and the nearest to each target at times [B, N]: [B, N, 3, H, W]."""
    targets, last = times.shape[1], bins.shape[1] - 1
    nearest = torch.round(times * last).long()
    target = torch.stack([bins[k, chosen] for k, chosen in enumerate(nearest)])
    ends = bins[:, None, [0, last]].expand(-1, targets, -1, -1, -1)
    return torch.cat([ends, target[:, :, None]], 2)
