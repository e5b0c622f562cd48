"""Cuts: two frames that follow each other and show different things.

Between them nothing moved, and nothing is to be interpolated.  A pair of frames is unrelated if a third of the picture
changes by half a threshold or more, both have structure, and where they differ neither their structure correlates nor
optical flow leads there and back again: it does on less than 0.05 of unrelated pictures, on 0.1 to 0.25 across a jump
cut in one room, and on 0.46 and more in the fastest motion of eight real clips.  Changes of light do not count: their
structure stays, and a bare wall or a black picture has none.

A cut is an unrelated pair after a related one.  Where every frame is unrelated to the next (noise, a strobe), there are
no shots, and no cuts between them.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np

from vid2ev.stream.frames import Frame
from vid2ev.upsample.proxies import agreement, codes, log_of

WIDEST = 256  # px: frames are reduced to about this; what is far apart in them is near
CHANGED = 0.35  # share of the picture; what changes less may be anything
UNRELATED, RELATED = 0.25, 0.4  # likeness
STRUCTURE_NAT = 0.05  # standard deviation of places about their surroundings; less is noise
PLACE, AROUND = 5, 21  # px: a place, and its surroundings
TINY = 1e-9  # in place of nothing changed
LEAST = 24  # px: smaller pictures have too little structure to be told apart
HALVED_TWICE = 32, 91  # px of both sides, from which on DIS halves a picture twice


class CutDetector:
    """Tells for each frame whether it begins a new shot.

    threshold  contrast threshold of the sensor [nat]
    """

    def __init__(self, threshold: float):
        self.threshold = threshold
        self.unrelated = False  # whether the last pair was
        self._related = 0.0  # likeness of the last pair; before the first one there is no shot to end
        self._dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)  # type: ignore[attr-defined]
        self._seen: tuple[Frame, np.ndarray] | None = None  # the last frame, and its log image

    def begins_shot(self, a: Frame, b: Frame) -> bool:
        """Whether there is a cut between a and b; to be asked for each pair of frames, in order."""
        before = self._seen[1] if self._seen and self._seen[0] is a else reduced(a.luminance)
        after = reduced(b.luminance)
        was_related, related = self._related, likeness(before, after, self.threshold, self._dis)
        self._seen, self._related, self.unrelated = (b, after), related, related < UNRELATED
        return self.unrelated and was_related > RELATED


def likeness(before: np.ndarray, after: np.ndarray, threshold: float, dis: Any) -> float:
    """How far two log images show the same where they differ, 0 ... 1: by the share of it on which flow there and back
    agree, or by the correlation of their structure; 1 where they hardly differ, or one of them has none."""
    if min(before.shape) < LEAST or np.mean(np.abs(after - before) > threshold / 2) <= CHANGED:
        return 1.0
    details = [cv2.blur(log, (PLACE, PLACE)) - cv2.blur(log, (AROUND, AROUND)) for log in (before, after)]
    if min(float(detail.std()) for detail in details) < STRUCTURE_NAT:
        return 1.0
    first, second, nat_per_code = codes(before, after)
    # (of smaller ones, too, it is told where to end: else it goes by the width alone, reads beyond those that are low,
    # and stays with that for the next pair)
    short, long = sorted(first.shape)
    dis.setFinestScale(2 if short >= HALVED_TWICE[0] and long >= HALVED_TWICE[1] else 0)
    changed = cv2.absdiff(first, second) * nat_per_code > threshold / 2
    agreed = agreement(dis.calc(first, second, None), dis.calc(second, first, None))
    one, other = (detail[changed] for detail in details)
    correlation = float(one @ other) / math.sqrt(float(one @ one) * float(other @ other) + TINY)
    return max(float(agreed[changed].mean()), correlation)


def reduced(light: np.ndarray) -> np.ndarray:
    """Log light [nat] of a picture, reduced to about `WIDEST`; of large ones, every second pixel or so is enough."""
    step = max(1, max(light.shape) // (2 * WIDEST))
    return log_of(np.ascontiguousarray(light[::step, ::step]), max(1, max(light.shape) // (step * WIDEST)))
