"""Light carried along the motion between two frames (`vid2ev.upsample.flow`: DIS, forwards and backwards)."""

from __future__ import annotations

import torch

from interp.light import to_codes, to_light
from interp.methods.gap import Gap
from vid2ev import Frame
from vid2ev.upsample import make_upsampler

FINEST = 64  # steps that optical flow may be asked for between two frames
NS = 10**6  # length of such a step: any


def flow(gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """Times are taken to the nearest of the fewest even steps that hold all of them."""
    steps = next((n for n in range(1, FINEST) if ((times * n) - (times * n).round()).abs().max() < 1e-4), FINEST)
    first, last = (
        Frame(to_light(frame, "srgb").cpu().permute(1, 2, 0).contiguous().numpy(), steps * NS * number)
        for number, frame in enumerate((gap.frame_0, gap.frame_1))
    )
    made = [first, *make_upsampler("flow", steps).between(first, last), last]
    light = torch.stack([torch.from_numpy(made[int(n)].light) for n in (times * steps).round()])
    return to_codes(light.permute(0, 3, 1, 2), "srgb").to(gap.frame_0)
