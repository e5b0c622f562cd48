"""Which tiles of a picture look at certain balls, those whose view these may change."""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import walk
from vid2ev.scenes.rays.tiles import TILE, cone

MARGIN = 1  # px around a tile: of the keys of its pixels' neighbours; `cone` adds as much
SLACK = 1e-9  # of a cosine


@walk
def touch(rays, balls, touched):
    """Set touched [tiles down, tiles across] where the cone of a tile's rays may meet a ball.

    rays   float64 [H + 2, W + 2, 2] as of `walk`; tiles are of 16 x 16 of them
    balls  float64 [n, 6]: the unit vector towards the centre, in coordinates of the camera; sine, cosine and arc of the
           angle that the ball takes up around it, the arc pi if the camera is inside
    """
    for row in range(touched.shape[0]):
        for column in range(touched.shape[1]):
            first, left = row * TILE, column * TILE
            x, y, z, widest = cone(
                rays, max(first - MARGIN, 0), min(first + TILE, len(rays)) + MARGIN, max(left - MARGIN, 0),
                min(left + TILE, rays.shape[1]) + MARGIN,
            )  # fmt: skip
            cosine, sine = math.cos(widest), math.sin(widest)
            for k in range(len(balls)):
                along = x * balls[k, 0] + y * balls[k, 1] + z * balls[k, 2]
                if widest + balls[k, 5] >= math.pi or along >= cosine * balls[k, 4] - sine * balls[k, 3] - SLACK:
                    touched[row, column] = 1
                    break
