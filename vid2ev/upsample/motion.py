"""Motion between two frames: DIS optical flow, forwards and backwards, where it explains what changes.

It is estimated on 8-bit pictures of half the size, in the part of them in which enough changes to tell that anything
moves.  Where the two flows do not lead back to where they started, a pixel is visible in one frame only.

Settings of DIS: matched down to that half in 12 steps for patches every 6 px, and not smoothed after; 5 ms of one core
for 640x480, one way, and less where parts stand still.  On panned photographs edges are 0.09 px off (median of 54
cases); patches every 5 px, in 16 steps, take a third more, and change that by 0.002 px and six real clips of which
every other frame is rebuilt, three times, by -0.13 to +0.29 dB (0.01 on average); every 7 px, or in 8 steps, loses
0.1 dB.  Smoothing takes 4 ms more, and changes the clips by -0.12 to +0.03 dB; the preset FAST, which matches down to
a quarter of the size, by -1.0 to +0.3 dB.  Looking at whole pictures takes up to a third more, and changes seven clips,
two times, by -0.46 to +0.08 dB (-0.03 on average).

Sources: DIS, T. Kroeger et al., "Fast optical flow using dense inverse search", ECCV 2016; agreement of the flows,
N. Sundaram et al., "Dense point trajectories by GPU-accelerated large displacement optical flow", ECCV 2010, eq. 5.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from vid2ev.upsample.proxies import agreement, proxies
from vid2ev.upsample.warp import doubt

F = np.float32
SHRINK = 2
PATCH = 8  # px of the shrunken frames: of DIS
SMALLEST = 12  # px of the shrunken frames: DIS refuses less
AROUND = 9  # pixels whose change is averaged
FAST_PERCENTILE = 95.0
FEWEST = 16  # pixels that change; fewer are noise
ROOM = 256  # px: places are kept for pictures of whole rooms, as parts of pictures have any size

Part = tuple[slice, slice]  # rows and columns


class Motion(NamedTuple):
    """Motion between two frames, on the grid of the shrunken frames."""

    forward: np.ndarray  # [h, w, 2] px of this grid, from the frame before to the frame after
    backward: np.ndarray  # the other way, at the places of the frame after
    sure_before: np.ndarray  # [h, w] 0 ... 1: whether backward leads back to where forward started
    sure_after: np.ndarray
    shift_px: float  # px of the frames: a high percentile of the speed of what changes visibly, 0 if nothing does
    explained: float  # 0 ... 1: of the pixels that change visibly, those of which shift_px is; 1 if nothing does


class MotionEstimator:
    """Estimates motion between images.

    threshold  contrast threshold [nat]: motion is measured where log light changes by half of it or more
    always     look for it even where too few pixels change that much for a `shift_px`
    """

    def __init__(self, threshold: float = 0.15, always: bool = True):
        self._threshold, self._always = threshold, always
        self._dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)  # type: ignore[attr-defined]
        self._dis.setFinestScale(0)
        self._dis.setPatchSize(PATCH)
        self._dis.setPatchStride(6)
        self._dis.setGradientDescentIterations(12)
        self._dis.setVariationalRefinementIterations(0)

    def between(self, before: np.ndarray, after: np.ndarray) -> Motion:
        """Motion between two images of light [H, W]."""
        proxy_before, proxy_after, nat_per_code = proxies(before, after, SHRINK)
        difference = cv2.absdiff(proxy_before, proxy_after)
        changed = difference * nat_per_code > self._threshold / 2
        changing, least_codes = np.count_nonzero(changed), self._threshold / 8 / nat_per_code
        part = changing_part(difference, least_codes) if self._always or changing >= FEWEST else None
        still = no_motion(difference.shape)
        if part is None or min(difference.shape) < SMALLEST:
            return still
        flows = self._flows(proxy_before[part].copy(), proxy_after[part].copy(), least_codes)
        forward, backward, sure_before, sure_after = still[:4]
        forward[part], backward[part] = flows
        sure_before[part], sure_after[part] = agreement(*flows), agreement(*reversed(flows))
        seen = forward[changed & (sure_before > 0.5)]
        speeds = np.hypot(seen[:, 0], seen[:, 1])
        speeds = speeds[speeds > 0]
        explained = speeds.size / changing if changing >= FEWEST else 1.0
        shift_px = SHRINK * float(np.percentile(speeds, FAST_PERCENTILE)) if speeds.size >= FEWEST else 0.0
        return Motion(forward, backward, sure_before, sure_after, shift_px, explained)

    def _flows(self, before: np.ndarray, after: np.ndarray, least_codes: float) -> tuple[np.ndarray, np.ndarray]:
        """Forwards and backwards between two 8-bit pictures, where they are convincing."""
        forward, backward = self._dis.calc(before, after, None), self._dis.calc(after, before, None)
        return convincing(forward, before, after, least_codes), convincing(backward, after, before, least_codes)


def no_motion(shape: tuple[int, ...]) -> Motion:
    """Nothing moves: frames in between are cross-fades."""
    (forward, backward), (sure_before, sure_after) = np.zeros((2, *shape, 2), F), np.ones((2, *shape), F)
    return Motion(forward, backward, sure_before, sure_after, 0.0, 1.0)


def changing_part(difference: np.ndarray, least_codes: float) -> Part | None:
    """The part of a picture [h, w] outside of which no flow is `convincing`, by what its 8-bit pictures differ; None if
    that is all of it.

    It has a patch around it, and is large enough for DIS to begin with pictures as small as those of the whole: else
    what is small and fast would be lost.
    """
    enough = cv2.boxFilter(difference, cv2.CV_32F, (AROUND, AROUND)) > least_codes
    left, top, width, height = cv2.boundingRect(enough.view(np.uint8))
    if not width:
        return None
    rows, columns = difference.shape
    # (OpenCV halves a picture while its longer side has 4 and its shorter side 1 patch, about)
    longest, shortest = max(rows, columns), min(rows, columns)
    halvings = max(0, min(math.floor(math.log2(longest / PATCH) - 1.5), (shortest // PATCH).bit_length() - 1))
    longer, shorter = math.ceil(2**1.5 * PATCH * 2**halvings), PATCH << halvings
    least = (longer, shorter) if rows > columns else (shorter, longer)
    return _stretch(top, height, rows, least[0]), _stretch(left, width, columns, least[1])


def _stretch(first: int, count: int, whole: int, least: int) -> slice:
    """So many of `whole` places, from the first on, with a patch at both ends, and as many more as are the least."""
    more = max(PATCH, (least - count + 1) // 2)
    start, stop = first - more, first + count + more
    return slice(max(0, start - max(0, stop - whole)), min(whole, stop + max(0, -start)))


def convincing(flow: np.ndarray, start: np.ndarray, end: np.ndarray, least_codes: float) -> np.ndarray:
    """The flow where it explains the change from start to end better than standing still does, elsewhere 0: the very
    array.

    Better by at least least_codes, on average around a pixel: in smooth places any flow explains the noise as well as
    any other, and what DIS returns there wanders by many pixels.
    """
    gain = cv2.subtract(cv2.absdiff(start, end), cv2.absdiff(start, carried_along(end, flow)), dtype=cv2.CV_32F)
    doubt(flow, cv2.blur(gain, (AROUND, AROUND)), F(least_codes))
    return flow


def carried_along(picture: np.ndarray, flow: np.ndarray) -> np.ndarray:
    """A picture [H, W] of 8 bits at where a flow [H, W, 2] px leads."""
    height, width = picture.shape
    there = _places(-(-height // ROOM), -(-width // ROOM))[:height, :width] + flow
    return cv2.remap(  # (None: columns and rows are in one array)
        picture,
        there,
        None,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,  # type: ignore[call-overload]
    )


@lru_cache(maxsize=2)
def _places(down: int, across: int) -> np.ndarray:
    """Column and row of every pixel, [down rooms, across rooms, 2]."""
    rows, columns = np.indices((down * ROOM, across * ROOM), np.float32)
    return np.stack([columns, rows], -1)
