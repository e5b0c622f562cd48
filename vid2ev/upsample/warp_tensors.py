"""`warp` in tensors of torch, on whatever device they are, for several instants at a time.

The arithmetic is that of `warp`, in its order, and so are the bits, but for three sums: of what `splat` throws to a
place, of the blur, and of what enlarges the motion.  What is thrown is added up in whole multiples of 2**-40, whose sum
is the same in any order, as the threads of a card keep none; a place that is thrown velocities of 2**23 px in all would
overflow.

Shapes: n instants; frames of [H, W], motion on the grid [h, w] of `flow.Motion`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import reduce
from operator import add
from typing import Any

import cv2
import numpy as np

from vid2ev.upsample.warp import AFTER, BEFORE

UNIT = 2.0**-40
TINY = 1e-20  # in place of a sum of nothing


def splat(flow: Any, sure: Any, unsure: float, time: Any, direction: float, share: Any) -> Any:
    """`warp.splat` of one frame for the instants `time` [n, 1, 1]: int64 [3, n, h + 2, w + 2], in `UNIT`s.

    They are sums of share weight velocity (x, y), and of the weights; `share` is [n, 1, 1].
    """
    import torch

    height, width = sure.shape
    count, pitch, size = len(time), width + 2, (height + 2) * (width + 2)
    across, down, weight = flow[..., 0], flow[..., 1], (sure + unsure) / UNIT
    to_x = _numbers(width, sure) + 1 + time * across
    to_y = (_numbers(height, sure) + 1)[:, None] + time * down
    inside = (to_x >= 0) & (to_x < width + 1) & (to_y >= 0) & (to_y < height + 1)
    column, row = to_x.long(), to_y.long()
    right, lower = to_x - column, to_y - row
    sums = torch.zeros((3, count * size + pitch + 2), dtype=torch.int64, device=sure.device)
    here = torch.arange(count, device=sure.device)[:, None, None] * size + row * pitch + column
    here = torch.where(inside, here, count * size).view(-1)  # (what falls outside lies behind all places)
    x_sum, y_sum = direction * share * across, direction * share * down
    for part, place in (
        ((1 - right) * (1 - lower) * weight, 0),
        (right * (1 - lower) * weight, 1),
        ((1 - right) * lower * weight, pitch),
        (right * lower * weight, pitch + 1),
    ):
        for plane, value in zip(sums, (part * x_sum, part * y_sum, part), strict=True):
            plane[place:].index_add_(0, here, value.long().view(-1))
    return sums[:, : count * size].view(3, count, height + 2, width + 2)


def settle(thrown: Any, other: Any, taps: int, blur_px: float, time: Any, enough: float) -> tuple[Any, Any, Any]:
    """`warp.settle` of the sums that the frame before and the one after have thrown, blurred: velocity x and y, and
    the weight of the frame before, each [n, h, w]."""
    import torch

    sums = torch.cat([thrown[:2] + other[:2], thrown[2:], other[2:]])
    x, y, before, after = _blurred((sums.float() * UNIT).flatten(0, 1), taps, blur_px).unflatten(0, (4, -1))
    inverse = 1 / ((1 - time) * before + time * after + TINY)
    seen_before = (1 - time) * (before / (before + enough) + 1e-6)
    seen_after = time * (after / (after + enough) + 1e-6)
    return x * inverse, y * inverse, seen_before / (seen_before + seen_after)


def _blurred(plane: Any, taps: int, blur_px: float) -> Any:
    """Planes [n, h + 2, w + 2] after OpenCV's Gaussian blur, without their margins."""
    import torch

    half, weights = taps // 2, cv2.getGaussianKernel(taps, blur_px, cv2.CV_32F)[:, 0].tolist()
    for axis in (2, 1):
        length = plane.shape[axis] - 2
        margins = [half - 1, half - 1, 0, 0] if axis == 2 else [0, 0, half - 1, half - 1]
        wide = torch.nn.functional.pad(plane[:, None], margins, mode="reflect")[:, 0]
        total = weights[half] * wide.narrow(axis, half, length)
        for k in range(1, half + 1):
            total = total + weights[half + k] * (
                wide.narrow(axis, half - k, length) + wide.narrow(axis, half + k, length)
            )
        plane = total
    return plane


