"""Light carried along the motion between two frames (`vid2ev.upsample.flow`: DIS, forwards and backwards)."""

from __future__ import annotations

import torch

from interp.light import to_codes, to_light
from interp.methods.gap import Gap
from vid2ev import Frame
from vid2ev.upsample.flow import FlowUpsampling, carried

GAP_NS = 1 << 40  # any, so long that times of 24 bits are whole


def flow(gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """A frame for each time that lies between, however they are spaced; at 0 and 1 the key frames themselves."""
    first, last = (
        Frame(to_light(frame, "srgb").cpu().permute(1, 2, 0).contiguous().numpy(), number * GAP_NS)
        for number, frame in enumerate((gap.frame_0, gap.frame_1))
    )
    made = {0: first.light, GAP_NS: last.light}
    times_ns = [round(time * GAP_NS) for time in times.tolist()]
    if inner := sorted({t_ns for t_ns in times_ns if 0 < t_ns < GAP_NS}):
        motion = FlowUpsampling(len(inner) + 1).motion(first.luminance, last.luminance)
        made |= {frame.t_ns: frame.light for frame in carried(first, last, motion, inner)}
    light = torch.stack([torch.from_numpy(made[t_ns]) for t_ns in times_ns])
    return to_codes(light.permute(0, 3, 1, 2), "srgb").to(gap.frame_0)
