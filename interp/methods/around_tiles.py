"""What the tiles of a network must know of the whole frames: see `interp.networks.around`.

The light that motion to targets is sought by is made part by part, pixel by pixel as it is; the motion then of all.
Frames are continued as the network continues them, so that tiles and whole have the same borders.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from interp.candidates.alone import alone
from interp.candidates.bridge import highest_of
from interp.candidates.sight import Sight
from interp.methods.closed_forms import in_cells, ramps_and_doubt
from interp.methods.gap import Gap
from interp.methods.tiling import Tile, Tiling, strips
from interp.networks.around import Around
from interp.networks.frame_fed import FrameFed, sought
from interp.representation.carried import footprint_over, over
from interp.representation.event_counts import EventCounts


def around_tiles(network: FrameFed, gap: Gap, times: torch.Tensor, tiling: Tiling) -> Around:
    """What tiles of a gap need for their images at times [N]."""
    whole = network.padded(gap.frame_0[None], gap.frame_1[None])
    around = Around(
        whole.frame_0,
        whole.frame_1,
        highest_of(whole.frame_0, whole.frame_1, network.transfer),
        between=sought(whole, network.transfer) if network.seeks_motion else None,
        coloured=whole.coloured,
    )
    if not network.spec.guided:
        return around
    sight = _sight(network, gap, times, around)
    height, width = around.frame_0.shape[-2:]
    flows = sight.motion(in_cells(sight, tiling.continued(width, height)))
    return replace(around, to_targets=flows, alone=sight.alone)


def _sight(network: FrameFed, gap: Gap, times: torch.Tensor, around: Around) -> Sight:
    """What is known before motion is, of the frames, continued."""
    assert gap.events is not None
    frames, transfer = (around.frame_0, around.frame_1), network.transfer

    def law(strip: Tile) -> torch.Tensor:
        first, last = (frame[(..., *strip.within)] for frame in frames)
        return ramps_and_doubt(first, last, _events_in(gap, strip), times[None], around.highest, transfer)

    seen = strips(frames[0].shape[-1], frames[0].shape[-2]).cells(law)
    footprint = footprint_over(gap.events, (gap.frame_0.shape[-2], gap.frame_0.shape[-1]))
    by_themselves = alone(*frames, times[None], transfer)
    return Sight(frames, seen[:, :, :-1], seen[:, :, -1:], by_themselves, times[None], footprint, transfer)


def _events_in(gap: Gap, strip: Tile) -> EventCounts:
    """The events of a part of the frames, continued by none."""
    assert gap.events is not None
    height, width = gap.frame_0.shape[-2:]
    right, below = max(strip.right - width, 0), max(strip.bottom - height, 0)
    within = slice(strip.top, strip.bottom - below), slice(strip.left, strip.right - right)
    return over(gap.events, (height, width), within).padded(right, below)
