"""What key frames say alone: both carried along the motion between them (`vid2ev.upsample`: DIS, forwards and back)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain

import numpy as np
import torch

from interp.light import Transfer, to_codes, to_light
from interp.precision import in_full_precision
from vid2ev import Frame
from vid2ev.upsample.flow import carried
from vid2ev.upsample.motion import MotionEstimator

GAP_NS = 1 << 40  # any, so long that times of 24 bits are whole


def between(
    frame_0: torch.Tensor, frame_1: torch.Tensor, times: torch.Tensor, transfer: Transfer = "srgb"
) -> Iterator[torch.Tensor]:
    """A frame [1, C, H, W] for each of times [N] in order, however they are spaced, from frames [C, H, W]; all are
    codes; at 0 and 1 the frames themselves."""
    first, last = (Frame(_light(frame, transfer), number * GAP_NS) for number, frame in enumerate((frame_0, frame_1)))
    for light in _carried(first, last, [round(time * GAP_NS) for time in times.tolist()]):
        channels = torch.from_numpy(light[None] if light.ndim == 2 else np.ascontiguousarray(np.moveaxis(light, -1, 0)))
        yield to_codes(channels[None], transfer).to(frame_0)


@in_full_precision
def alone(
    frame_0: torch.Tensor, frame_1: torch.Tensor, times: torch.Tensor, transfer: Transfer = "srgb"
) -> torch.Tensor:
    """Frames [B, N, C, H, W] at times [B, N], in any order, from frames [B, C, H, W]; of no gradients."""

    def of_pair(first: torch.Tensor, last: torch.Tensor, some: torch.Tensor) -> torch.Tensor:
        order = some.argsort()
        return torch.cat([*between(first, last, some[order], transfer)])[order.argsort()]

    with ThreadPoolExecutor(torch.get_num_threads()) as pool:
        return torch.stack([*pool.map(of_pair, frame_0.detach(), frame_1.detach(), times)])


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


def _light(frame: torch.Tensor, transfer: Transfer) -> np.ndarray:
    """Of codes [C, H, W], as a frame has it: [H, W, 3], or [H, W] of grey ones."""
    light = to_light(frame, transfer).cpu().numpy()
    return light[0] if len(light) == 1 else np.ascontiguousarray(np.moveaxis(light, 0, -1))
