"""What needs no training, on the same clips: nearest frame, linear blend, optical flow, and two ways with events alone.

nearest       the nearer key frame
linear        a blend of the codes of both
flow          light carried along the motion between both (`vid2ev.upsample.flow`: DIS)
integration   events integrated from the nearer key frame (`candidates/bridge.py`, nearest)
bridge        events integrated from both: the one to beat
"""

from __future__ import annotations

import torch

from interp.candidates.bridge import bridge
from interp.light import to_codes, to_light
from interp.representation.event_counts import EventCounts
from vid2ev import Frame
from vid2ev.upsample import make_upsampler

METHODS = ("nearest", "linear", "flow", "integration", "bridge")
FINEST = 64  # steps that optical flow may be asked for between two frames
NS = 10**6  # length of such a step: any


def baseline(
    method: str, frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts, times: torch.Tensor
) -> torch.Tensor:
    """Images [N, C, H, W] of one pair of frames [C, H, W] at times [N], by a method of `METHODS`; codes 0 ... 1."""
    t = times[:, None, None, None]
    if method == "nearest":
        return torch.where(t > 0.5, frame_1, frame_0)
    if method == "linear":
        return frame_0 + t * (frame_1 - frame_0)
    if method == "flow":
        return flow(frame_0, frame_1, times)
    way = "nearest" if method == "integration" else "bridge"
    return bridge(frame_0[None], frame_1[None], events, times[None], method=way)[0]  # type: ignore[arg-type]


def flow(frame_0: torch.Tensor, frame_1: torch.Tensor, times: torch.Tensor) -> torch.Tensor:
    """Light carried along the motion; times are taken to the nearest of the fewest even steps that hold all of them."""
    steps = next((n for n in range(1, FINEST) if ((times * n) - (times * n).round()).abs().max() < 1e-4), FINEST)
    first, last = (
        Frame(to_light(frame, "srgb").cpu().permute(1, 2, 0).contiguous().numpy(), steps * NS * number)
        for number, frame in enumerate((frame_0, frame_1))
    )
    made = [first, *make_upsampler("flow", steps).between(first, last)]
    light = torch.stack([torch.from_numpy(made[int(n)].light) for n in (times * steps).round()])
    return to_codes(light.permute(0, 3, 1, 2), "srgb").to(frame_0)
