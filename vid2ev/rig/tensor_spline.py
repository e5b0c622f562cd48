"""The cubic spline of a picture that is a tensor of torch, on whatever device it is.

It is that of `spline.py`, whose recursive filter is unrolled by doubling, since a device takes long for steps that wait
for each other.  With the pole z and light s

    sum_{j < 16} z^j s_{k-j} = (1 + z^8 S^8) (1 + z^4 S^4) (1 + z^2 S^2) (1 + z S) s_k,    S s_k = s_{k-1}

and likewise from the other side; what is left out is less than 1e-9 of the light.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from vid2ev.rig.spline import BRIGHTEST, HORIZON, INFINITE, MARGIN, POLE

DOUBLINGS = tuple(2**k for k in range(HORIZON.bit_length() - 1))
REACH = HORIZON - 1 + MARGIN  # pixels beyond the border that the filter looks at


class TensorSpline(NamedTuple):
    """A picture, ready to be sampled anywhere: tensors float32, colour by colour."""

    pixels: Any  # [C, H, W]
    weights: Any  # [C, H + 2 MARGIN, W + 2 MARGIN], mirrored at the border
    least: Any  # [C, H, W] what a place nearest to a pixel may have
    most: Any


def spline_of(light: Any) -> TensorSpline:
    """The spline of light [H, W] or [H, W, 3]."""
    import torch

    planes = light.reshape(*light.shape[:2], -1).movedim(-1, 0).to(torch.float32)
    known = planes.nan_to_num(nan=0.0)
    pixels = known.where(known.abs() < INFINITE, known.sign() * BRIGHTEST).contiguous()
    gain = (6.0 * float(POLE)) ** 2  # of both axes
    weights = _filtered(_filtered(gain * pixels, 1), 2)
    high, low = (sign * torch.nn.functional.max_pool2d(sign * pixels, 3, 1, 1) for sign in (1.0, -1.0))
    room = 0.5 * (high - low)
    least = torch.where(low >= 0, torch.maximum(low - room, 0.25 * low), low - room)
    return TensorSpline(pixels, weights, least, high + room)


def _filtered(planes: Any, axis: int) -> Any:
    """From light to weights along an axis, but for the factor; MARGIN of them are added at both ends."""
    import torch

    length = planes.shape[axis]
    around = torch.arange(-REACH, length + REACH, device=planes.device).abs() % max(2 * length - 2, 1)
    wide = planes.index_select(axis, torch.minimum(around, (2 * length - 2 - around).abs()))
    for forwards in (True, False):
        for step in DOUBLINGS:
            rest = wide.shape[axis] - step
            early, late = wide.narrow(axis, 0, rest), wide.narrow(axis, step, rest)
            wide = torch.add(*((late, early) if forwards else (early, late)), alpha=float(POLE) ** step)
    return wide
