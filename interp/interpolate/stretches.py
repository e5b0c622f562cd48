"""A take cut at its key frames: what is between two of them, and whether anything may be made there.

Nothing is interpolated across a cut, where two frames show different things (`vid2ev.upsample.cuts`).  Where pictures
are unrelated one after the other, as in noise or under a strobe, there is no motion that could be estimated, but events
still tell what came between.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from interp.interpolate.instants import Grid, Instant
from interp.interpolate.take import Key, Take
from interp.light import luminance, to_light
from vid2ev import Frame
from vid2ev.upsample.cuts import CutDetector

THRESHOLD_NATS = 0.15  # of log light, by half of which pictures must differ for a cut
CUT, UNRELATED = "a cut", "pictures that have nothing in common"


@dataclass(frozen=True, slots=True)
class Stretch:
    """A key frame and what comes after it, before the next.

    second     the next key frame; None after the last one
    instants   of the frames to make, the key frame's own included
    between    what lies between both, if that is not just time: `CUT` or `UNRELATED`, or nothing
    """

    first: Key
    second: Key | None
    instants: list[Instant]
    between: str = ""


def stretches(take: Take, grid: Grid, zero_us: int | None, start: int = 0, look: bool = True) -> Iterator[Stretch]:
    """The stretches of a take from number `start` on.

    zero_us   the time of its first key frame, if that is known
    look      whether to look for cuts
    """
    cuts, before = CutDetector(THRESHOLD_NATS), None
    begin = max(start - 1, 0)  # (whether there is a cut depends on the pair of frames before, too)
    for number, key in enumerate(take.keys(begin), begin):
        zero_us = key.t_us if zero_us is None else zero_us
        frame = _light(key)
        if before is not None:
            earlier, its_frame = before
            cut = look and cuts.begins_shot(its_frame, frame)
            if number > start:
                instants = grid.between(number - 1, earlier.t_us, key.t_us, zero_us)
                kind = CUT if cut else UNRELATED if cuts.unrelated else ""
                yield Stretch(earlier, key, instants, kind)
        before = key, frame
    if before is not None and before[0].known and zero_us is not None and number >= start:
        yield Stretch(before[0], None, grid.at(number, before[0].t_us, zero_us))


def _light(key: Key) -> Frame:
    """Its luminance, for the search for cuts."""
    codes = torch.from_numpy(np.ascontiguousarray(np.moveaxis(key.codes, -1, 0)))
    return Frame(luminance(to_light(codes, "srgb"))[0].numpy(), 1000 * key.t_us)
