"""How many pixels the walk on a CPU works on at a time; a build for other machines has widths of its own."""

from __future__ import annotations

BLOCK_BITS = 11  # larger, and the scratch leaves the cache; smaller, and each block starts too many streams
BLOCK = 1 << BLOCK_BITS
LANE_COUNT = 1024
# Distances of planes: at a power of two apart they would fight for the same lines of the cache.
PITCH, LANE_PITCH = BLOCK + 16, LANE_COUNT + 16
