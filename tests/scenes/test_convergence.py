"""Events of a rendered world converge as the square of the interval at which it is sampled."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from vid2ev import Dvs, load_sensor
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Lamp, Shape, Snapshot, Surface, Texture, Thing

CAMERA = Intrinsics.of_field((32, 24), 60)
PIXELS = 32 * 24
FRAMES = 256  # in the second that is looked at


def picture(seed: int) -> Texture:
    rough = 0.2 + 0.6 * np.random.default_rng(seed).random((12, 12, 3)).astype(np.float32)
    return Texture(cv2.resize(rough, (96, 96), interpolation=cv2.INTER_CUBIC))


PICTURES = picture(1), picture(2)


def world(t: float) -> Snapshot:
    """A wall, a spinning box, a shining ball."""
    wall = Thing("wall", Shape("plane", (12, 9, 0)), Surface(PICTURES[0]), Pose.of((0, 0, 0), (0, 0, 6)))
    box = Thing("box", Shape("box"), Surface(PICTURES[1]), Pose.of((20, 25 + 10 * t, 10), (-0.4 + 0.4 * t, 0.1 * t, 4)))
    ball = Thing("ball", Shape("sphere"), Surface(specular=0.4), Pose.of((0, 0, 0), (0.9 - 0.3 * t, 0.4, 4)))
    return Snapshot([wall, box, ball], [Lamp("ambient", (0.5,) * 3), Lamp("sun", (0.5,) * 3, direction=(0.3, 0.4, 1))])


def events_of(frames: np.ndarray, step: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Times [us] and polarities of each pixel's events, from every `step`th frame."""
    dvs = Dvs(load_sensor("ideal", ["threshold_on=0.1", "threshold_off=0.1"]), size=CAMERA.size)
    parts = [dvs.step(frames[k], t_ns=k * 1_000_000_000 // FRAMES) for k in range(0, FRAMES + 1, step)]
    pixel = np.concatenate([part.y.astype(np.int64) * CAMERA.size[0] + part.x for part in parts])
    t, p = (np.concatenate([getattr(part, name) for part in parts]) for name in "tp")
    order = np.lexsort((t, pixel))
    cuts = np.searchsorted(pixel[order], np.arange(PIXELS + 1))
    return [(t[order][a:b], p[order][a:b]) for a, b in pairwise(cuts)]


def test_halving_the_interval_quarters_the_error_of_event_times():
    frames = [render(world(k / FRAMES), CAMERA, IDENTITY, threads=1).light.mean(axis=-1) for k in range(FRAMES + 1)]
    fine, typical = events_of(np.array(frames), 1), []
    for step in (32, 16, 8):
        errors, same = [], 0
        for (t, p), (true_t, true_p) in zip(events_of(np.array(frames), step), fine, strict=True):
            if np.array_equal(p, true_p):
                errors.append(np.abs(t - true_t))
                same += 1
        assert same > 0.95 * PIXELS
        # (light that only touches a threshold has its event at any time: the largest hundredth says nothing)
        all_errors = np.sort(np.concatenate(errors))
        typical.append(all_errors[: int(0.99 * len(all_errors))].mean())
    assert typical[0] / typical[1] > 3 and typical[1] / typical[2] > 3
