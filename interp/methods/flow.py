"""Light carried along the motion between two frames (`vid2ev.upsample`: DIS, forwards and backwards)."""

from __future__ import annotations

import numpy as np
import torch

from interp.light import to_codes, to_light
from interp.methods.gap import Gap
from interp.methods.tiling import Tiling
from vid2ev import Frame
from vid2ev.upsample.flow import carried
from vid2ev.upsample.motion import MotionEstimator

GAP_NS = 1 << 40  # any, so long that times of 24 bits are whole


def flow(gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> torch.Tensor:
    """A frame for each time that lies between, however they are spaced; at 0 and 1 the key frames themselves."""
    first, last = (Frame(_light(frame), number * GAP_NS) for number, frame in enumerate((gap.frame_0, gap.frame_1)))
    made = {0: first.light, GAP_NS: last.light}
    times_ns = [round(time * GAP_NS) for time in times.tolist()]
    if inner := sorted({t_ns for t_ns in times_ns if 0 < t_ns < GAP_NS}):
        motion = MotionEstimator().between(first.luminance, last.luminance)
        made |= {frame.t_ns: frame.light for frame in carried(first, last, motion, inner)}
    light = torch.stack([torch.from_numpy(made[t_ns]) for t_ns in times_ns])
    channels = light[:, None] if light.ndim == 3 else light.permute(0, 3, 1, 2)
    return to_codes(channels, "srgb").to(gap.frame_0)


def _light(frame: torch.Tensor) -> np.ndarray:
    """Of codes [C, H, W], as a frame has it: [H, W, 3], or [H, W] of grey ones."""
    light = to_light(frame, "srgb").cpu().numpy()
    return light[0] if len(light) == 1 else np.ascontiguousarray(np.moveaxis(light, 0, -1))
