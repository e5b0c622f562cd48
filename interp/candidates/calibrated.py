"""What the cameras do not tell of each other, found from what both have seen between two key frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import torch

from interp.candidates.contrast import with_fitted_contrast
from interp.candidates.registered import registered
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts


def calibrated(
    frames: Iterable[torch.Tensor], counts: EventCounts, contrast: tuple[float, float] | None, apart: bool
) -> EventCounts:
    """Counts [1, 2, S, h, w] between two frames [C, H, W], ready for methods.

    contrast   what an OFF and an ON event stand for [nat]; fitted where nobody knows
    apart      whether the event camera stands elsewhere: then counts are brought to the pixels of the frames
    """
    first, last = (frame[None] for frame in frames)
    if contrast is not None:
        known = replace(counts, contrast=counts.contrast.new_tensor([contrast]))
        return registered(first, last, known) if apart else known
    found = with_fitted_contrast(first, last, over(counts, (first.shape[-2], first.shape[-1])))
    known = replace(counts, contrast=found.contrast)
    return with_fitted_contrast(first, last, registered(first, last, known)) if apart else known
