"""How much log light an event stands for, where the sensor's thresholds are not known: from the key frames themselves.

    c^2 = (sum dL^2 + p c0^2) / (sum E^2 + p)        E > 0: c_ON;  E < 0: c_OFF

dL is the difference of the logs of both frames, E the count of ON less OFF events between them, summed over the
pixels of each sign.  That is the geometric mean of the two regressions, of dL on E and of E on dL: the first alone is
too low, since counts are noisy (0.134 to 0.144 for 0.15 of a clean sensor, against 0.143 to 0.151).  c0 = 0.15 nat
weighs as much as p pixels with an event. A known threshold is better: for a noisy sensor of 0.235 this gives 0.19 to
0.22.  Not so where pixels of the event camera are k of the frames' wide: counts between four of them vary less than
each, and what they stand for is more, 0.20, 0.22 and 0.26 for 0.15 (k = 2, 3, 4), with which `guided` is 0.6 dB better
in four scenes of two photographs each, and integrals are alike.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from interp.candidates.bridge import DARK
from interp.light import Transfer, luminance, to_light
from interp.precision import in_full_precision
from interp.representation.event_counts import USUAL_NATS, EventCounts

PRIOR_PIXELS = 16.0
LEAST, MOST = 0.02, 1.0  # nats: no sensor is beyond


@in_full_precision
def with_fitted_contrast(
    frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts, transfer: Transfer = "srgb"
) -> EventCounts:
    """The counts with the contrast that fits each pair of frames best; frames as codes [B, C, H, W]."""
    before, after = (torch.log(luminance(to_light(frame, transfer)) + DARK) for frame in (frame_0, frame_1))
    difference = (after - before).squeeze(1)
    off, on = events.summed().off_on.squeeze(2).unbind(1)
    net = on - off
    squares = [
        ((difference**2 * of_sign).sum((1, 2)) + PRIOR_PIXELS * USUAL_NATS**2)
        / ((net**2 * of_sign).sum((1, 2)) + PRIOR_PIXELS)
        for of_sign in (net < 0, net > 0)
    ]
    return replace(events, contrast=torch.stack(squares, 1).sqrt().clamp(LEAST, MOST))
