"""What the cameras do not tell of each other, found from what both have seen between two key frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import torch

from interp.candidates.contrast import with_fitted_contrast
from interp.candidates.registered import registered
from interp.representation.carried import at_places, over
from interp.representation.event_counts import EventCounts


def calibrated(
    frames: Iterable[torch.Tensor],
    counts: EventCounts,
    contrast: tuple[float, float] | None,
    apart: bool,
    places: torch.Tensor | None = None,
) -> EventCounts:
    """Counts [1, 2, S, h, w] between two frames [C, H, W], ready for methods.

    contrast   what an OFF and an ON event stand for [nat]; fitted where nobody knows
    apart      whether the event camera stands elsewhere: then counts are found where pixels of the frames look
    places     there, as far as the cameras are calibrated: [H, W, 2] px (x, y) of the event camera
    """
    first, last = (frame[None] for frame in frames)
    if apart and places is not None:
        counts = at_places(counts, places.to(counts.contrast)[None])
    if contrast is not None:
        known = replace(counts, contrast=counts.contrast.new_tensor([contrast]))
        return registered(first, last, known) if apart else known
    size = first.shape[-2], first.shape[-1]
    found = with_fitted_contrast(first, last, over(counts.summed(), size))
    known = replace(counts, contrast=found.contrast)
    if not apart:
        return known
    brought = registered(first, last, known)
    return replace(brought, contrast=with_fitted_contrast(first, last, over(brought.summed(), size)).contrast)
