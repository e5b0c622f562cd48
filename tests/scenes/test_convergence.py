"""Events of a rendered world converge as the square of the interval at which it is sampled."""

from __future__ import annotations

import cv2
import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.scenes.snapshot import Lamp, Shape, Snapshot, Surface, Texture, Thing

CAMERA = Intrinsics.of_field((48, 36), 60)


def picture(seed: int) -> Texture:
    rough = 0.2 + 0.6 * np.random.default_rng(seed).random((12, 12, 3)).astype(np.float32)
    return Texture(cv2.resize(rough, (96, 96), interpolation=cv2.INTER_CUBIC))


PICTURES = picture(1), picture(2)


def world(t: float) -> Snapshot:
    wall = Thing("wall", Shape("plane", (12, 9, 0)), Surface(PICTURES[0]), Pose.of((0, 0, 0), (0, 0, 6)))
    box = Thing("box", Shape("box"), Surface(PICTURES[1]), Pose.of((20, 25 + 10 * t, 10), (-0.4 + 0.4 * t, 0.1 * t, 4)))
    ball = Thing("ball", Shape("sphere"), Surface(specular=0.4), Pose.of((0, 0, 0), (0.9 - 0.3 * t, 0.4, 4)))
    return Snapshot([wall, box, ball], [Lamp("ambient", (0.5,) * 3), Lamp("sun", (0.5,) * 3, direction=(0.3, 0.4, 1))])
