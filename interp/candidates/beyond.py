"""Light beyond the range of a frame sensor, carried on by events.

    above    where the frame is at the top of its range       max(top, before exp(change))
    below    where it is at the bottom                        min(bottom, before exp(change))
    else     the frame

`before` is what was found at the frame before.  What a pixel showed while it was within the range is carried on for as
long as it is beyond.  What was never within begins as it is beyond the range usually, and moves as its events and the
range allow: a third above the top (60 scenes and photographs, seen by sensors of the paper's ranges: +0.3 nat, the
median of the mean); and below the bottom the deeper, the more of the picture is, and the more of what is around,

    -(0.04 + 1.2 share of the picture + 0.75 share around) nats

Regressed on the same: -(0.05 + 1.46 + 0.93), held back by a fifth, since what is beyond the range decides more than its
share.  Against a nat for all, 40 others gain 0.5 dB in decades and .006 SSIM, these 0.6 dB.

Noise of events adds up, and the ends of the range let it go one way only, so that a pixel which is beyond for long
would drift off.  The distance from what is usual [nat] shrinks by a fiftieth per frame: shot noise of 5 events/s of
0.2 nat, at 30 frames/s, stays within 0.4 nat (standard deviation of the random walk that is pulled back like this).
"""

from __future__ import annotations

import math

import torch

from interp.around import mean_around
from interp.precision import in_full_precision

TOP, BOTTOM = 0.985, 5e-4  # of the range: three standard deviations below its top of the largest noise of the paper's
# sensors (5.2 LSB of 10 bits), and two codes of 8 bits above its bottom
DARK, NOISE_PX = 0.0025, 5  # that noise, cut off at 0, is 0.002 in the mean; over so many pixels across
ABOVE = math.log(4 / 3)  # from the top [nat]
BELOW, BELOW_SHARE, BELOW_AROUND, AROUND_PX = -0.04, -1.2, -0.75, 9  # from the bottom [nat]
KEPT = 0.98
DARKEST, BRIGHTEST = 1e-6, 1e3  # of diffuse white


@in_full_precision
def carried(
    frame: torch.Tensor, change: torch.Tensor, before: torch.Tensor | None, limits: torch.Tensor | None = None
) -> tuple[torch.Tensor, torch.Tensor]:
    """Light [B, C, H, W] of frames [B, C, H, W], 1 is diffuse white, that clip at their limits; and where they do.

    change   [B, 1, H, W] nats by which the log of light has changed since the frame before
    before   the light that this function gave for that; None for the first
    limits   [B, 2] light of the lowest and the highest code; 0 and 1 unless given
    """
    bottom, top = _ends(frame, limits)
    above, low = frame >= top, frame <= bottom + (1 - TOP) * (top - bottom)
    # (noise of the sensor lifts single pixels from the bottom of the range)
    below = (frame <= bottom) | (low & (mean_around(frame, NOISE_PX) <= bottom + DARK * (top - bottom)))
    deep = _usual_below(below)
    if before is None:
        before = torch.where(above, top * math.exp(ABOVE), torch.where(below, bottom * deep.exp(), frame))
    nats = torch.log(before.clamp(DARKEST, BRIGHTEST)) + change
    below = below | (low & (nats < bottom.log()))  # (what was below is so until events or more than noise lift it)
    over = _pulled(nats - top.log(), ABOVE).clamp(min=0) + top.log()
    under = _pulled(nats - bottom.log(), deep).clamp(max=0) + bottom.log()
    found = torch.where(above, over, under).exp().clamp(DARKEST, BRIGHTEST)
    return torch.where(above | below, found, frame), above | below


def _usual_below(below: torch.Tensor) -> torch.Tensor:
    """How far below the bottom of the range light is where it is below, usually [nat]."""
    share = below.float().mean((1, 2, 3), keepdim=True)
    return BELOW + BELOW_SHARE * share + BELOW_AROUND * mean_around(below.float(), AROUND_PX)


def _pulled(nats: torch.Tensor, usual: torch.Tensor | float) -> torch.Tensor:
    return usual + KEPT * (nats - usual)


def _ends(frame: torch.Tensor, limits: torch.Tensor | None) -> tuple[torch.Tensor, torch.Tensor]:
    """Light [B, 1, 1, 1] below and above which a frame says no more."""
    if limits is None:
        limits = frame.new_tensor([0.0, 1.0]).expand(len(frame), 2)
    low, high = limits[:, :, None, None, None].float().unbind(1)
    return (low + BOTTOM * (high - low)).clamp(min=DARKEST), low + TOP * (high - low)
