"""The part of a scene that the options of a conversion leave: from when to when, how fast, through which lens."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from vid2ev.errors import UsageError
from vid2ev.gui.setup import Setup
from vid2ev.rig.intrinsics import Framing, Intrinsics
from vid2ev.scenes.instants import rate_of
from vid2ev.scenes.source import SceneSource
from vid2ev.scenes.world import World
from vid2ev.sources import Source
from vid2ev.sources.cut import Slowed, slowdown_of
from vid2ev.sources.framing import Framed, framing_for
from vid2ev.stream.frames import Colour
from vid2ev.upsample import make_upsampler


class ScenePart(NamedTuple):
    """What is left of a scene.

    begin_s, end_s  on the scene's own clock
    slower          by which its times are divided on the clock of the recording
    fps             pictures a second of the scene's clock, None where motion says how many
    framing         of the reference camera's pictures, None where they are whole
    """

    begin_s: float
    end_s: float
    slower: float = 1.0
    fps: float | None = None
    framing: Framing | None = None

    @property
    def duration_s(self) -> float:
        """On the clock of the recording."""
        return (self.end_s - self.begin_s) / self.slower

    def scene_s(self, since_s: float) -> float:
        """The scene's clock, so long after the recording begins."""
        return min(self.begin_s + self.slower * since_s, self.end_s)

    def has(self, t_s: float) -> bool:
        """Whether an instant of the scene's clock is in it."""
        return self.begin_s - 1e-9 <= t_s <= self.end_s + 1e-9

    def lens(self, whole: Intrinsics) -> Intrinsics:
        """The lens through which what is left of the reference camera's pictures is seen."""
        return self.framing.lens_of_part(whole) if self.framing else whole

    def source(self, world: World, fps: float, colour: Colour, size: tuple[int, int]) -> Source:
        """A world as the source of this part, whose pictures have this size where they are framed."""
        source: Source = SceneSource(world, "scene", fps=fps, colour=colour)
        if self.slower != 1.0:
            source = Slowed(source, self.slower)
        return Framed(source, None, f"{size[0]}x{size[1]}!") if self.framing else source


def scene_part(setup: Setup) -> ScenePart:
    """The part of a setup's scene.  Raises UsageError for options that a scene cannot have."""
    options, scene = setup.options, setup.settled()
    if "motion" in options:
        raise UsageError(f"motion '{options['motion']}' is for a photograph; leave it out of a scene")
    if "upsample" in options:
        _check_upsampling(options["upsample"])
    begin_s, end_s = _span_s(options, scene.scene.duration_s)
    fps = float(rate_of(options["fps"])) if "fps" in options else None
    if fps is not None and math.ceil(begin_s * fps - 1e-9) > end_s * fps + 1e-9:
        raise UsageError(f"fps {fps:g}: no picture of the scene from {begin_s:g} s to {end_s:g} s; give more")
    framing = None
    if "crop" in options or "size" in options:
        framing = framing_for(scene.camera.size, options.get("crop"), options.get("size"))
    return ScenePart(begin_s, end_s, float(slowdown_of(options.get("slowdown", 1.0))), fps, framing)


@lru_cache(maxsize=4)
def _check_upsampling(method: str) -> None:
    """Raise UsageError for what is none: a conversion refuses it though a scene needs none."""
    make_upsampler(method)


def _span_s(options: Mapping[str, Any], whole_s: float) -> tuple[float, float]:
    begin_s, end_s = max(options.get("start", 0.0), 0.0), min(options.get("stop", whole_s), whole_s)
    if begin_s > end_s:
        named = ", ".join(f"{name} {options[name]:g} s" for name in ("start", "stop") if name in options)
        raise UsageError(f"{named}: nothing is left of the scene, which goes from 0 s to {whole_s:g} s")
    return begin_s, end_s
