"""Intrinsics: how a camera maps directions to pixels.

    u = fx x'' + cx,   v = fy y'' + cy,   (x'', y'') = distortion(x / z, y / z)

Pixels count from 0 and have their centres at whole numbers, as in OpenCV: the middle of a row of W is at (W - 1) / 2.
The distortion is `radtan` (OpenCV's k1, k2, p1, p2, k3, k4, k5, k6) or `equidistant` (OpenCV's and Kalibr's fisheye,
k1 ... k4).

Sources: the models of OpenCV 4.x, "Camera calibration and 3D reconstruction" and "Fisheye camera model"; D. C. Brown,
"Decentering distortion of lenses", 1966; J. Kannala, S. Brandt, "A generic camera model", PAMI 2006.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

DistortionModel = Literal["none", "radtan", "equidistant"]
SHORTEST_PX = 1e-12  # of focal lengths: what pixels look at through shorter ones is beyond all numbers
COUNTS = {"none": (0,), "radtan": (4, 5, 8), "equidistant": (4,)}  # of coefficients


class Intrinsics(BaseModel):
    """A camera's intrinsics.

    size         width, height [px]
    focal_px     fx, fy [px]
    centre_px    cx, cy: the principal point [px]
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    size: tuple[int, int] = Field(description="width and height [px]")
    focal_px: tuple[float, float] = Field(description="focal lengths across and down [px]")
    centre_px: tuple[float, float] = Field(description="the principal point, from the centre of the first pixel [px]")
    model: DistortionModel = Field(default="none", description="none, radtan or equidistant")
    distortion: tuple[float, ...] = Field(default=(), description="its coefficients, in OpenCV's order")

    @model_validator(mode="after")
    def _fits(self) -> Intrinsics:
        if min(self.size) < 1 or max(self.size) > 65535:
            raise ValueError(f"size {self.size[0]}x{self.size[1]} must be 1 to 65535 pixels each way")
        if min(self.focal_px) < SHORTEST_PX:
            raise ValueError(f"focal lengths must be greater than 0, {SHORTEST_PX:g} px or more")
        if len(self.distortion) not in COUNTS[self.model]:
            wanted = " or ".join(map(str, COUNTS[self.model]))
            raise ValueError(f"distortion '{self.model}' takes {wanted} coefficients, not {len(self.distortion)}")
        return self

    @classmethod
    def of_field(
        cls,
        size: tuple[int, int],
        fov_deg: float = 60.0,
        model: DistortionModel = "none",
        distortion: tuple[float, ...] = (),
    ) -> Intrinsics:
        """Square pixels, the centre in the middle, and a horizontal field of view [deg] through the lens.

        Raises ValueError for a lens that does not see so far.
        """
        from vid2ev.rig.lens import focal_of_field

        (width, height), focal = size, focal_of_field(size[0], fov_deg, model, distortion)
        middle = (width - 1) / 2, (height - 1) / 2
        return cls(size=size, focal_px=(focal, focal), centre_px=middle, model=model, distortion=distortion)

    @property
    def matrix(self) -> np.ndarray:
        """K [3, 3], float64."""
        return np.array(
            [[self.focal_px[0], 0, self.centre_px[0]], [0, self.focal_px[1], self.centre_px[1]], [0, 0, 1]], np.float64
        )

    @property
    def fov_deg(self) -> float:
        """The horizontal field of view through the lens between the outer borders of the pixels [deg]; NaN where it
        does not see so far."""
        from vid2ev.rig.lens import rays_of

        ends = np.array([[-0.5, self.centre_px[1]], [self.size[0] - 0.5, self.centre_px[1]]])
        left, right = np.degrees(np.arctan(rays_of(ends, self)[:, 0]))
        return float(right - left)

    def scaled_to(self, size: tuple[int, int]) -> Intrinsics:
        """The same field seen with other pixels; of another shape, the full width is kept."""
        across = size[0] / self.size[0]
        middle = (size[1] - self.size[1] * across) / 2  # (rows of another shape are cut or added on both sides)
        centre = (self.centre_px[0] + 0.5) * across - 0.5, (self.centre_px[1] + 0.5) * across - 0.5 + middle
        focal = self.focal_px[0] * across, self.focal_px[1] * across
        return self.model_copy(update={"size": size, "focal_px": focal, "centre_px": centre})


class Framing(NamedTuple):
    """A part of a picture, brought to a size: how its lens comes from that of the whole, and back."""

    whole: tuple[int, int]  # width and height of the picture [px]
    corner: tuple[float, float]  # upper left one of the part, from that of the picture [px]
    extent: tuple[float, float]  # width and height of the part [px]
    size: tuple[int, int]  # what they are brought to [px]

    @property
    def is_whole(self) -> bool:
        """Whether it is all of the picture in its own shape, so that its field is the same."""
        all_of_it = self.corner == (0, 0) and self.extent == self.whole
        return all_of_it and self.size[0] * self.whole[1] == self.size[1] * self.whole[0]

    def lens_of_part(self, lens: Intrinsics) -> Intrinsics:
        """The lens that the part is seen through, from that of the whole picture."""
        finer = [size / extent for size, extent in zip(self.size, self.extent, strict=True)]
        focal = [focal * by for focal, by in zip(lens.focal_px, finer, strict=True)]
        centre = [
            (middle + 0.5 - corner) * by - 0.5
            for middle, corner, by in zip(lens.centre_px, self.corner, finer, strict=True)
        ]
        return lens.model_copy(update={"size": self.size, "focal_px": tuple(focal), "centre_px": tuple(centre)})

    def lens_of_whole(self, lens: Intrinsics) -> Intrinsics:
        """The lens of the whole picture, which is a part of the plane around the part."""
        finer = [size / extent for size, extent in zip(self.size, self.extent, strict=True)]
        left, up = (-corner * by for corner, by in zip(self.corner, finer, strict=True))
        wide, high = (side * by for side, by in zip(self.whole, finer, strict=True))
        return Framing(self.size, (left, up), (wide, high), self.whole).lens_of_part(lens)
