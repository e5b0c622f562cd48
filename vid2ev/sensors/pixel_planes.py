"""State of pixels as the walk on a GPU has it, pixel by pixel, from the planes of the walk on a CPU, and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vid2ev.kernels.layout import BLOCK, HIGH, LOW, PITCH, Flags, Numbers, Planes, stride_of
from vid2ev.sensors.compiled import RECORDS, UNUSED, bad_of, draw_thresholds, kept_of, shade_of
from vid2ev.sensors.spec import DvsSpec


def pixel_planes(planes: Planes, flags: Flags, pixels: int) -> Planes:
    """The planes of a sensor of so many pixels."""
    count = int(stride_of(flags)) // PITCH
    rest = by_pixel(planes.rest, pixels, 2) if planes.rest.size else planes.rest
    parts = {name: np.ascontiguousarray(getattr(planes, name)) for name in RECORDS}
    parts |= {"fast": by_pixel(planes.fast, pixels, count).reshape(-1), "rest": rest.reshape(-1)}
    return planes._replace(hot=planes.hot.astype(np.int64), **parts)


def uploaded(memory: Any, planes: Planes) -> Planes:
    """The same planes on a device, where none is empty."""
    return Planes(*(memory.put(plane if plane.size else np.zeros(1, plane.dtype)) for plane in planes))


def blank_planes(
    memory: Any, specs: Sequence[DvsSpec], flags: Flags, numbers: Sequence[Numbers], size: tuple[int, int]
) -> tuple[Planes, np.ndarray]:
    """The planes on a device of sensors of one size and the same effects, one after the other, yet without light, and
    their maps of bad pixels [uint8].  A plane has room for all, if any sensor uses its own, or else for a few."""
    pixels, used = size[0] * size[1], [kept_of(flags, num) for num in numbers]
    total, thetas = len(specs) * pixels, np.zeros((len(specs), pixels, 2), np.float32)
    for theta, spec, num in zip(thetas, specs, numbers, strict=True):
        draw_thresholds(theta, spec, num)
    room = {name: total if any(each[name] for each in used) else UNUSED for name in RECORDS}
    records = {name: memory.zeros((room[name], *shape), kind) for name, (kind, shape) in RECORDS.items()}
    records["theta"] = memory.put(thetas.reshape(-1, 2)[: room["theta"]])
    bad = np.concatenate([bad_of(spec, num, pixels) for spec, num in zip(specs, numbers, strict=True)])
    shades = [shade_of(spec, *size) for spec in specs]
    shaded = any(spec.shading for spec in specs)
    planes = Planes(
        fast=memory.zeros(total * (int(stride_of(flags)) // PITCH), np.float32),
        rest=memory.zeros(2 * total if flags.poles and not flags.log_input else 1, np.float32),
        hot=memory.zeros(1, np.int64),  # (what they send is proposed apart: `proposed`)
        shade=memory.put(np.concatenate([np.broadcast_to(each, pixels) for each in shades]) if shaded else shades[0]),
        **records,
    )
    return planes, bad


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
