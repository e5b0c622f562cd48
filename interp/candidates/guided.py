"""Guided by light: both key frames carried to where the luminance is that events and key frames give.

Events tell luminance at any instant nearly to the noise of the sensor, but no colours, and fine texture no better than
to a threshold.  Key frames have both, at other places.  So the motion from an instant to either key frame is estimated
on the luminance of the ramps (`ramps.py`), which is there already, not between key frames that are far apart in time:

    F_tk = DIS(luminance of the ramps at t -> luminance of frame k)            nearby, whatever the motion in between
    J    = sum_k w_k g(I_k, F_tk)      w_k ~ s_k exp(-a e_k), s = (1 - t, t), e_k how far luminance is off there
    C    = luminance of the ramps in the colours of J
    I    = C + m (J - C)               m = exp(-a min_k e_k) / 2

J is free of the noise of events, C right where nothing in the key frames is, and I is nearer than either: half of each
where J agrees.  Motion counts where it explains light
better than standing still does (`vid2ev.upsample.flow.convincing`), so what stands still stays as it is.

Measured, PSNR and SSIM over those of the bridge, x8: 16 scenes +2.3 dB and +0.029 with a clean sensor, +2.2 dB and
+0.039 with a noisy one; 28 parts of seven real videos +1.5 dB and +0.008, +6.3 dB and +0.10.  With m = 1/2 everywhere
it was below the bridge on what is fast in a real video (36.8 for 37.3 dB; now 37.9).

DIS runs on the CPU, and has no gradients.

Source: DIS, T. Kroeger et al., "Fast optical flow using dense inverse search", ECCV 2016.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from torch.nn import functional as F

from interp.blend import blend
from interp.candidates.bridge import coloured, ratios_of
from interp.light import Transfer, luminance, to_codes, to_light
from interp.precision import in_full_precision
from interp.warp import warp
from vid2ev.upsample.flow import convincing

SMALLEST = 16  # px: DIS refuses less than 12
CONVINCED_CODES = 0.5  # by how much motion must be better than none
SHARP = 40.0  # a: weights fall to 1/e where luminance (codes 0 ... 1) is off by a fortieth
AROUND_PX = 5  # mean of errors over so many pixels


@dataclass(frozen=True, slots=True)
class Guided:
    """Both key frames at N instants.

    flows    [B, N, 4, H, W] px: from the target to the first frame (x, y), to the second
    warps    [B, N, 2, C, H, W]: the frames, carried
    logits   [B, N, 2, H, W]: -a e, how well each agrees with the luminance that was given
    """

    flows: torch.Tensor
    warps: torch.Tensor
    logits: torch.Tensor

    def blend(self, times: torch.Tensor) -> torch.Tensor:
        """J at times [B, N]."""
        return blend(self.warps, self.logits, torch.stack([1 - times, times], -1))[0]

    def image(self, pictures: torch.Tensor, times: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
        """I at times [B, N], of the pictures that it was guided by."""
        carried = self.blend(times)
        start = recoloured(pictures, carried, transfer)
        return start + half_way(self.logits) * (carried - start)


@in_full_precision
def guided(frame_0: torch.Tensor, frame_1: torch.Tensor, pictures: torch.Tensor, transfer: Transfer = "srgb") -> Guided:
    """Frames [B, C, H, W] carried to where the luminance of pictures [B, N, C, H, W] is; all are codes."""
    flows = flows_to(frame_0, frame_1, pictures, transfer)
    warps = torch.stack([warp(frame_0, flows[:, :, :2]), warp(frame_1, flows[:, :, 2:])], 2)
    return Guided(flows, warps, agreement(warps, pictures, transfer))


@in_full_precision
def flows_to(
    frame_0: torch.Tensor, frame_1: torch.Tensor, pictures: torch.Tensor, transfer: Transfer = "srgb"
) -> torch.Tensor:
    """Motion [B, N, 4, H, W] px from the luminance of pictures to both frames; as `guided`."""
    shown = _shown(pictures, transfer)
    keys = [_shown(frame[:, None], transfer) for frame in (frame_0, frame_1)]
    return torch.cat([_flows(shown, key) for key in keys], 2)


@in_full_precision
def agreement(warps: torch.Tensor, pictures: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """Logits [B, N, K, H, W] of warps [B, N, K, C, H, W] by how far their luminance is from that of pictures."""
    error = (_shown(warps, transfer) - _shown(pictures, transfer)[:, :, None]).abs().squeeze(3)
    mean = F.avg_pool2d(error.flatten(0, 1), AROUND_PX, 1, AROUND_PX // 2, count_include_pad=False)
    return -SHARP * mean.unflatten(0, error.shape[:2])


def half_way(logits: torch.Tensor) -> torch.Tensor:
    """m [B, N, 1, H, W] of logits [B, N, K, H, W]."""
    return 0.5 * torch.exp(logits.amax(2, keepdim=True))


@in_full_precision
def recoloured(pictures: torch.Tensor, around: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """The luminance of pictures in the colours of others, all codes [..., C, H, W]."""
    light = luminance(to_light(pictures, transfer))
    return to_codes(coloured(light, ratios_of(to_light(around, transfer))), transfer)


def _shown(pictures: torch.Tensor, transfer: Transfer) -> torch.Tensor:
    """Luminance as codes [..., 1, H, W], about as differences are seen."""
    return to_codes(luminance(to_light(pictures, transfer)), "srgb")


def _flows(shown: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
    """Motion [B, N, 2, H, W] from pictures [B, N, 1, H, W] to one of each batch, [B, 1, 1, H, W]; none in tiny ones."""
    if min(shown.shape[-2:]) < SMALLEST:
        return shown.new_zeros(*shown.shape[:2], 2, *shown.shape[-2:])
    starts, ends = (_eight_bits(each) for each in (shown.detach(), key.detach()))
    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)  # type: ignore[attr-defined]
    found = [
        [convincing(dis.calc(start, end[0], None), start, end[0], CONVINCED_CODES) for start in some]
        for some, end in zip(starts, ends, strict=True)
    ]
    return torch.from_numpy(np.moveaxis(np.array(found), -1, 2).copy()).to(shown)


def _eight_bits(shown: torch.Tensor) -> np.ndarray:
    codes = (torch.nan_to_num(shown).clamp(0, 1) * 255).round()
    return codes.squeeze(2).to(torch.uint8).cpu().numpy()
