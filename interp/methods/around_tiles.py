"""What the tiles of a network must know of the whole frames: see `interp.networks.around`.

The light that motion to targets is sought by is made tile by tile, pixel by pixel as it is; the motion then of all.
Frames are continued as the network continues them, so that tiles and whole have the same borders.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from interp.candidates.alone import alone
from interp.candidates.bridge import highest_of
from interp.candidates.guided import flows_to
from interp.methods.gap import Gap
from interp.methods.tiling import Tiling, part
from interp.networks.around import Around
from interp.networks.frame_fed import FrameFed, sought
from interp.networks.guide import light_at


def around_tiles(network: FrameFed, gap: Gap, times: torch.Tensor, tiling: Tiling) -> Around:
    """What tiles of a gap need for their images at times [N]."""
    whole = network.padded(gap.frame_0[None], gap.frame_1[None])
    highest = highest_of(whole.frame_0, whole.frame_1, network.transfer)
    around = Around(whole.frame_0, whole.frame_1, highest, coloured=whole.coloured)
    if network.spec.guided:
        light = _light(network, gap, times, tiling, around)
        frames = whole.frame_0, whole.frame_1
        around = replace(
            around,
            to_targets=flows_to(*frames, light, network.transfer),
            alone=alone(*frames, times[None], network.transfer),
        )
    return replace(around, between=sought(whole, network.transfer) if network.seeks_motion else None)


def _light(network: FrameFed, gap: Gap, times: torch.Tensor, tiling: Tiling, around: Around) -> torch.Tensor:
    """C [1, N, C, H, W] of the frames, continued."""
    light = around.frame_0.new_empty(1, len(times), *around.frame_0.shape[1:])
    for tile in tiling:
        seen = part(gap, tile)
        pair = replace(network.padded(seen.frame_0[None], seen.frame_1[None], seen.events), around=around)
        height, width = pair.frame_0.shape[-2:]
        made = light_at(pair, times[None], network.transfer)
        light[..., tile.top : tile.top + height, tile.left : tile.left + width] = made
    return light
