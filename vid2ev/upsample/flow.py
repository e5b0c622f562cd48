"""Light carried along the motion between two frames.

Motion is estimated by DIS optical flow, forwards and backwards, once per interval; frames in between are made of the
float32 light of the two frames, never of the 8-bit proxy that the flow is estimated on.  Where the two flows do not
lead back to where they started, a pixel is visible in one frame only, and counts little.

Settings of DIS: frames of half size, matched down to that size in 12 steps for patches every 6 px, and not smoothed
after; 5 ms of one core for 640x480, one way.  On panned photographs edges are 0.09 px off (median of 54 cases); patches
every 5 px, in 16 steps, take a third more, and change that by 0.002 px and six real clips of which every other frame
is rebuilt, three times, by -0.13 to +0.29 dB (0.01 on average); every 7 px, or in 8 steps, loses 0.1 dB.  Smoothing
takes 4 ms more, and changes the clips by -0.12 to +0.03 dB; the preset FAST, which matches down to a quarter of the
size, by -1.0 to +0.3 dB.

Sources: DIS, T. Kroeger et al., "Fast optical flow using dense inverse search", ECCV 2016; agreement of the flows,
N. Sundaram et al., "Dense point trajectories by GPU-accelerated large displacement optical flow", ECCV 2010, eq. 5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal, NamedTuple

import cv2
import numpy as np

from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still, strip_count
from vid2ev.stream.upload import Upload
from vid2ev.upsample import Interval, warp_tensors
from vid2ev.upsample.proxies import agreement, finite, proxies
from vid2ev.upsample.subframes import instants, steps_for
from vid2ev.upsample.warp import AFTER, BEFORE, carry, doubt, moving_of, settle, splat

F = np.float32
SHRINK = 2
SMALLEST = 12 * SHRINK  # px: DIS refuses less than 12
UNSURE = F(1e-3)  # weight of a pixel on which the flows do not agree, beside 1 for one on which they do
ENOUGH = F(0.05)  # sum of weights from which a frame counts as seeing a place
BLUR_PX, BLUR_TAPS = 1.0, 5  # of the sums of `splat`: closes the gaps between pixels thrown apart
AROUND = 9  # pixels whose change is averaged
FAST_PERCENTILE = 95.0
FEWEST = 16  # pixels that change; fewer are noise
AT_ONCE = 1 << 23  # pixels made at a time on a device, where each takes some 200 bytes of its memory


class Motion(NamedTuple):
    """Motion between two frames, on the grid of the shrunken frames."""

    forward: np.ndarray  # [h, w, 2] px of this grid, from the frame before to the frame after
    backward: np.ndarray  # the other way, at the places of the frame after
    sure_before: np.ndarray  # [h, w] 0 ... 1: whether backward leads back to where forward started
    sure_after: np.ndarray
    shift_px: float  # px of the frames: a high percentile of the speed of what changes visibly, 0 if nothing does
    explained: float  # 0 ... 1: of the pixels that change visibly, those of which shift_px is; 1 if nothing does


class FlowUpsampling:
    """Frames in between by optical flow; a still or unchanging pair of frames gets none.

    subframes      steps per interval, or "auto"
    max_subframes  the most that "auto" takes
    threshold      contrast threshold [nat]: motion is measured where log light changes by half of it or more
    upload         to the device on which light is carried; motion is estimated on the CPU all the same
    """

    def __init__(
        self,
        subframes: int | Literal["auto"] = "auto",
        max_subframes: int = 64,
        threshold: float = 0.15,
        upload: Upload | None = None,
    ):
        self.subframes, self.max_subframes, self.threshold = subframes, max_subframes, threshold
        self._upload = upload
        self._dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)  # type: ignore[attr-defined]
        self._dis.setFinestScale(0)
        self._dis.setPatchStride(6)
        self._dis.setGradientDescentIterations(12)
        self._dis.setVariationalRefinementIterations(0)

    def between(self, a: Frame, b: Frame) -> Interval:
        """The frames after a up to and including b."""
        if self.subframes == 1 or b.t_ns - a.t_ns <= 1:
            return Interval(iter([b]))
        if self.subframes == "auto" and np.array_equal(a.light, b.light):
            return Interval(iter([b]), shift_px=0.0)
        motion = self.motion(a.luminance, b.luminance)
        asked = steps_for(motion.shift_px, (b.t_ns - a.t_ns) * 1e-9)
        steps = min(asked, self.max_subframes) if self.subframes == "auto" else self.subframes
        limited = self.subframes == "auto" and asked > self.max_subframes
        if steps == 1:
            return Interval(iter([b]), limited, motion.shift_px)
        times_ns = instants(a.t_ns, b.t_ns, steps)
        made = carried_there(a, b, motion, times_ns, self._upload) if self._upload else carried(a, b, motion, times_ns)
        return Interval(made, limited, motion.shift_px)

    def motion(self, before: np.ndarray, after: np.ndarray) -> Motion:
        """Motion between two images of light [H, W]."""
        proxy_before, proxy_after, nat_per_code = proxies(before, after, SHRINK)
        changed = cv2.absdiff(proxy_before, proxy_after) * nat_per_code > self.threshold / 2
        unasked = self.subframes == "auto" and np.count_nonzero(changed) < FEWEST  # (one step, whatever the flow)
        if unasked or min(proxy_before.shape) * SHRINK < SMALLEST:
            return no_motion(proxy_before.shape)
        forward = self._dis.calc(proxy_before, proxy_after, None)
        backward = self._dis.calc(proxy_after, proxy_before, None)
        least_codes = self.threshold / 8 / nat_per_code
        forward = convincing(forward, proxy_before, proxy_after, least_codes)
        backward = convincing(backward, proxy_after, proxy_before, least_codes)
        sure_before, sure_after = agreement(forward, backward), agreement(backward, forward)
        seen = forward[changed & (sure_before > 0.5)]
        speeds = np.hypot(seen[:, 0], seen[:, 1])
        speeds = speeds[speeds > 0]
        changing = np.count_nonzero(changed)
        explained = speeds.size / changing if changing >= FEWEST else 1.0
        shift_px = SHRINK * float(np.percentile(speeds, FAST_PERCENTILE)) if speeds.size >= FEWEST else 0.0
        return Motion(forward, backward, sure_before, sure_after, shift_px, explained)


class Moving:
    """Velocity and weights for every pixel of frames [H, W] at instants between them; arrays serve for all instants."""

    def __init__(self, motion: Motion, shape: tuple[int, int]):
        (height, width), (self._rows, self._columns) = motion.sure_before.shape, shape
        self._still = np.zeros((height + 2, width + 2, 4), np.float32)
        self._sums, self._blurred = np.empty((2, *self._still.shape), np.float32)
        self._settled = np.empty((3, height, width), np.float32)
        self._enlarged = np.empty((3, *shape), np.float32)
        self._before = moving_of(motion.forward, motion.sure_before, UNSURE, 2, self._still)
        self._after = moving_of(motion.backward, motion.sure_after, UNSURE, 3, self._still)

    def at(self, time: np.float32) -> np.ndarray:
        """[3, H, W] of `warp.settle`, px of the frames; until the next call."""
        field, settled = self._sums, self._settled
        field[...] = self._still
        splat(self._before, time, F(1), F(1) - time, 2, field)
        splat(self._after, F(1) - time, F(-1), time, 3, field)
        cv2.GaussianBlur(field, (BLUR_TAPS, BLUR_TAPS), BLUR_PX, dst=self._blurred)
        settle(self._blurred, time, ENOUGH, settled)
        settled[0] *= F(self._columns / settled.shape[2])
        settled[1] *= F(self._rows / settled.shape[1])
        for small, large in zip(settled, self._enlarged, strict=True):
            cv2.resize(small, (self._columns, self._rows), dst=large, interpolation=cv2.INTER_LINEAR)
        return self._enlarged


def carried(a: Frame, b: Frame, motion: Motion, times_ns: Sequence[int]) -> Iterator[Frame]:
    """The frames at instants between a and b, in order, and b."""
    before, after = (list(map(with_margin, channels_of(frame.light))) for frame in (a, b))
    height, width = a.light.shape[:2]
    moving, last = Moving(motion, (height, width)), a.light
    was_still = np.ones(strip_count(width, height), np.bool_)
    for t_ns in times_ns:
        time = F((t_ns - a.t_ns) / (b.t_ns - a.t_ns))
        motion_there = moving.at(time)
        channels = np.empty((len(before), height, width), np.float32)
        still = np.empty((len(before), strip_count(width, height)), np.bool_)
        for k, pair in enumerate(zip(before, after, strict=True)):
            carry(*pair, motion_there, time, channels[k], still[k])
        light = channels[0] if a.light.ndim == 2 else np.moveaxis(channels, 0, -1).copy()
        is_still = np.logical_and.reduce(still)
        yield Frame(light, t_ns, original=False, still=Still(last, is_still & was_still))
        last, was_still = light, is_still
    yield b if last is a.light else replace(b, still=Still(last, was_still))


def carried_there(a: Frame, b: Frame, motion: Motion, times_ns: Sequence[int], upload: Upload) -> Iterator[Frame]:
    """`carried` on a device, some instants at a time: what goes there is the light of a and b, and the motion."""
    before, after = (warp_tensors.with_margin(upload.light(frame.light)) for frame in (a, b))
    forward, backward, sure_before, sure_after = map(upload.tensor, motion[:4])
    (height, width), (rows, columns) = a.light.shape[:2], motion.sure_before.shape
    some = max(1, AT_ONCE // (height * width))
    for first in range(0, len(times_ns), some):
        shares = [(t_ns - a.t_ns) / (b.t_ns - a.t_ns) for t_ns in times_ns[first : first + some]]
        time = upload.tensor(np.array(shares, np.float32))[:, None, None]
        thrown = warp_tensors.splat(forward, sure_before, float(UNSURE), time, 1.0, 1 - time)
        other = warp_tensors.splat(backward, sure_after, float(UNSURE), 1 - time, -1.0, time)
        x, y, share = warp_tensors.settle(thrown, other, BLUR_TAPS, BLUR_PX, time, float(ENOUGH))
        moving = x * (width / columns), y * (height / rows), share
        x, y, share = (warp_tensors.enlarged(plane, (width, height)) for plane in moving)
        light = warp_tensors.carry(before, after, (x, y, share), time)
        for t_ns, frame in zip(times_ns[first : first + some], light, strict=True):
            yield Frame(frame[..., 0] if a.light.ndim == 2 else frame, t_ns, original=False)
    yield upload.frame(b)


def channels_of(light: np.ndarray) -> list[np.ndarray]:
    """Luminance, or red, green and blue, each [H, W]."""
    return [light] if light.ndim == 2 else [np.ascontiguousarray(light[..., channel]) for channel in range(3)]


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
    there = _places(*picture.shape) + flow
    return cv2.remap(  # (None: columns and rows are in one array)
        picture,
        there,
        None,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,  # type: ignore[call-overload]
    )


@lru_cache(maxsize=2)
def _places(height: int, width: int) -> np.ndarray:
    """Column and row of every pixel, [height, width, 2]."""
    rows, columns = np.indices((height, width), np.float32)
    return np.stack([columns, rows], -1)


def no_motion(shape: tuple[int, ...]) -> Motion:
    """Nothing moves: frames in between are cross-fades."""
    still, sure = np.zeros((*shape, 2), np.float32), np.ones(shape, np.float32)
    return Motion(still, still, sure, sure, 0.0, 1.0)


def with_margin(light: np.ndarray) -> np.ndarray:
    """The image with its border repeated outwards, as `warp.carry` wants it."""
    return cv2.copyMakeBorder(finite(light), BEFORE, AFTER, BEFORE, AFTER, cv2.BORDER_REPLICATE)
