"""How good pictures are against true ones: PSNR and SSIM.

Both are those of `vid2ev.compare.pictures`, of each picture, in 8 bits of sRGB; then the mean over the pictures.

Views are compared with those of the reference.  Light between the frames is compared with frames that are left out: of
three frames in a row the middle one is made from the other two, which are twice as far apart as they are for a
recording, so the numbers are those of a harder task.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from vid2ev.compare.pictures import psnr, squared_error, ssim
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.sources import Source
from vid2ev.stream.frames import Frame
from vid2ev.upsample import make_upsampler
from vid2ev.upsample.cuts import CutDetector

TRIPLES = 12  # of frames, spread over the clip
SMALLEST = 11  # px: the window of SSIM


class Quality(NamedTuple):
    """Means over the pictures."""

    psnr_db: float
    ssim: float


def quality(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> Quality | None:
    """Of pictures [H, W, uint8] against true ones; None of none, or of pictures smaller than the window."""
    each = [
        (psnr(squared_error(made, true)), ssim(made, true)) for made, true in pairs if min(true.shape[:2]) >= SMALLEST
    ]
    return Quality(*(float(mean) for mean in np.mean(each, axis=0))) if each else None


def interpolated(triples: Iterable[tuple[Frame, Frame, Frame]], method: str, threshold: float) -> Quality | None:
    """How well an upsampler makes the middle one of three frames; "none" is light that goes straight."""
    upsampler = make_upsampler("linear" if method == "none" else method, subframes=2, threshold=threshold)
    pairs = []
    for before, middle, after in triples:
        made = next(iter(upsampler.between(before, after)))
        pairs.append((srgb_codes(made.luminance), srgb_codes(middle.luminance)))
    return quality(pairs)


def triples_of(source: Source, threshold: float) -> list[tuple[Frame, Frame, Frame]]:
    """Frames in a row, three at a time, spread over a source; none across a cut, and the second in the middle in
    time."""
    every = max(3, (source.frames_expected or 3 * TRIPLES) // TRIPLES)
    cuts, last = CutDetector(threshold), list[Frame]()
    kept: list[tuple[Frame, Frame, Frame]] = []
    for index, frame in enumerate(source.frames()):
        if last and cuts.begins_shot(last[-1], frame):
            last.clear()
        last = [*last, frame][-3:]
        if index % every == 2 and len(last) == 3 and len(kept) < TRIPLES and _even(last):
            kept.append((last[0], last[1], last[2]))
    return kept


def _even(frames: Sequence[Frame]) -> bool:
    one, other = frames[1].t_ns - frames[0].t_ns, frames[2].t_ns - frames[1].t_ns
    return abs(one - other) < 0.1 * (one + other)
