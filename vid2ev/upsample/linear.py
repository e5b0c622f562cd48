"""Cross-fades: light(s) = light(0) + s (light(1) - light(0)), s the share of the interval gone by."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still
from vid2ev.stream.upload import Upload
from vid2ev.upsample import Interval
from vid2ev.upsample.mended import mended, mended_tensor
from vid2ev.upsample.stillness import still_strips
from vid2ev.upsample.subframes import instants


class LinearUpsampling:
    """A fixed number of steps per interval, each pixel on its own; on a device, if there is an `upload` to it."""

    def __init__(self, subframes: int, upload: Upload | None = None):
        self.subframes, self._upload = subframes, upload

    def between(self, a: Frame, b: Frame) -> Interval:
        """The frames after a up to and including b."""
        if self.subframes == 1:
            return Interval(iter([b]))
        return Interval(self._faded_there(a, b, self._upload) if self._upload else self._faded(a, b))

    def _faded(self, a: Frame, b: Frame) -> Iterator[Frame]:
        last, still = a.light, still_strips(a.light, b.light)
        before, after = mended(a.light), mended(b.light)
        for t_ns, share in self._shares(a, b):
            light = before + np.float32(share) * (after - before)
            yield Frame(light, t_ns, original=False, still=Still(last, still))
            last = light
        yield replace(b, still=Still(last, still))

    def _faded_there(self, a: Frame, b: Frame, upload: Upload) -> Iterator[Frame]:
        before, after = (mended_tensor(upload.light(frame.light)) for frame in (a, b))
        for t_ns, share in self._shares(a, b):
            yield Frame(before + share * (after - before), t_ns, original=False)
        yield upload.frame(b)

    def _shares(self, a: Frame, b: Frame) -> Iterator[tuple[int, float]]:
        """The instants in between [ns], and the share of the interval gone by at each."""
        for t_ns in instants(a.t_ns, b.t_ns, self.subframes):
            yield t_ns, (t_ns - a.t_ns) / (b.t_ns - a.t_ns)
