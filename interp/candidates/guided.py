"""Guided by light: both key frames carried to where the luminance is that events and key frames give.

Events tell luminance at any instant nearly to the noise of the sensor, but no colours, and fine texture no better than
to a threshold.  Key frames have both, at other places.  So the motion from an instant to either key frame is estimated
on the luminance of the ramps (`ramps.py`), which is there already, not between key frames that are far apart in time:

    F_tk = DIS(luminance of the ramps at t -> luminance of frame k)            nearby, whatever the motion in between
    J0   = sum_k w_k g(I_k, F_tk)      w_k ~ s_k exp(-a e_k), s = (1 - t, t), e_k how far luminance is off there
    J    = w J0 + (1 - w) D            w ~ exp(-b e), D what key frames say alone (`alone.py`)
    C    = luminance of the ramps in the colours of J
    I    = C + m (J - C)               m = c^2 / (c^2 + j^2)

J0 goes wherever light went, but its motion is sought on what events tell: on their noise, or on coarse pixels.  The
motion of D is sought between two frames, and goes evenly from one to the other.  So D counts where it is nearer to C.

J is free of the noise of events, C right where nothing in the key frames is, and I is nearer than either: the best mix
of two pictures whose errors have nothing to do with each other, as Wiener's filter is.  c^2 is the mean squared error
of C, of what the key frames show that events missed (`ramps.in_doubt`); and e^2, of J and C apart, is c^2 + j^2.
That is of means around a pixel.  But a lone event of noise is in one pixel, so there c^2 is the largest of what is
missed in it, next to it, and around.  So J counts where C is in doubt, or both agree, and C where it is certain and J
is not: flicker, smoke, what comes into view.  Motion counts where it explains light better than standing still does
(`vid2ev.upsample.motion.convincing`), so what stands still stays as it is.

Where a pixel of the event camera looks at k x k pixels of the frames, C has luminance averaged over them and nothing
finer.  So F and e are of luminance averaged alike, and c^2 in j^2 = e^2 - c^2 of doubts averaged alike, while c^2
itself knows what C does not show.  What is taken over so many pixels is over k times as many, a is a / sqrt(k), and it
is done twice: the second time motion is to I in place of C (`sight.py`).

Measured, PSNR and SSIM over those of the bridge, x8: 16 scenes +5.0 dB and +0.049 with a clean sensor, +4.5 dB and
+0.070 with a noisy one; 32 parts of eight real videos +2.1 dB and +0.013, +11.0 dB and +0.12; the worst part 0 and +2.6
dB.  With k = 2 the scenes are +3.1 and +2.9 dB, the parts +1.6 and +8.2 dB; with k = 4 the scenes +1.9 and +1.7 dB.
With c^2 of means around alone noisy real videos are 1.8 dB worse (k = 3: 0.8), and all else is alike.  With bilinear
light in place of cubic 0.1 to 0.2 dB less, up to 1.1 where texture is fine and fast.  Without D the worst part is -0.2
dB, two videos whose motion is even lose 0.2 and 0.3 dB, with noise 0.4, and others gain 0.1 or lose up to 0.2.  With
m = 4/5 exp(-a e), whatever the doubt, scenes are 0.4 dB worse, real videos 0 and 2.2 dB.

A mix of J0 and D that is nearest to C (least squares, over 9 to 65 px) gains up to 0.4 dB more where motion is even,
and loses 0.1 to 0.2 dB in scenes and up to 0.8 in parts where something small is fast.  Motion that is even along its
path (the median of five instants), carried beside the other, is worth 0.1 dB in scenes and nothing in real videos.

DIS runs on the CPU, and has no gradients.

Source: DIS, T. Kroeger et al., "Fast optical flow using dense inverse search", ECCV 2016.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import torch
from torch.nn import functional as F

from interp.around import mean_around
from interp.blend import blend
from interp.candidates.bridge import coloured, ratios_of
from interp.light import Transfer, luminance, to_codes, to_light
from interp.precision import in_full_precision
from interp.warp import both_warped
from vid2ev.upsample.motion import convincing

SMALLEST = 16  # px: DIS refuses less than 12
CONVINCED_CODES = 0.5  # by how much motion must be better than none
SHARP = 40.0  # a: weights fall to 1/e where luminance (codes 0 ... 1) is off by a fortieth
AROUND_PX = 5  # mean of errors over so many pixels
NEARER, NEARER_PX = 16.0, 9  # b / a, and pixels over which it is asked which of two is nearer
DOUBT_PX = 17  # and of doubts: lone events of noise are rare
SEES_PX = DOUBT_PX // 2 + 2  # of the event camera, that what becomes of a pixel depends on around it, motion apart
LEAST_OFF = 0.003  # that J is off by, at the least, codes: less than one of 255
OF_MEAN = math.pi / 2  # the mean square of a normal distribution by the square of its mean absolute value
GAMMA, DARKEST = 2.2, 0.02  # d code / d ln light = code / 2.2, of codes that are not quite black


@dataclass(frozen=True, slots=True)
class Guided:
    """Both key frames at N instants.

    shown      [B, N, 1, H, W]: luminance of the pictures that they are guided by (`shown_of`)
    flows      [B, N, 4, H, W] px: from the target to the first frame (x, y), to the second
    warps      [B, N, 2, C, H, W]: the frames, carried
    logits     [B, N, 2, H, W]: -a e, how well each agrees with the luminance that was given
    footprint  k
    """

    shown: torch.Tensor
    flows: torch.Tensor
    warps: torch.Tensor
    logits: torch.Tensor
    footprint: int = 1

    def blend(self, times: torch.Tensor) -> torch.Tensor:
        """J0 at times [B, N]."""
        return blend(self.warps, self.logits, torch.stack([1 - times, times], -1))[0]

    def image(
        self,
        pictures: torch.Tensor,
        doubt: torch.Tensor,
        alone: torch.Tensor,
        times: torch.Tensor,
        transfer: Transfer = "srgb",
    ) -> torch.Tensor:
        """I at times [B, N], of the pictures that it was guided by, how far their light may be off [nat], and D."""
        carried, agreed = nearer(self.blend(times), alone, self.shown, transfer, self.footprint)
        start = recoloured(pictures, carried, transfer)
        wrong, seen_wrong = off_by(self.shown, doubt, self.footprint)
        share = part_of(wrong, carried_off_by(agreed, seen_wrong, self.footprint))
        return start + share * (carried - start)


@in_full_precision
def guided(
    frame_0: torch.Tensor,
    frame_1: torch.Tensor,
    pictures: torch.Tensor,
    transfer: Transfer = "srgb",
    footprint: int = 1,
    flows: torch.Tensor | None = None,
    corner: tuple[int, int] | None = None,
) -> Guided:
    """Frames [B, C, H, W] carried to where the luminance of pictures [B, N, C, H, W] is; all are codes.

    footprint   k, pixels across that a pixel of the event camera looks at
    flows       the motion, if it is known already: `flows_to` these pictures or to what looks more like the targets
    corner      row and column of the frames at which the pictures begin, where they and the flows are of a part
    """
    flows = flows_to(frame_0, frame_1, pictures, transfer, footprint) if flows is None else flows
    warps = both_warped(frame_0, frame_1, flows, corner, cubic=True)
    shown = shown_of(pictures, transfer)
    return Guided(shown, flows, warps, agreement(warps, shown, transfer, footprint), footprint)


@in_full_precision
def flows_to(
    frame_0: torch.Tensor,
    frame_1: torch.Tensor,
    pictures: torch.Tensor,
    transfer: Transfer = "srgb",
    footprint: int = 1,
) -> torch.Tensor:
    """Motion [B, N, 4, H, W] px from the luminance of pictures to both frames; as `guided`."""
    shown = averaged(shown_of(pictures, transfer), footprint)
    keys = [averaged(shown_of(frame[:, None], transfer), footprint) for frame in (frame_0, frame_1)]
    return torch.cat([_flows(shown, key) for key in keys], 2)


@in_full_precision
def motion_between(frame_0: torch.Tensor, frame_1: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """Motion [B, 4, H, W] px from each of two frames [B, C, H, W] to the other: of the first, then of the second."""
    shown = [shown_of(frame[:, None], transfer) for frame in (frame_0, frame_1)]
    return torch.cat([_flows(shown[0], shown[1]), _flows(shown[1], shown[0])], 2).squeeze(1)


@in_full_precision
def shown_of(pictures: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """Luminance of pictures [..., C, H, W] as codes [..., 1, H, W], about as differences are seen."""
    return to_codes(luminance(to_light(pictures, transfer)), "srgb")


@in_full_precision
def agreement(
    warps: torch.Tensor, shown: torch.Tensor, transfer: Transfer = "srgb", footprint: int = 1
) -> torch.Tensor:
    """Logits [B, N, K, H, W] of warps [B, N, K, C, H, W] by how far their luminance is from that of pictures."""
    return _logits(_apart(warps, shown, transfer, footprint), AROUND_PX, footprint)


@in_full_precision
def nearer(
    carried: torch.Tensor,
    alone: torch.Tensor,
    shown: torch.Tensor,
    transfer: Transfer = "srgb",
    footprint: int = 1,
) -> tuple[torch.Tensor, torch.Tensor]:
    """J [B, N, C, H, W] of J0 and D, by which is nearer to `shown`; and its logits of agreement [B, N, 1, H, W]."""
    both = torch.stack([carried, alone], 2)
    apart = _apart(both, shown, transfer, footprint)
    mixed, weights = blend(both, NEARER * _logits(apart, NEARER_PX, footprint), both.new_ones(2))
    return mixed, _logits((weights * apart).sum(2, keepdim=True), AROUND_PX, footprint)  # (nearly linear in codes)


@in_full_precision
def off_by(shown: torch.Tensor, doubt: torch.Tensor, footprint: int = 1) -> tuple[torch.Tensor, torch.Tensor]:
    """c^2, mean squared errors of pictures in codes, [B, N, 1, H, W]: the largest of a pixel's, of those next to it,
    and of those around; and of pictures averaged alike, those around.

    doubt   how far their light may be off [B, N, 1, H, W] nat
    """
    per_nat = (shown.clamp(min=DARKEST) / GAMMA) ** 2
    wrong = [_around(doubt**2, across_px, footprint) for across_px in (1, AROUND_PX, DOUBT_PX)]
    seen_wrong = wrong[-1] if footprint == 1 else _around(averaged(doubt, footprint) ** 2, DOUBT_PX, footprint)
    return per_nat * torch.stack(wrong).amax(0), per_nat * seen_wrong


@in_full_precision
def carried_off_by(logits: torch.Tensor, seen_wrong: torch.Tensor, footprint: int = 1) -> torch.Tensor:
    """j^2 [B, N, 1, H, W] of logits of agreement [B, N, K, H, W], and of c^2 averaged alike."""
    apart = OF_MEAN * (logits.amax(2, keepdim=True) * footprint**0.5 / SHARP) ** 2
    return (apart - seen_wrong).clamp(min=0)


def part_of(one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """Of c^2 and j^2: m; of j^2 and c^2: 1 - m, but none where C and J are no farther apart than C is in doubt."""
    return one / (one + other + LEAST_OFF**2)


def averaged(values: torch.Tensor, footprint: int) -> torch.Tensor:
    """Means over squares of so many pixels across around each of [..., H, W]."""
    if footprint == 1:
        return values
    reach = footprint // 2
    means = F.avg_pool2d(F.pad(values.flatten(0, -3)[:, None], (reach,) * 4, mode="replicate"), footprint, 1)
    # (of an even number across the pixels at both ends count half: the square is around the pixel, not beside it)
    return (means if footprint % 2 else F.avg_pool2d(means, 2, 1)).view_as(values)


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


def _apart(warps: torch.Tensor, shown: torch.Tensor, transfer: Transfer, footprint: int) -> torch.Tensor:
    """By how much luminance of warps is above that of pictures, codes [B, N, K, H, W]."""
    return averaged(shown_of(warps, transfer) - shown[:, :, None], footprint).squeeze(3)


def _logits(apart: torch.Tensor, across_px: int, footprint: int) -> torch.Tensor:
    """-a e of these, e over so many pixels of the event camera."""
    return -SHARP / footprint**0.5 * _around(apart.abs(), across_px, footprint)


def _around(maps: torch.Tensor, across_px: int, footprint: int) -> torch.Tensor:
    """Means over squares around each pixel of [B, N, K, H, W], of so many pixels of the event camera."""
    return mean_around(maps.flatten(0, 1), across_px * footprint // 2 * 2 + 1).unflatten(0, maps.shape[:2])


def _flows(shown: torch.Tensor, key: torch.Tensor) -> torch.Tensor:
    """Motion [B, N, 2, H, W] from pictures [B, N, 1, H, W] to one of each batch, [B, 1, 1, H, W]; none in tiny ones."""
    if min(shown.shape[-2:]) < SMALLEST:
        return shown.new_zeros(*shown.shape[:2], 2, *shown.shape[-2:])
    starts, ends = (_eight_bits(each) for each in (shown.detach(), key.detach()))
    pairs = [(start, end[0]) for some, end in zip(starts, ends, strict=True) for start in some]
    share = -(-len(pairs) // torch.get_num_threads())
    with ThreadPoolExecutor(torch.get_num_threads()) as pool:
        parts = pool.map(_found, [pairs[k : k + share] for k in range(0, len(pairs), share)])
        found = [flow for part in parts for flow in part]
    flows = np.moveaxis(np.array(found), -1, 1).reshape(*shown.shape[:2], 2, *shown.shape[-2:])
    return torch.from_numpy(flows).to(shown)


def _found(pairs: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
    """Motion [H, W, 2] from the one to the other of pairs of pictures of 8 bits, where it is more convincing than none.

    (DIS keeps its memory from one pair to the next: one for each pair would take up to 1.4 times as long.)
    """
    dis = dense_flow()
    return [convincing(dis.calc(start, end, None), start, end, CONVINCED_CODES) for start, end in pairs]


def _eight_bits(shown: torch.Tensor) -> np.ndarray:
    codes = (torch.nan_to_num(shown).clamp(0, 1) * 255).round()
    return codes.squeeze(2).to(torch.uint8).cpu().numpy()
