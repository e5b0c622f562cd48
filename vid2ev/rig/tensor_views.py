"""Views of a picture that is a tensor of torch, sampled on the device where it is.

Where the pixels of a camera look is found out on the CPU and goes to the device once, as long as it stays the same;
light does not leave it.  Sums are those of `sampling.py` and `holes.py`, in their order, so that no more than the
spline's filter (`tensor_spline.py`) rounds otherwise.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vid2ev.rig.holes import NOTHING, Fill
from vid2ev.rig.sampling import keys_weights, spline_weights
from vid2ev.rig.spline import MARGIN
from vid2ev.rig.tensor_spline import TensorSpline


class TensorLook:
    """How a view is made of a picture of `size` (width, height) that is on a device.

    x, y     [h, w] float32, where its places look
    samples  places across each pixel
    fill     how holes are filled
    cuts     near_cut, inverse depths and steepness of the surface, if the picture is of one
    """

    def __init__(
        self,
        size: tuple[int, int],
        x: np.ndarray,
        y: np.ndarray,
        samples: int,
        fill: Fill | None,
        cuts: tuple[Any, ...],
        device: Any,
    ):
        import torch

        self._shape, self._samples = x.shape, samples
        across, down = (
            torch.from_numpy(np.array(place).reshape(-1)).to(device).clamp(0, length - 1)
            for place, length in zip((x, y), size, strict=True)
        )
        self._of_spline = _SplineSums(across, down, size[0])
        self._beside_cuts = _sums_beside_cuts(across, down, *cuts) if cuts else None
        self._fill = None if fill is None or not fill.holes.size else _TensorFill(fill, device)

    def light(self, spline: TensorSpline, smoothings: int) -> Any:
        """Light [h, w, C] of the view."""
        fine = self._of_spline.light(spline)
        if self._beside_cuts is not None:
            fine.index_copy_(1, *self._beside_cuts.light(spline))
        if self._fill is not None:
            self._fill.apply(fine, smoothings)
        return _pixel_means(fine.reshape(-1, *self._shape), self._samples).movedim(0, -1).contiguous()


class _SplineSums:
    """Each place as a sum of sixteen splines, held to what the pixels around allow."""

    def __init__(self, across: Any, down: Any, width: int):
        import torch

        left, top = across.to(torch.int32), down.to(torch.int32)
        a, b = across - left, down - top
        self._x, self._y = spline_weights.py_func(a), spline_weights.py_func(b)
        self._step = width + 2 * MARGIN
        self._first = (top + (MARGIN - 1)) * self._step + left + (MARGIN - 1)
        self._own = (top + (b >= 0.5)) * width + left + (a >= 0.5)

    def light(self, spline: TensorSpline) -> Any:
        """Light [C, places]."""
        splines, (x0, x1, x2, x3) = spline.weights.flatten(1), self._x
        v0, v1, v2, v3 = (self._column(splines[:, k:]) for k in range(4))
        light = (x0 * v0 + x1 * v1) + (x2 * v2 + x3 * v3)
        least, most = (limit.flatten(1).index_select(1, self._own) for limit in (spline.least, spline.most))
        return light.maximum(least).minimum(most)

    def _column(self, splines: Any) -> Any:
        p0, p1, p2, p3 = (splines[:, k * self._step :].index_select(1, self._first) for k in range(4))
        y0, y1, y2, y3 = self._y
        return y0 * p0 + y1 * p1 + (y2 * p2 + y3 * p3)


class _SumsBesideCuts(NamedTuple):
    """Places near cuts as sums of sixteen pixels; those on another surface are the nearest one, and add nothing."""

    places: Any  # [n] their numbers
    own: Any  # [n] flat index of the nearest pixel
    pixels: Any  # [16, n] flat indices
    weights: Any  # [16, n]

    def light(self, spline: TensorSpline) -> tuple[Any, Any]:
        """The places, and their light [C, n]."""
        pixels = spline.pixels.flatten(1)
        own, lights = pixels.index_select(1, self.own), _taken(pixels, self.pixels)
        light = own + _in_order(self.weights * (lights - own[:, None]))
        return self.places, light.maximum(lights.amin(1).minimum(own)).minimum(lights.amax(1).maximum(own))


def _sums_beside_cuts(across: Any, down: Any, near_cut: np.ndarray, inverse: np.ndarray, steep: float) -> Any:
    import torch

    height, width = near_cut.shape
    near, depths = (torch.from_numpy(np.array(plane).reshape(-1)).to(across.device) for plane in (near_cut, inverse))
    places = near[(down + 0.5).long() * width + (across + 0.5).long()].nonzero()[:, 0]
    across, down = across[places], down[places]
    left, top, own_x, own_y = across.long(), down.long(), (across + 0.5).long(), (down + 0.5).long()
    own = own_y * width + own_x
    depth, pixels, weights = depths[own], [], []
    weights_x, weights_y = keys_weights.py_func(across - left), keys_weights.py_func(down - top)
    for m in range(4):
        row = (top + (m - 1)).clamp(0, height - 1)
        for n in range(4):
            column = (left + (n - 1)).clamp(0, width - 1)
            pixel, away = row * width + column, (row - own_y).abs().maximum((column - own_x).abs()).float()
            alike = (depths[pixel] - depth).abs() <= float(np.float32(steep)) * away * depths[pixel].maximum(depth)
            pixels.append(torch.where(alike, pixel, own))
            weights.append(weights_y[m] * weights_x[n])
    return _SumsBesideCuts(places, own, torch.stack(pixels), torch.stack(weights))


class _TensorFill:
    """`Fill` on a device."""

    def __init__(self, fill: Fill, device: Any):
        rounds = [slice(*ends) for ends in pairwise(fill.rounds)]
        self._rounds = [_sums(fill.holes[k], fill.sources[k], fill.weights[k], device) for k in rounds]
        self._smooth = _sums(fill.holes, fill.around, fill.shares, device)

    def apply(self, picture: Any, smoothings: int) -> None:
        """Fill the holes of a picture [C, pixels] in place, and make smooth what is filled in."""
        for holes, base, sources, weights in [*self._rounds, *[self._smooth] * smoothings]:
            first = picture.index_select(1, base)
            light = first + _in_order(weights * (_taken(picture, sources) - first[:, None]))
            picture.index_copy_(1, holes, light)


def _sums(holes: np.ndarray, sources: np.ndarray, weights: np.ndarray, device: Any) -> list[Any]:
    """Holes [n], the base that differences are from, and what they are sums of, with weights [., n]; those that are not
    there are the base, and weigh nothing."""
    import torch

    there = sources != NOTHING
    base = np.take_along_axis(sources, there.argmax(axis=1)[:, None], axis=1)
    arrays = (holes, base[:, 0], np.where(there, sources, base).T, np.where(there, weights, np.float32(0)).T)
    return [torch.from_numpy(np.ascontiguousarray(array)).to(device) for array in arrays]


def _taken(pixels: Any, places: Any) -> Any:
    """Light [C, ways, n] at flat indices [ways, n] of pixels [C, .]."""
    return pixels.index_select(1, places.flatten()).reshape(len(pixels), *places.shape)


def _in_order(parts: Any) -> Any:
    """The sum [C, n] of parts [C, ways, n], one after the other."""
    total, *rest = parts.unbind(1)
    for part in rest:
        total = total + part
    return total


def _pixel_means(fine: Any, samples: int) -> Any:
    """Means [C, h, w] of samples x samples places each."""
    if samples == 1:
        return fine
    import torch

    parts = torch.stack([fine[:, m::samples, n::samples] for m in range(samples) for n in range(samples)], dim=1)
    first = parts[:, 0]
    return first + float(np.float32(1) / np.float32(samples * samples)) * _in_order(parts - first[:, None])
