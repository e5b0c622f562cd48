"""Frames: linear light at an instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from vid2ev.stream.still import Still

Colour = Literal["luminance", "rgb"]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # of red, green, blue: Rec. ITU-R BT.709-6 item 3.2


@dataclass(frozen=True, slots=True)
class Frame:
    """The light of a scene at one instant.

    `light` is float32 and linear; 1.0 is diffuse white and brighter light goes on unclipped.  It is luminance [H, W]
    or, from a source opened with colour "rgb", red, green, blue [H, W, 3] of the primaries of BT.709; a colour that
    these cannot mix has a negative component, so that 0.2126 R + 0.7152 G + 0.0722 B is the luminance of any colour.
    Light that is on a device is a tensor of torch (`stream.upload`) and is mixed and carried there.

    `t_ns` is the instant in nanoseconds on the clock of the source.  `original` is True for a frame of the source,
    False for one made between two of them.  `cut` is True where a new shot begins: what was seen before has nothing to
    do with it.  `depth`, where it is known, is float32 [H, W]: how far the scene is along the axis of the camera that
    sees it [m]; what is not finite and positive is unknown.  `still` says what has not changed since the frame before,
    where whoever made both knows.  `number` is that of its picture in the source, of which some may be dropped, counted
    from the first one, where that is known and the frame is one of the source.
    """

    light: np.ndarray
    t_ns: int
    original: bool = True
    cut: bool = False
    depth: np.ndarray | None = None
    still: Still | None = None
    number: int | None = None

    @property
    def luminance(self) -> np.ndarray:
        """Luminance [H, W]; `light` itself where it is that."""
        return self.light if self.light.ndim == 2 else luminance_of(self.light)


def luminance_of(light: Any) -> Any:
    """Luminance [...] of red, green and blue [..., 3], an array or a tensor of torch."""
    if isinstance(light, np.ndarray):
        return light @ LUMINANCE
    red, green, blue = light.unbind(-1)
    return float(LUMINANCE[0]) * red + float(LUMINANCE[1]) * green + float(LUMINANCE[2]) * blue
