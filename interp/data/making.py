"""`made`: the clip of a number, a function of settings, seed and number alone."""

from __future__ import annotations

import math
from typing import NamedTuple

from interp.data.cameras import Cameras, cameras_of
from interp.data.chance import chance, log_uniform, one_of, uniform
from interp.data.clip import Clip
from interp.data.settings import SOURCES, ClipSettings
from interp.data.shot import SAME, Beside, Shot
from interp.data.simulate import simulated


class Wanted(NamedTuple):
    """What a number stands for: where its light is from, K, motion and time from key frame to key frame, and where the
    event camera stands."""

    source: str
    multiple: int
    motion_px: float
    gap_us: int
    beside: Beside


def made(settings: ClipSettings, seed: int, number: int) -> Clip:
    """The clip of a number, from 0.

    Raises UsageError, DataError for files of the settings that cannot be read.
    """
    want = wanted(settings, seed, number)
    if want.source == "recordings":
        from interp.data.recorded import recorded

        return recorded(settings, seed, number, want.multiple)
    return simulated(*looked_at(want, settings, seed, number), settings)


def wanted(settings: ClipSettings, seed: int, number: int) -> Wanted:
    """What a number stands for."""
    draw = chance(seed, "clip", number)
    source = SOURCES[one_of(draw, settings.shares)]
    multiple = settings.multiples[int(draw.integers(len(settings.multiples)))]
    part = settings.motion[one_of(draw, [share for share, _, _ in settings.motion])]
    motion_px = uniform(draw, part[1:])
    gap_us = settings.bins * max(1, round(1000 * log_uniform(draw, settings.gap_ms) / settings.bins))
    beside = _beside(settings, draw.random() < settings.rigs, seed, number)
    if source == "videos":
        beside = Beside(coarser=beside.coarser)  # (how far the scene is, nobody knows)
    return Wanted(source, multiple, motion_px, gap_us, beside)


def looked_at(want: Wanted, settings: ClipSettings, seed: int, number: int) -> tuple[Shot, Cameras]:
    """The shot that a number stands for, and the cameras that look at it; not of recordings."""
    shot, gap_us = _shot_of(want, settings, seed, number), want.gap_us
    if want.source == "videos":
        gap_us = shot.gap_us  # type: ignore[attr-defined]
    return shot, cameras_of(shot, settings, seed, number, want.multiple, gap_us, want.beside)


def _shot_of(want: Wanted, settings: ClipSettings, seed: int, number: int) -> Shot:
    if want.source == "videos":
        from interp.data.video_shots import VideoShot

        return VideoShot(settings, seed, number, want.beside, want.multiple)
    if want.source == "scenes":
        from interp.data.scene_shots import SceneShot

        return SceneShot(settings, seed, number, want.beside, want.motion_px)
    from interp.data.layers import Layers

    return Layers(settings, seed, number, want.beside, want.motion_px)


def _beside(settings: ClipSettings, elsewhere: bool, seed: int, number: int) -> Beside:
    if not elsewhere:
        return SAME
    draw = chance(seed, "rig", number)
    distance_m, angle = 1e-3 * uniform(draw, settings.baseline_mm), draw.uniform(0, 2 * math.pi)
    coarser = settings.coarser[int(draw.integers(len(settings.coarser)))]
    return Beside(distance_m * math.cos(angle), distance_m * math.sin(angle), coarser)
