"""Guided by light: both key frames carried to where the luminance is that events and key frames give.

Events tell luminance at any instant nearly to the noise of the sensor, but no colours, and fine texture no better than
to a threshold.  Key frames have both, at other places.  So the motion from an instant to either key frame is estimated
on the luminance of the ramps (`ramps.py`), which is there already, not between key frames that are far apart in time:

    F_tk = DIS(luminance of the ramps at t -> luminance of frame k)            nearby, whatever the motion in between
    J    = sum_k w_k g(I_k, F_tk)      w_k ~ s_k exp(-a e_k), s = (1 - t, t), e_k how far luminance is off there
    C    = luminance of the ramps in the colours of J
    I    = C + m (J - C)               m = 4/5 exp(-a min_k e_k)

J is free of the noise of events, C right where nothing in the key frames is, and I is nearer than either: mostly J
where J agrees. Motion counts where it explains light better than standing still does
(`vid2ev.upsample.flow.convincing`), so what stands still stays as it is.

Where a pixel of the event camera looks at k x k pixels of the frames, C has luminance averaged over them and nothing
finer. So F and e are of luminance averaged alike, a is a / sqrt(k), for C is rougher, and in m 1/5 is 1 / (5 k^2), and
light carried from key frame to key frame is a third picture in J, of share 1/2; twice over, I in place of C. That is a
compromise. With k = 3, near things that move slowly: 34.5, 33.2 and 38.0 dB in three scenes, for 30.6, 29.2 and 32.8
without all this, and 34.6, 34.3 and 39.2 of optical flow alone. With k = 2, where flow is at 27 dB: 33.9 for 34.5, of
SSIM 0.968 for 0.962.

Measured, PSNR and SSIM over those of the bridge, x8: 16 scenes +2.9 dB and +0.035 with a clean sensor, +2.6 dB and
+0.046 with a noisy one; 28 parts of seven real videos +1.6 dB and +0.009, +7.9 dB and +0.11; the worst part -0.45 and
+0.05 dB.

DIS runs on the CPU, and has no gradients.

Source: DIS, T. Kroeger et al., "Fast optical flow using dense inverse search", ECCV 2016.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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
# m where J agrees.  Against 1/2, 16 scenes gain 0.2 dB with a clean sensor and a noisy one, 16 parts of real videos
# -0.04 and 1.7 dB; with 1, moving pixels of real videos lose 0.7 dB.  To trust J the more where it is off everywhere,
# as noise of events is, gains 1.5 dB more of real videos with noise, and loses 1.4 dB of a flickering scene.
MOSTLY = 0.8


@dataclass(frozen=True, slots=True)
class Guided:
    """Both key frames at N instants.

    flows      [B, N, 4, H, W] px: from the target to the first frame (x, y), to the second
    warps      [B, N, K, C, H, W]: the frames, carried, and the picture beside them, if there is one
    logits     [B, N, K, H, W]: -a e, how well each agrees with the luminance that was given
    footprint  k
    """

    flows: torch.Tensor
    warps: torch.Tensor
    logits: torch.Tensor
    footprint: int = 1

    def blend(self, times: torch.Tensor) -> torch.Tensor:
        """J at times [B, N]."""
        beside = [torch.full_like(times, 0.5)] * (self.warps.shape[2] - 2)
        return blend(self.warps, self.logits, torch.stack([1 - times, times, *beside], -1))[0]

    def image(self, pictures: torch.Tensor, times: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
        """I at times [B, N], of the pictures that it was guided by."""
        carried = self.blend(times)
        start = recoloured(pictures, carried, transfer)
        return start + share_of_carried(self.logits, self.footprint) * (carried - start)


@in_full_precision
def guided(
    frame_0: torch.Tensor,
    frame_1: torch.Tensor,
    pictures: torch.Tensor,
    transfer: Transfer = "srgb",
    footprint: int = 1,
    beside: torch.Tensor | None = None,
) -> Guided:
    """Frames [B, C, H, W] carried to where the luminance of pictures [B, N, C, H, W] is; all are codes.

    footprint   k, pixels across that a pixel of the event camera looks at
    beside      another picture of the targets, [B, N, C, H, W], to be weighed with both
    """
    flows = flows_to(frame_0, frame_1, pictures, transfer, footprint)
    made = [warp(frame_0, flows[:, :, :2]), warp(frame_1, flows[:, :, 2:]), *([] if beside is None else [beside])]
    warps = torch.stack(made, 2)
    return Guided(flows, warps, agreement(warps, pictures, transfer, footprint), footprint)


@in_full_precision
def flows_to(
    frame_0: torch.Tensor,
    frame_1: torch.Tensor,
    pictures: torch.Tensor,
    transfer: Transfer = "srgb",
    footprint: int = 1,
) -> torch.Tensor:
    """Motion [B, N, 4, H, W] px from the luminance of pictures to both frames; as `guided`."""
    shown = averaged(_shown(pictures, transfer), footprint)
    keys = [averaged(_shown(frame[:, None], transfer), footprint) for frame in (frame_0, frame_1)]
    return torch.cat([_flows(shown, key) for key in keys], 2)


@in_full_precision
def motion_between(frame_0: torch.Tensor, frame_1: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """Motion [B, 4, H, W] px from each of two frames [B, C, H, W] to the other: of the first, then of the second."""
    shown = [_shown(frame[:, None], transfer) for frame in (frame_0, frame_1)]
    return torch.cat([_flows(shown[0], shown[1]), _flows(shown[1], shown[0])], 2).squeeze(1)


@in_full_precision
def agreement(
    warps: torch.Tensor, pictures: torch.Tensor, transfer: Transfer = "srgb", footprint: int = 1
) -> torch.Tensor:
    """Logits [B, N, K, H, W] of warps [B, N, K, C, H, W] by how far their luminance is from that of pictures."""
    difference = _shown(warps, transfer) - _shown(pictures, transfer)[:, :, None]
    error = averaged(difference, footprint).abs().squeeze(3)
    mean = F.avg_pool2d(error.flatten(0, 1), AROUND_PX, 1, AROUND_PX // 2, count_include_pad=False)
    return -SHARP / footprint**0.5 * mean.unflatten(0, error.shape[:2])


def share_of_carried(logits: torch.Tensor, footprint: int = 1) -> torch.Tensor:
    """m [B, N, 1, H, W] of logits [B, N, K, H, W]."""
    return (1 - (1 - MOSTLY) / footprint**2) * torch.exp(logits.amax(2, keepdim=True))


def averaged(values: torch.Tensor, footprint: int) -> torch.Tensor:
    """Means over squares of so many pixels across around each of [..., H, W]."""
    if footprint == 1:
        return values
    before, after = (footprint - 1) // 2, footprint // 2
    flat = F.pad(values.flatten(0, -3)[:, None], (before, after, before, after), mode="replicate")
    return F.avg_pool2d(flat, footprint, 1).view_as(values)


@in_full_precision
def recoloured(pictures: torch.Tensor, around: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """The luminance of pictures in the colours of others, all codes [..., C, H, W]."""
    light = luminance(to_light(pictures, transfer))
    return to_codes(coloured(light, ratios_of(to_light(around, transfer))), transfer)


def dense_flow() -> Any:
    """DIS of OpenCV's medium preset, down to single pixels and half as smooth.

    Of half the resolution, as the preset is, edges are off by half a pixel: `guided` loses 0.4 to 0.5 dB in scenes and
    0.05 to 0.1 in real videos, and registered events 0.7 dB.  It takes three times as long, 0.43 s at 1280x720.
    """
    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)  # type: ignore[attr-defined]
    dis.setFinestScale(0)
    dis.setVariationalRefinementAlpha(10.0)
    return dis


def _shown(pictures: torch.Tensor, transfer: Transfer) -> torch.Tensor:
    """Luminance as codes [..., 1, H, W], about as differences are seen."""
    return to_codes(luminance(to_light(pictures, transfer)), "srgb")


def _flows(shown: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
    """Motion [B, N, 2, H, W] from pictures [B, N, 1, H, W] to one of each batch, [B, 1, 1, H, W]; none in tiny ones."""
    if min(shown.shape[-2:]) < SMALLEST:
        return shown.new_zeros(*shown.shape[:2], 2, *shown.shape[-2:])
    starts, ends = (_eight_bits(each) for each in (shown.detach(), key.detach()))
    dis = dense_flow()
    found = [
        [convincing(dis.calc(start, end[0], None), start, end[0], CONVINCED_CODES) for start in some]
        for some, end in zip(starts, ends, strict=True)
    ]
    return torch.from_numpy(np.moveaxis(np.array(found), -1, 2).copy()).to(shown)


def _eight_bits(shown: torch.Tensor) -> np.ndarray:
    codes = (torch.nan_to_num(shown).clamp(0, 1) * 255).round()
    return codes.squeeze(2).to(torch.uint8).cpu().numpy()
