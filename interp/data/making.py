"""`made`: the clip of a number, a function of settings, seed and number alone."""

from __future__ import annotations

import math

from interp.data.chance import chance, log_uniform, one_of, uniform
from interp.data.clip import Clip
from interp.data.settings import SOURCES, ClipSettings
from interp.data.shot import SAME, Beside
from interp.data.simulate import simulated


def made(settings: ClipSettings, seed: int, number: int) -> Clip:
    """The clip of a number, from 0.

    Raises UsageError, DataError for files of the settings that cannot be read.
    """
    draw = chance(seed, "clip", number)
    source = SOURCES[one_of(draw, settings.shares)]
    multiple = settings.multiples[int(draw.integers(len(settings.multiples)))]
    part = settings.motion[one_of(draw, [share for share, _, _ in settings.motion])]
    motion_px = uniform(draw, part[1:])
    gap_us = settings.bins * max(1, round(1000 * log_uniform(draw, settings.gap_ms) / settings.bins))
    beside = _beside(settings, draw.random() < settings.rigs, seed, number)
    if source == "recordings":
        from interp.data.recorded import recorded

        return recorded(settings, seed, number, multiple)
    if source == "videos":
        from interp.data.video_shots import VideoShot

        beside = Beside(coarser=beside.coarser)  # (how far the scene is, nobody knows)
        shot = VideoShot(settings, seed, number, beside, multiple)
        return simulated(shot, settings, seed, number, multiple, shot.gap_us, beside)
    if source == "scenes":
        from interp.data.scene_shots import SceneShot

        scene = SceneShot(settings, seed, number, beside, motion_px)
        return simulated(scene, settings, seed, number, multiple, gap_us, beside)
    from interp.data.layers import Layers

    layers = Layers(settings, seed, number, beside, motion_px)
    return simulated(layers, settings, seed, number, multiple, gap_us, beside)


def _beside(settings: ClipSettings, elsewhere: bool, seed: int, number: int) -> Beside:
    if not elsewhere:
        return SAME
    draw = chance(seed, "rig", number)
    distance_m, angle = 1e-3 * uniform(draw, settings.baseline_mm), draw.uniform(0, 2 * math.pi)
    coarser = settings.coarser[int(draw.integers(len(settings.coarser)))]
    return Beside(distance_m * math.cos(angle), distance_m * math.sin(angle), coarser)
