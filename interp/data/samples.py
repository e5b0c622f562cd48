"""Samples: what networks are trained with, sample i a function of (settings, seed, i) alone."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field, model_validator
from torch.utils.data import Dataset

from interp.data import alter
from interp.data.chance import Range, chance, uniform, within
from interp.data.clip import Clip
from interp.data.pool import Pool
from interp.data.recorded import coarser_by
from interp.data.settings import ClipSettings
from interp.data.tensors import Sample, as_tensor, tensors
from vid2ev.errors import UsageError
from vid2ev.terminal import counted


class SampleSettings(BaseModel):
    """How samples are drawn from clips."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    size: int = Field(default=96, ge=16, description="width and height [px]")
    targets: int = Field(default=2, ge=1, le=31, description="instants to rebuild")
    backwards: float = Field(default=0.5, ge=0, le=1, description="share of samples in which time runs backwards")
    still: float = Field(default=0.35, ge=0, le=1, description="share with a part in which nothing happens")
    all_still: float = Field(default=0.03, ge=0, le=1, description="share in which nothing happens anywhere")
    compressed: float = Field(default=0.5, ge=0, le=1, description="share of the still parts that went through a JPEG")
    quality: tuple[Annotated[int, Field(ge=1, le=100)], Annotated[int, Field(ge=1, le=100)]] = Field(
        default=(40, 95), description="of that JPEG, from, to"
    )
    thinned: float = Field(default=0.15, ge=0, le=1, description="share that has lost events")
    lost: Annotated[Range, within(0, 1)] = Field(
        default=(0.0, 0.1), description="share of the events that these have lost"
    )
    threshold_error: Annotated[Range, within(0.01, 100)] = Field(
        default=(0.9, 1.1), description="thresholds that are believed, over those that are"
    )

    @model_validator(mode="after")
    def _fits(self) -> SampleSettings:
        if self.quality[0] > self.quality[1]:
            raise ValueError(f"quality {self.quality}: expected the lower one first")
        if self.still + self.all_still > 1:
            raise ValueError(f"still {self.still:g} and all_still {self.all_still:g}: expected 1 together at most")
        return self


class Drawn(Dataset[Sample]):
    """Samples 0 ... length - 1 of a pool, with frames of C colours, 3 or 1: then as a grey camera takes them.

    Drawing one may make a clip that is due for later (`pool`).  Raises UsageError for samples that do not fit into
    clips.
    """

    def __init__(self, pool: Pool, settings: SampleSettings, length: int, colours: int = 3):
        check_fits(pool.settings, settings.size)
        self.pool, self.settings, self._length, self.colours = pool, settings, length, colours

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, index: int) -> Sample:
        if not 0 <= index < self._length:
            raise IndexError(index)
        self.pool.step(index)
        clip, draw = drawn_clip(self.pool, self.settings, index)
        clip = clip if self.colours == 3 else alter.grey(clip)
        sample = tensors(clip, self.pool.settings) | self.truth(clip, draw)
        # (networks add up in the order of memory, which that of processes is, too, and so does not depend on them)
        return {name: each.contiguous() for name, each in sample.items()}

    def truth(self, clip: Clip, draw: np.random.Generator) -> Sample:
        """What else a sample has of its clip."""
        raise NotImplementedError


class Samples(Drawn):
    """Samples for frame-fed networks.

    frames     [2, C, h, w] float32, the two key frames: sRGB codes, 0 ... 1
    off_on     [2, S, h, w] float16: OFF and ON events of S sub-intervals, with what dead time hid, in the geometry of
               the frames
    footprint  int64, pixels across of the frames that a pixel of the event camera looks at
    contrast   [2] float32, what an OFF and an ON event are believed to stand for [nat]
    times      [N] float32, instants from 0 to 1, both left out, in order
    truth      [N, C, h, w] float32: what was there: sRGB codes, or linear light, as the clips have it
    """

    def __init__(self, pool: Pool, settings: SampleSettings, length: int, colours: int = 3):
        super().__init__(pool, settings, length, colours)
        check_targets(pool.settings, settings.targets)

    def truth(self, clip: Clip, draw: np.random.Generator) -> Sample:
        """Instants, and what was there."""
        chosen = np.sort(1 + draw.permutation(clip.multiple - 1)[: self.settings.targets])
        times = torch.from_numpy((chosen / clip.multiple).astype(np.float32))
        return {"times": times, "truth": as_tensor(clip.truth[chosen])}


