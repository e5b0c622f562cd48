"""Cross-fades: light(s) = light(0) + s (light(1) - light(0)), s the share of the interval gone by."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still
from vid2ev.upsample import Interval
from vid2ev.upsample.stillness import still_strips
from vid2ev.upsample.subframes import instants


class LinearUpsampling:
    """A fixed number of steps per interval, each pixel on its own."""

    def __init__(self, subframes: int):
        self.subframes = subframes

    def between(self, a: Frame, b: Frame) -> Interval:
        """The frames after a up to and including b."""
        return Interval(self._faded(a, b))

    def _faded(self, a: Frame, b: Frame) -> Iterator[Frame]:
        if self.subframes == 1:
            yield b
            return
        last, still = a.light, still_strips(a.light, b.light)
        for t_ns in instants(a.t_ns, b.t_ns, self.subframes):
            share = np.float32((t_ns - a.t_ns) / (b.t_ns - a.t_ns))
            with np.errstate(invalid="ignore"):  # (what is not finite is the sensor's to mend and to count)
                light = a.light + share * (b.light - a.light)
            yield Frame(light, t_ns, original=False, still=Still(last, still))
            last = light
        yield replace(b, still=Still(last, still))
