"""What motion is looked for in: small 8-bit pictures of light, and whether the motion found there and back agree."""

from __future__ import annotations

import cv2
import numpy as np

from vid2ev.stream.still import BRIGHTEST
from vid2ev.upsample.warp import miss

F = np.float32
FLOOR = 0.01  # light below which a proxy is linear rather than logarithmic
FULL_RANGE_NAT = float(np.log1p(1 / FLOOR))  # the least that 255 codes of a proxy span: black to white


def proxies(before: np.ndarray, after: np.ndarray, shrink: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Both images in 8 bits for matching, `shrink` times smaller and about logarithmic, and the nats of a code."""
    return codes(log_of(before, shrink), log_of(after, shrink))


def log_of(light: np.ndarray, shrink: int) -> np.ndarray:
    """Log light [nat], `shrink` times smaller; 0 is black."""
    height, width = light.shape
    size = (max(1, width // shrink), max(1, height // shrink))
    small = finite(cv2.resize(light, size, interpolation=cv2.INTER_AREA))
    return np.log1p(np.clip(small, 0, F(BRIGHTEST)) * F(1 / FLOOR))  # (more would not be finite)


def codes(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Two log images in 8 bits, and the nats that a code stands for."""
    nat_per_code = max(FULL_RANGE_NAT, float(before.max()), float(after.max())) / 255
    first, second = (cv2.convertScaleAbs(log, alpha=1 / nat_per_code) for log in (before, after))
    return first, second, nat_per_code


def agreement(flow: np.ndarray, back: np.ndarray) -> np.ndarray:
    """How well `back` undoes `flow` at each pixel: exp(-missed) of `warp.miss`, 0 ... 1 [h, w]."""
    missed = np.empty(flow.shape[:2], np.float32)
    miss(flow, back, missed)
    return cv2.exp(-missed)


def finite(light: np.ndarray) -> np.ndarray:
    """The light with NaN and infinity as 0, so that bad pixels spoil no others; the same array if there are none."""
    known = np.isfinite(light)
    return light if known.all() else np.where(known, light, F(0))