def check_fits(clips: ClipSettings, side: int) -> None:
    """Raise UsageError unless squares of so many pixels fit into clips, also in pixels of coarser event cameras."""
    if side > min(clips.size):
        raise UsageError(
            f"samples of {side} pixels from clips of {clips.size[0]}x{clips.size[1]}: expected smaller ones"
        )
    coarser = (*(clips.coarser if clips.rigs > 0 else ()), *(coarser_by(clips) if clips.recordings > 0 else ()))
    if any(side % each for each in coarser):
        raise UsageError(
            f"samples of {side} pixels with event cameras coarser by {', '.join(map(str, coarser))}: expected a"
            f" multiple of {math.lcm(*coarser)}; give --set samples.size=N"
        )


def check_targets(clips: ClipSettings, targets: int) -> None:
    """Raise UsageError unless there are so many frames between the key frames of all clips."""
    if targets >= min(clips.multiples):
        raise UsageError(
            f"{counted(targets, 'target')} of clips with {counted(min(clips.multiples) - 1, 'frame')} in between:"
            " expected no more; give --set samples.targets=N"
        )


def drawn_clip(pool: Pool, settings: SampleSettings, index: int) -> tuple[Clip, np.random.Generator]:
    """The clip of a sample, cut and altered, and the generator for what else is drawn."""
    draw, window = chance(pool.seed, "sample", index), pool.window(index)
    clip = pool.clip(int(draw.integers(window.start, window.stop)))
    height, width = clip.truth.shape[1:3]
    left, top = (
        clip.coarser * int(draw.integers((side - settings.size) // clip.coarser + 1)) for side in (width, height)
    )
    return altered(alter.cropped(clip, left, top, (settings.size, settings.size)), settings, draw), draw


def altered(clip: Clip, settings: SampleSettings, draw: np.random.Generator) -> Clip:
    """A square clip altered by chance."""
    if draw.random() < 0.5:
        clip = alter.mirrored(clip)
    clip = alter.turned(clip, int(draw.integers(4)))
    if draw.random() < settings.backwards:
        clip = alter.backwards(clip)
    if (u := draw.random()) < settings.still + settings.all_still:
        still = _region(draw, clip.truth.shape[1]) if u < settings.still else np.ones(clip.truth.shape[1:3], bool)
        compressed = draw.random() < settings.compressed
        quality = int(draw.integers(settings.quality[0], settings.quality[1] + 1))
        clip = alter.stilled(clip, still, quality if compressed else None)
    if draw.random() < settings.thinned:
        clip = alter.thinned(clip, draw, uniform(draw, settings.lost))
    return alter.misjudged(clip, draw, settings.threshold_error)


def _region(draw: np.random.Generator, side: int) -> np.ndarray:
    """A part of a square: what is on one side of a line, a round part, or all but that."""
    y, x = np.indices((side, side)) / side - 0.5
    if draw.random() < 0.5:
        angle = draw.uniform(0, 2 * np.pi)
        return x * np.cos(angle) + y * np.sin(angle) > draw.uniform(-0.4, 0.4)
    centre, radius = draw.uniform(-0.4, 0.4, 2), draw.uniform(0.15, 0.5)
    inside = np.hypot(x - centre[0], y - centre[1]) < radius
    return inside if draw.random() < 0.5 else ~inside
