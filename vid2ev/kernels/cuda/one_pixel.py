"""In the place of `vid2ev.kernels.widths`: blocks and lanes of one pixel."""

from __future__ import annotations

BLOCK_BITS, BLOCK, LANE_COUNT, PITCH, LANE_PITCH = 0, 1, 1, 1, 1