def enlarged(plane: Any, size: tuple[int, int]) -> Any:
    """Planes [n, h, w] brought to `size` (W, H) along straight lines, as OpenCV does."""
    for axis, outputs in ((2, size[0]), (1, size[1])):
        below, share = _lines(plane.shape[axis], outputs)
        first = _there(below, plane)
        last = _there(np.minimum(below + 1, plane.shape[axis] - 1), plane)
        part = _there(share if axis == 2 else share[:, None], plane)
        plane = plane.index_select(axis, first) * (1 - part) + plane.index_select(axis, last) * part
    return plane


def carry(before: Any, after: Any, motion: tuple[Any, Any, Any], time: Any) -> Any:
    """`warp.carry`: light [n, H, W, C] at the instants `time` [n, 1, 1].

    before, after   the frames [C, H, W] as of `with_margin`
    motion          of `settle`, [n, H, W] each, in px of the frames
    """
    import torch

    across, down, share = motion
    ends = zip(
        _seen(before, _places(across, down, -time, before)), _seen(after, _places(across, down, 1 - time, after)),
        strict=True,
    )  # fmt: skip
    channels = [seen_after + share * (seen_before - seen_after) for seen_before, seen_after in ends]
    return torch.stack(channels, -1)


def with_margin(light: Any) -> Any:
    """Channels [C, H + 3, W + 3] of light [H, W] or [H, W, 3]: borders go on outwards."""
    import torch

    channels = light[None] if light.ndim == 2 else light.movedim(-1, 0)
    return torch.nn.functional.pad(channels[None], (BEFORE, AFTER, BEFORE, AFTER), mode="replicate")[0].contiguous()


def _places(across: Any, down: Any, time: Any, frame: Any) -> tuple[Any, list[Any], list[Any]]:
    """As in `warp`: first of 4 x 4 entries of a flat frame with margins, and the weights of its columns and rows."""
    _, height, width = across.shape
    to_x = (_numbers(width, across) + time * across).nan_to_num(0.0).clamp(0, width - 1)
    to_y = (_numbers(height, across)[:, None] + time * down).nan_to_num(0.0).clamp(0, height - 1)
    column, row = to_x.long(), to_y.long()
    return row * frame.shape[2] + column, _cubic(to_x - column), _cubic(to_y - row)


def _cubic(a: Any) -> list[Any]:
    """Weights of four places at the shares a between the second and the third of them."""
    first, third = 0.5 * a * ((2 - a) * a - 1), 0.5 * a * ((4 - 3 * a) * a + 1)
    last = 0.5 * a * a * (a - 1)
    return [first, 1 - first - third - last, third, last]


def _seen(frame: Any, places: tuple[Any, list[Any], list[Any]]) -> Iterator[Any]:
    """Light [n, H, W] of each channel of a frame at places."""
    entry, columns, rows = places
    for channel in frame:
        flat, sums, middle = channel.view(-1), [], []
        for j in range(4):
            row = [flat[j * channel.shape[1] + k :][entry] for k in range(4)]
            sums.append(rows[j] * _sum_of(light * weight for light, weight in zip(row, columns, strict=True)))
            middle += row[1:3] if j in (1, 2) else []
        value, (p, q, r, s) = _sum_of(sums), middle
        low, high = p.minimum(q).minimum(r.minimum(s)), p.maximum(q).maximum(r.maximum(s))
        yield value.maximum(low).minimum(high)


def _sum_of(tensors: Iterable[Any]) -> Any:
    """Their sum, from the first to the last."""
    return reduce(add, tensors)


def _lines(length: int, outputs: int) -> tuple[np.ndarray, np.ndarray]:
    """The place below each of so many outputs over an axis of this length, and how far each is above it."""
    place = ((np.arange(outputs) + 0.5) * (length / outputs) - 0.5).astype(np.float32)
    below = np.floor(place).astype(np.int64)
    share = np.where((below < 0) | (below >= length - 1), 0, place - below).astype(np.float32)
    return below.clip(0, length - 1), share


def _numbers(count: int, like: Any) -> Any:
    """0, 1, ... in float32, on the device of a tensor."""
    import torch

    return torch.arange(count, dtype=torch.float32, device=like.device)


def _there(array: np.ndarray, like: Any) -> Any:
    """An array as a tensor on the device of another."""
    import torch

    return torch.from_numpy(array).to(like.device)
