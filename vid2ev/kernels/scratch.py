"""Scratch of a block: planes of what a scan finds, before it becomes the state."""

from __future__ import annotations

from vid2ev.kernels.layout import PITCH

# The new light, input of the filter and lags; the clock of the first pole
# (dt/tau1); the noise before and after, the comparator's input without it; what the lags before and after have beyond
# their float32 (`refine`).
LIGHT, NEW, NEW1, NEW2, CLOCK, NOISE0, NOISE1, SEEN, OLD_REST1, OLD_REST2, REST1, REST2 = (k * PITCH for k in range(12))
REFINED = 12 * PITCH  # more than 0 where one of the last four is not
SCRATCH = 12 * PITCH + 1
