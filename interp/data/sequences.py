"""Samples of frames one after the other, for recurrent networks; of HDR light, clipped as a frame sensor clips it.

Each sequence is seen by a frame sensor of its own, drawn from the ranges in which the paper trains its HDR network
(section III.A.4): darkest I16 from 0 to 16000, slope from 15 to 60 I16 per code, noise from 0 to 5.2 codes of 10 bits.
"""

from __future__ import annotations

import numpy as np
import torch

from interp.data.chance import Range, uniform
from interp.data.clip import Clip
from interp.data.pool import Pool
from interp.data.samples import Drawn, SampleSettings
from interp.data.sensor_ranges import WHITE, frame_sensor
from interp.data.settings import ClipSettings
from interp.data.tensors import Sample, as_tensor
from vid2ev import Cis
from vid2ev.errors import UsageError

DARKEST: Range = (0.0, 16000.0)  # I16 of code 0
SLOPE: Range = (15.0, 60.0)  # I16 per code
NOISE_LSB: Range = (0.0, 5.2)


class Sequences(Drawn):
    """All K + 1 frames of a clip; `frames`, `off_on` and `contrast` as of `Samples`, but

    truth     [K + 1, C, h, w] float32: sRGB codes, or linear light, as the clips have it
    clipped   [K + 1, C, h, w] float32, only of linear light: the codes of a frame sensor, 0 ... 1, of even slope
    range     [2] float32, beside these: the light of codes 0 and 1

    Raises UsageError for clips of several lengths, too.
    """

    def __init__(self, pool: Pool, settings: SampleSettings, length: int, colours: int = 3):
        super().__init__(pool, settings, length, colours)
        check_lengths(pool.settings)

    def truth(self, clip: Clip, draw: np.random.Generator) -> Sample:
        """All frames, and what a frame sensor makes of them."""
        clips = clipped(clip.truth, draw) if clip.truth.dtype != np.uint8 else {}
        return {"truth": as_tensor(clip.truth)} | clips


def check_lengths(clips: ClipSettings) -> None:
    """Raise UsageError unless all clips are of one length."""
    if len(set(clips.multiples)) > 1:
        raise UsageError(f"sequences of clips with multiples {clips.multiples}: expected one, such as 32")


def clipped(light: np.ndarray, draw: np.random.Generator) -> Sample:
    """`clipped` and `range` of a sequence: linear light [N, H, W, 3 or 1] as a sensor of the paper's ranges sees it."""
    spec = frame_sensor(1000, 0.0, uniform(draw, DARKEST), uniform(draw, SLOPE), uniform(draw, NOISE_LSB))
    spec = spec.model_copy(update={"colour": light.shape[3] == 3})
    cis = Cis(spec, (light.shape[2], light.shape[1]), int(draw.integers(1 << 62)))
    frames = light.astype(np.float32) if spec.colour else light[..., 0].astype(np.float32)
    codes = [each.codes for k, frame in enumerate(frames) for each in cis.step(frame, 1_000_000 * k)]
    ends = np.array([spec.min_illuminance, spec.min_illuminance + spec.top * spec.slope]) / WHITE
    seen = np.moveaxis(np.reshape(codes, light.shape), -1, 1).astype(np.float32) / spec.top
    return {"clipped": torch.from_numpy(seen), "range": torch.from_numpy(ends.astype(np.float32))}
