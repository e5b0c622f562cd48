"""Light carried along the motion between two frames (`vid2ev.upsample`: DIS, forwards and backwards)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np
import torch

from interp.light import to_codes, to_light
from interp.methods.gap import Gap
from interp.methods.tiling import Tiling
from vid2ev import Frame
from vid2ev.upsample.flow import carried
from vid2ev.upsample.motion import MotionEstimator

GAP_NS = 1 << 40  # any, so long that times of 24 bits are whole


def flow(gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
    """A frame for each time that lies between, however they are spaced; at 0 and 1 the key frames themselves."""
    first, last = (Frame(_light(frame), number * GAP_NS) for number, frame in enumerate((gap.frame_0, gap.frame_1)))
    for light in _carried(first, last, [round(time * GAP_NS) for time in times.tolist()]):
        channels = torch.from_numpy(light[None] if light.ndim == 2 else np.ascontiguousarray(np.moveaxis(light, -1, 0)))
        yield to_codes(channels[None], "srgb").to(gap.frame_0)


def _carried(first: Frame, last: Frame, times_ns: Sequence[int]) -> Iterator[np.ndarray]:
    """Light at times between two frames, in order; motion is estimated once."""
    frames = iter([first, last])
    if inner := sorted({t_ns for t_ns in times_ns if first.t_ns < t_ns < last.t_ns}):
        motion = MotionEstimator().between(first.luminance, last.luminance)
        frames = chain([first], carried(first, last, motion, inner))
    frame = next(frames)
    for t_ns in times_ns:
        while frame.t_ns < t_ns:
            frame = next(frames)
        yield frame.light


def _light(frame: torch.Tensor) -> np.ndarray:
    """Of codes [C, H, W], as a frame has it: [H, W, 3], or [H, W] of grey ones."""
    light = to_light(frame, "srgb").cpu().numpy()
    return light[0] if len(light) == 1 else np.ascontiguousarray(np.moveaxis(light, 0, -1))
