"""State of pixels as the walk on a GPU has it, pixel by pixel, from the planes of the walk on a CPU, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vid2ev.kernels.layout import BLOCK, HIGH, LOW, PITCH, Flags, Planes, stride_of


def pixel_planes(each: Sequence[Planes], flags: Flags, pixels: int) -> Planes:
    """The planes of some sensors of so many pixels and the same effects, one after the other."""
    count = int(stride_of(flags)) // PITCH
    parts: dict[str, list[np.ndarray]] = {name: [] for name in Planes._fields}
    for k, planes in enumerate(each):
        parts["fast"].append(by_pixel(planes.fast, pixels, count).reshape(-1))
        parts["rest"].append(by_pixel(planes.rest, pixels, 2).reshape(-1) if planes.rest.size else planes.rest)
        parts["hot"].append(k * pixels + planes.hot.astype(np.int64))
    for name in ("memory", "theta", "drawn", "t_last", "count", "t_reset", "shade"):
        parts[name] = _alike([np.ascontiguousarray(getattr(planes, name)) for planes in each], pixels)
    return Planes(**{name: np.concatenate(part) for name, part in parts.items()})


def _alike(planes: list[np.ndarray], pixels: int) -> list[np.ndarray]:
    """One plane of some sensors: with room for each pixel of all, if any of them uses its own, or else for a few."""
    if not any(len(plane) == pixels for plane in planes):
        return planes[:1]
    return [plane if len(plane) == pixels else np.repeat(plane[:1], pixels, axis=0) for plane in planes]


def by_pixel(plane: np.ndarray, pixels: int, count: int) -> np.ndarray:
    """[pixels, count] of a plane [blocks x count x PITCH]."""
    return np.ascontiguousarray(plane.reshape(-1, count, PITCH)[:, :, :BLOCK].transpose(0, 2, 1)).reshape(-1, count)[
        :pixels
    ]


def by_block(values: np.ndarray, count: int) -> np.ndarray:
    """[blocks x count x PITCH] of values [pixels, count], zeros beyond."""
    blocks = -(-len(values) // BLOCK)
    padded = np.zeros((blocks * BLOCK, count), values.dtype)
    padded[: len(values)] = values
    plane = np.zeros((blocks, count, PITCH), values.dtype)
    plane[:, :, :BLOCK] = padded.reshape(blocks, BLOCK, count).transpose(0, 2, 1)
    return plane.reshape(-1)


def fast_by_block(values: np.ndarray, count: int) -> np.ndarray:
    """`by_block` of `fast`: beyond the last pixel are no levels."""
    plane = by_block(values, count)
    last = plane.reshape(-1, count, PITCH)[-1]
    beyond = len(values) - (len(plane) // (count * PITCH) - 1) * BLOCK
    last[HIGH, beyond:BLOCK], last[LOW, beyond:BLOCK] = np.inf, -np.inf
    return plane
