"""What a pixel has in it: the state that no camera shows."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vid2ev.kernels.layout import BLOCK, BLOCK_BITS, INPUT, LAG1, PITCH, Flags, Numbers, Planes, stride_of
from vid2ev.kernels.steep import STEEP
from vid2ev.physics.log_curve import log_level


class Inside(NamedTuple):
    """The state of N pixels at one instant, float64 [N] each, in nats.

    filtered   what the photoreceptor makes of the light, after the logarithm
    signal     the same with leak and photoreceptor noise: what the comparator sees
    level_on   the next ON event comes when the signal rises to this
    level_off  the next OFF event comes when it falls to this
    """

    filtered: np.ndarray
    signal: np.ndarray
    level_on: np.ndarray
    level_off: np.ndarray


def inside_of(pixels: np.ndarray, planes: Planes, flags: Flags, num: Numbers, leak: float) -> Inside:
    """The state of pixels [int, y * width + x] where the leak has risen by `leak` [nat] since its reference."""
    poles = len(flags.poles)
    place = (pixels >> BLOCK_BITS) * stride_of(flags) + (pixels & (BLOCK - 1))

    def plane(number: int) -> np.ndarray:
        return planes.fast[place + number * PITCH].astype(np.float64)

    filtered = plane(INPUT)
    if poles:
        filtered -= plane(LAG1 + poles - 1) + rest_of(pixels, filtered, plane, planes, flags, num)
    if not flags.log_input:
        filtered = np.array([log_level(max(light, 0.0), num.curve) for light in filtered])
    noise = plane(LAG1 + poles + 1) if flags.noise else 0.0
    on, off = thresholds_of(pixels, planes, flags, num)
    memory = planes.memory[pixels]
    return Inside(filtered, filtered + leak + noise, memory + on, memory - off)


def rest_of(
    pixels: np.ndarray, light: np.ndarray, plane: Any, planes: Planes, flags: Flags, num: Numbers
) -> np.ndarray | float:
    """What the last lag of pixels has beyond float32, which is kept apart where it counts (`scan.refine`)."""
    if not planes.rest.size:
        return 0.0
    poles = len(flags.poles)
    last = plane(LAG1 + poles - 1)
    steep = np.maximum(np.abs(plane(LAG1)), np.abs(last)) > STEEP * ((light - last) + num.curve.floor)
    place = (pixels >> BLOCK_BITS) * (2 * PITCH) + (pixels & (BLOCK - 1)) + (poles - 1) * PITCH
    return np.where(steep, planes.rest[place], 0.0)


def thresholds_of(pixels: np.ndarray, planes: Planes, flags: Flags, num: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """The ON and OFF thresholds [nat] of the crossing to come."""
    if flags.crossing_noise or num.mismatch > 0:
        theta = (planes.drawn if flags.crossing_noise else planes.theta)[pixels].astype(np.float64)
        return theta[:, 0], theta[:, 1]
    return np.full(len(pixels), num.threshold_on), np.full(len(pixels), num.threshold_off)


def maps_of(planes: Planes, num: Numbers, bad: np.ndarray, size: tuple[int, int]) -> dict[str, Any]:
    """What is frozen in a sensor, each [height, width]: threshold_on, threshold_off [nat, float32]; hot, cold [bool];
    shading [optical gain, float32]."""
    width, height = size
    means = np.array([num.threshold_on, num.threshold_off], np.float32)
    theta = planes.theta if num.mismatch > 0 else np.broadcast_to(means, (width * height, 2))
    shading = np.broadcast_to(planes.shade, width * height)
    found = {"threshold_on": theta[:, 0], "threshold_off": theta[:, 1], "hot": bad == 1, "cold": bad == 2}
    return {name: plane.reshape(height, width).copy() for name, plane in (found | {"shading": shading}).items()}
