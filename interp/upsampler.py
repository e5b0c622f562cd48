"""`vid2ev convert --upsample net`: light between frames by a network of frames alone.

How many steps an interval takes is decided as for optical flow, by its motion; where nothing moves there are none.
Codes of the network are sRGB, and light above white goes on, as far as the network lets it.  Large frames are made in
tiles, as `vid2ev interpolate` makes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from interp import pretrained
from interp.light import to_codes, to_light
from interp.methods.gap import Gap
from interp.methods.of_networks import OfFrames, of_weights
from interp.methods.tiling import tiling_for
from vid2ev import Frame
from vid2ev.errors import UsageError
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS
from vid2ev.recording.manifest import sha256
from vid2ev.stream.upload import Upload
from vid2ev.upsample import Interval, Subframes, make_upsampler
from vid2ev.upsample.subframes import instants, steps_for


class NetUpsampling:
    """Frames in between by a network; see `vid2ev.upsample.Upsampler`.

    weights        of a network of frames alone
    subframes      steps per interval, or "auto"
    max_subframes  the most that "auto" takes
    threshold      contrast threshold [nat]: motion is measured where log light changes by half of it or more
    upload         to the device on which the network runs, and its frames stay; motion is estimated on the CPU
    Raises UsageError for a network that needs events, DataError for a file that holds none of frames.
    """

    def __init__(
        self, weights: Path, subframes: Subframes, max_subframes: int, threshold: float, upload: Upload | None = None
    ):
        self._stays, self._upload = upload is not None, upload or Upload("cpu")
        method = of_weights(weights, self._upload.device)
        if not isinstance(method, OfFrames) or method.needs_events:
            raise UsageError(f"upsampling 'net:{weights}': the network needs events; give one of frames alone")
        self._method = method
        self.subframes, self.max_subframes = subframes, max_subframes
        self._motion = make_upsampler("flow", subframes, max_subframes, threshold)
        self.about = {"weights": weights.name, "sha256": sha256(weights)}

    def between(self, a: Frame, b: Frame) -> Interval:
        """The frames after a up to and including b."""
        found = self._motion.between(a, b)
        shift_px = found.shift_px or 0.0
        if self.subframes == "auto":
            steps = min(steps_for(shift_px, (b.t_ns - a.t_ns) * 1e-9), self.max_subframes)
        else:
            steps = self.subframes
        times_ns = instants(a.t_ns, b.t_ns, steps)
        if not times_ns:
            return Interval(iter([b]), found.limited, found.shift_px)
        return Interval(self._made(a, b, times_ns), found.limited, found.shift_px)

    def _made(self, a: Frame, b: Frame, times_ns: list[int]) -> Iterator[Frame]:
        shares = self._upload.tensor(np.array([(t_ns - a.t_ns) / (b.t_ns - a.t_ns) for t_ns in times_ns], np.float32))
        first, last = (self._upload.light(frame.light) for frame in (a, b))
        gap = Gap(_codes(first), _codes(last), None)
        made = self._method.images(gap, shares, tiling_for(self._method, gap))
        endless = first.isposinf() & last.isposinf()  # (of which a sensor sees the greatest light there is)
        for t_ns, image in zip(times_ns, (image for images in made for image in images), strict=True):
            light: Any = _light(image, a.light.ndim).masked_fill(endless, torch.inf)
            yield Frame(light if self._stays else light.numpy(), t_ns, original=False)
        yield self._upload.frame(b) if self._stays else b


def make(
    weights: str | None, subframes: Subframes, max_subframes: int, threshold: float, upload: Upload | None = None
) -> NetUpsampling:
    """The upsampler with the weights of a file, or with those that come with vid2ev.  Raises UsageError."""
    path = pretrained.path_of(weights) if weights else pretrained.first(pretrained.OF_FRAMES)
    if path is None:
        raise UsageError(
            "upsampling 'net': no network of frames alone comes with this version; give the weights of one with"
            " net:WEIGHTS, or choose flow"
        )
    return NetUpsampling(path, subframes, max_subframes, threshold, upload)


def _codes(light: torch.Tensor) -> torch.Tensor:
    """sRGB codes [C, H, W] of light [H, W] or [H, W, C]."""
    light = light.nan_to_num(nan=0.0, posinf=MOST_OF_HALF_FLOATS)
    planes = light[None] if light.ndim == 2 else light.permute(2, 0, 1)
    return to_codes(planes, "srgb")


def _light(image: torch.Tensor, dimensions: int) -> torch.Tensor:
    light = to_light(image, "srgb")
    return light[0] if dimensions == 2 else light.permute(1, 2, 0).contiguous()
