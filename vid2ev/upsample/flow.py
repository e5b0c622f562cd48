"""Light carried along the motion between two frames.

Motion is estimated once per interval (`upsample.motion`); frames in between are made of the float32 light of the two
frames, never of the 8-bit proxy that the motion is estimated on.  A pixel that is visible in one frame only, as the two
directions of motion do not agree there, counts little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import cv2
import numpy as np

from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still, strip_count
from vid2ev.stream.upload import Upload
from vid2ev.upsample import Interval, warp_tensors
from vid2ev.upsample.mended import mended, mended_tensor
from vid2ev.upsample.motion import SHRINK, Motion, MotionEstimator
from vid2ev.upsample.stillness import still_strips
from vid2ev.upsample.subframes import instants, steps_for
from vid2ev.upsample.warp import AFTER, BEFORE, carry, moving_of, settle, splat

F = np.float32
UNSURE = F(1e-3)  # weight of a pixel on which the flows do not agree, beside 1 for one on which they do
ENOUGH = F(0.05)  # sum of weights from which a frame counts as seeing a place
BLUR_PX, BLUR_TAPS = 1.0, 5  # of the sums of `splat`: closes the gaps between pixels thrown apart
REACH = 4  # px of the grid: what a pixel that moves changes around it, thrown, blurred and enlarged
AT_ONCE = 1 << 23  # pixels made at a time on a device, where each takes some 200 bytes of its memory


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
        self.subframes, self.max_subframes = subframes, max_subframes
        self._upload = upload
        self._estimator = MotionEstimator(threshold, always=subframes != "auto")

    def between(self, a: Frame, b: Frame) -> Interval:
        """The frames after a up to and including b."""
        if self.subframes == 1 or b.t_ns - a.t_ns <= 1:
            return Interval(iter([b]))
        if self.subframes == "auto" and np.array_equal(a.light, b.light):
            return Interval(iter([b]), shift_px=0.0)
        motion = self._estimator.between(a.luminance, b.luminance)
        asked = steps_for(motion.shift_px, (b.t_ns - a.t_ns) * 1e-9)
        steps = min(asked, self.max_subframes) if self.subframes == "auto" else self.subframes
        limited = self.subframes == "auto" and asked > self.max_subframes
        if steps == 1:
            return Interval(iter([b]), limited, motion.shift_px)
        times_ns = instants(a.t_ns, b.t_ns, steps)
        made = carried_there(a, b, motion, times_ns, self._upload) if self._upload else carried(a, b, motion, times_ns)
        return Interval(made, limited, motion.shift_px)


class Moving:
    """Velocity and weights of the pixels of frames [H, W] at instants between them; arrays serve for all instants.

    top, left, height, width   the part of the frames [px] in which anything moves; outside of it velocities are 0, and
                               each frame counts by its nearness in time
    """

    def __init__(self, motion: Motion, shape: tuple[int, int]):
        grid = motion.sure_before.shape
        field = np.zeros((grid[0] + 2, grid[1] + 2, 4), np.float32)
        self._before = moving_of(motion.forward, motion.sure_before, UNSURE, 2, field)
        self._after = moving_of(motion.backward, motion.sure_after, UNSURE, 3, field)
        (top, bottom), (left, right) = (self._reached(axis, grid[axis], shape[axis]) for axis in (0, 1))
        for moving in (self._before, self._after):
            moving[:, :2] -= left, top
        self._still = field[top : bottom + 2, left : right + 2].copy()
        self._sums, self._blurred = np.empty((2, *self._still.shape), np.float32)
        self._settled = np.empty((3, bottom - top, right - left), np.float32)
        down, across = shape[0] / grid[0], shape[1] / grid[1]  # px of the frames, of one of the grid
        self._px = F(across), F(down)
        self.top, self.left = SHRINK * top, SHRINK * left
        self.height, self.width = round((bottom - top) * down), round((right - left) * across)
        self._enlarged = np.empty((3, self.height, self.width), np.float32)

    def at(self, time: np.float32) -> np.ndarray:
        """[3, height, width] of `warp.settle`, px of the frames; until the next call."""
        field, settled = self._sums, self._settled
        if not settled.size:
            return self._enlarged
        field[...] = self._still
        splat(self._before, time, F(1), F(1) - time, 2, field)
        splat(self._after, F(1) - time, F(-1), time, 3, field)
        cv2.GaussianBlur(field, (BLUR_TAPS, BLUR_TAPS), BLUR_PX, dst=self._blurred)
        settle(self._blurred, time, ENOUGH, settled)
        for velocity, px in zip(settled, self._px, strict=False):
            velocity *= px
        for small, large in zip(settled, self._enlarged, strict=True):
            cv2.resize(small, (self.width, self.height), dst=large, interpolation=cv2.INTER_LINEAR)
        return self._enlarged

    def _reached(self, axis: int, cells: int, side: int) -> tuple[int, int]:
        """First and last of the rows (axis 0) or columns of the grid that anything which moves can change: all or
        none, where their edges are not edges of pixels of the frames."""
        moving = np.concatenate([self._before, self._after])
        starts = moving[:, 1 - axis] - 1
        places = np.clip([starts, starts + moving[:, 3 - axis]], 0, cells - 1)
        if not places.size:
            return 0, 0
        if side != SHRINK * cells:
            return 0, cells
        return max(0, math.floor(places.min()) - REACH), min(cells, math.ceil(places.max()) + REACH + 1)


def carried(a: Frame, b: Frame, motion: Motion, times_ns: Sequence[int]) -> Iterator[Frame]:
    """The frames at instants between a and b, in order, and b."""
    lights = [mended(frame.light) for frame in (a, b)]
    before, after = (list(map(with_margin, channels_of(light))) for light in lights)
    height, width = a.light.shape[:2]
    moving, last = Moving(motion, (height, width)), a.light
    was_still, is_light = (as_it_should_be(*each) for each in zip((a.light, b.light), lights, strict=True))
    for t_ns in times_ns:
        time = F((t_ns - a.t_ns) / (b.t_ns - a.t_ns))
        motion_there = moving.at(time)
        channels = np.empty((len(before), height, width), np.float32)
        still = np.empty((len(before), strip_count(width, height)), np.bool_)
        for k, pair in enumerate(zip(before, after, strict=True)):
            carry(*pair, motion_there, moving.top, moving.left, time, channels[k], still[k])
        light = channels[0] if a.light.ndim == 2 else np.moveaxis(channels, 0, -1).copy()
        is_still = np.logical_and.reduce(still)
        yield Frame(light, t_ns, original=False, still=Still(last, is_still & was_still))
        last, was_still = light, is_still
    yield b if last is a.light else replace(b, still=Still(last, was_still & is_light))


def carried_there(a: Frame, b: Frame, motion: Motion, times_ns: Sequence[int], upload: Upload) -> Iterator[Frame]:
    """`carried` on a device, some instants at a time: what goes there is the light of a and b, and the motion."""
    before, after = (warp_tensors.with_margin(mended_tensor(upload.light(frame.light))) for frame in (a, b))
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


def as_it_should_be(light: np.ndarray, mended_light: np.ndarray) -> np.ndarray:
    """The strips of a frame that may be said to be still: not those that were mended, which a sensor has to count."""
    height, width = light.shape[:2]
    return np.ones(strip_count(width, height), np.bool_) if light is mended_light else still_strips(light, light)


def channels_of(light: np.ndarray) -> list[np.ndarray]:
    """Luminance, or red, green and blue, each [H, W]."""
    return [light] if light.ndim == 2 else [np.ascontiguousarray(light[..., channel]) for channel in range(3)]


def with_margin(light: np.ndarray) -> np.ndarray:
    """The image with its border repeated outwards, as `warp.carry` wants it."""
    return cv2.copyMakeBorder(light, BEFORE, AFTER, BEFORE, AFTER, cv2.BORDER_REPLICATE)
