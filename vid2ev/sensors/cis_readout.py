"""From a specification of a frame camera to what its readout works on: numbers, and what is frozen in its pixels."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vid2ev.kernels.exposures import ReadOut
from vid2ev.physics.fixed_pattern import fixed_pattern
from vid2ev.physics.shading import shading_map
from vid2ev.sensors.cis_spec import CisSpec

OF_ELECTRONS = {"fixed_pattern", "shot_noise", "full_well", "read_noise"}
RANDOM = {"shot_noise", "read_noise", "noise"}


class Frozen(NamedTuple):
    """Planes of rows, float32 [H, n]; empty where they change nothing."""

    shade: np.ndarray  # optical gain
    gain: np.ndarray  # relative sensitivity
    dark: np.ndarray  # dark signal [electrons]

    def rows(self, first: int, last: int) -> Frozen:
        """The rows first ... last - 1."""
        return Frozen(*(plane[first:last] for plane in self))

    def padded(self) -> Frozen:
        """The planes; in the place of empty ones [1, 1] of what changes nothing."""
        return Frozen(*(plane if plane.size else neutral for plane, neutral in zip(self, NEUTRAL, strict=True)))


NEUTRAL = Frozen(*(np.full((1, 1), value, np.float32) for value in (1.0, 1.0, 0.0)))


def numbers_of(spec: CisSpec, seed: int, camera: int) -> ReadOut:
    """What readout needs of a specification."""
    effects = set(spec.effects())
    return ReadOut(
        seed=np.uint64(seed),
        camera=camera,
        exposure_gain=spec.exposure_gain,
        random=bool(RANDOM & effects),
        electrons=bool(OF_ELECTRONS & effects),
        white_e=spec.white_e,
        shot_noise=spec.shot_noise,
        full_well_e=spec.full_well_e or math.inf,
        read_noise_e=spec.read_noise_e,
        least=spec.min_illuminance,
        slope=spec.slope,
        top=float(spec.top),
        noise_lsb=spec.noise_lsb,
    )


def frozen_of(spec: CisSpec, numbers: ReadOut, size: tuple[int, int]) -> Frozen:
    """What is frozen in a camera of `size` (width, height)."""
    (width, height), channels = size, 3 if spec.colour else 1
    shade = gain = dark = np.empty((0, 0), np.float32)
    if spec.shading:
        shade = np.repeat(shading_map(spec.shading, width, height), channels, axis=1)
    if spec.prnu > 0 or spec.dsnu > 0:
        planes = fixed_pattern(height * width * channels, numbers.seed, numbers.camera, spec.prnu, spec.dsnu)
        gain, dark = (plane.reshape(height, -1) for plane in planes)
    return Frozen(shade, gain, dark)
