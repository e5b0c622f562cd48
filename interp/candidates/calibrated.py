"""What the cameras do not tell of each other, found from what both have seen between two key frames."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import torch

from interp.candidates.contrast import with_fitted_contrast
from interp.candidates.registered import registered, unexplained
from interp.representation.carried import Look, at_places, over
from interp.representation.event_counts import EventCounts


def calibrated(
    frames: Iterable[torch.Tensor],
    counts: EventCounts,
    contrast: tuple[float, float] | None,
    apart: bool,
    looks: Sequence[Look] = (),
) -> EventCounts:
    """Counts [1, 2, S, h, w] between two frames [C, H, W], ready for methods.

    contrast   what an OFF and an ON event stand for [nat]; fitted where nobody knows
    apart      whether the event camera stands elsewhere: then counts are found where pixels of the frames look
    looks      where that may be, as calibration says: what explains the frames best is taken; none: edge on edge
    """
    first, last = (frame[None] for frame in frames)
    if not apart:
        return _with_contrast(first, last, counts, contrast)
    starts = [(counts, False)] * (not looks)
    starts += [(at_places(counts, look.where.to(counts.contrast)[None]), look.exact) for look in looks]
    found = [_brought(first, last, start, contrast, exact) for start, exact in starts]
    return found[0] if len(found) == 1 else min(found, key=lambda each: unexplained(first, last, each))


def _brought(
    first: torch.Tensor, last: torch.Tensor, counts: EventCounts, contrast: tuple[float, float] | None, exact: bool
) -> EventCounts:
    """Counts whose places are those where the frames have seen the same change, unless they are exact already."""
    known = _with_contrast(first, last, counts, contrast)
    return known if exact else _with_contrast(first, last, registered(first, last, known), contrast)


def _with_contrast(
    first: torch.Tensor, last: torch.Tensor, counts: EventCounts, contrast: tuple[float, float] | None
) -> EventCounts:
    """Counts with thresholds that are known, or else fitted to the frames."""
    if contrast is not None:
        return replace(counts, contrast=counts.contrast.new_tensor([contrast]))
    laid = over(counts.summed(), (first.shape[-2], first.shape[-1]))
    return replace(counts, contrast=with_fitted_contrast(first, last, laid).contrast)
