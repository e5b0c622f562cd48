"""Cameras and textures with known answers, for the tests of views."""

from __future__ import annotations

import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose


def psnr(found: np.ndarray, truth: np.ndarray, where: np.ndarray | None = None) -> float:
    """Against a peak of 1 [dB]."""
    squares = (np.asarray(found, np.float64) - truth) ** 2
    return float(-10 * np.log10(squares.mean() if where is None else squares[where].mean()))


class Texture:
    """Light as a function of place: sines with frequencies up to a limit [cycles per unit], 0.5 on average."""

    def __init__(self, limit: float, seed: int = 0, waves: int = 60):
        random = np.random.default_rng(seed)
        frequency, direction = limit * np.sqrt(random.random(waves)), random.uniform(0, 2 * np.pi, waves)
        self.fx, self.fy = frequency * np.cos(direction), frequency * np.sin(direction)
        self.phase, self.height = random.uniform(0, 2 * np.pi, waves), 0.12 * np.sqrt(2 / waves)

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        light = np.full(np.broadcast(x, y).shape, 0.5)
        for fx, fy, phase in zip(self.fx, self.fy, self.phase, strict=True):
            light += self.height * np.sin(2 * np.pi * (fx * x + fy * y) + phase)
        return light


def pinhole(size: tuple[int, int] = (160, 120), focal: float = 150.0) -> Intrinsics:
    """A camera whose centre is in the middle of its picture."""
    return Intrinsics(size=size, focal_px=(focal, focal), centre_px=((size[0] - 1) / 2, (size[1] - 1) / 2))


def homography(source: Intrinsics, camera: Intrinsics, pose: Pose, plane_m: float) -> np.ndarray:
    """H = K_source (I + t e_z' / (Z - t_z)) R K_camera^-1 [3, 3]: from pixels of a camera to those of the source."""
    shear = np.eye(3) + np.outer(pose.translation_m, (0, 0, 1)) / (plane_m - pose.translation_m[2])
    return source.matrix @ shear @ pose.rotation @ np.linalg.inv(camera.matrix)
