"""The colour of a picture within the footprint of a pixel.

    footprint of a pixel   the ellipse to which (d(u, v)/dx, d(u, v)/dy) map the unit circle, in texels: axes a >= b
    texel                  max(b, a / 4, 1), between two levels of the picture's halvings
    along the longer axis  samples a level's texel apart, as many as fit, those at the ends with the share that fits

All of it is continuous in the footprint, and so is light while a camera moves.

Source: L. Williams, "Pyramidal parametrics", SIGGRAPH 1983; the samples along the longer axis after J. McCormack
et al., "Feline: fast elliptical lines for anisotropic texture mapping", SIGGRAPH 1999.
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev.scenes.rays.compiler import law

LONG = 1.1  # times its width: what is shorter is looked at in its middle
LONGEST = 4.0  # times its width: what is longer is blurred across, too


@law
def colour_of(world, picture, u, v, ux, vx, uy, vy, wraps_u, wraps_v):
    """Red, green and blue at (u, v), with the changes of u and v from pixel to pixel across (x) and down (y)."""
    if not (abs(u) < 1e9 and abs(v) < 1e9):
        u, v = 0.0, 0.0
    first, count = world.pictures[picture, 0], world.pictures[picture, 1]
    width, height = world.levels[first, 1], world.levels[first, 2]
    long_u, long_v, long, short = axes(ux * width, vx * height, uy * width, vy * height)
    if not long < 1e9:
        long_u, long_v, long, short = 0.0, 0.0, 1e9, 1e9
    texel = max(short, long / LONGEST, 1.0)
    whole, size = 0, 1.0
    while 2.0 * size <= texel and whole + 1 < count:
        whole, size = whole + 1, 2.0 * size
    long_u, long_v = long_u / width, long_v / height
    near = far = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    rest, apart = texel / size - 1.0, texel
    for level in range(2 if rest > 0.0 and whole + 1 < count else 1):
        far = along(world, first + whole + level, u, v, long_u, long_v, long, apart, wraps_u, wraps_v)
        if level == 0:
            near, apart = far, 2.0 * size
    return (
        near[0] + rest * (far[0] - near[0]),
        near[1] + rest * (far[1] - near[1]),
        near[2] + rest * (far[2] - near[2]),
    )


@law
def axes(ux, vx, uy, vy):
    """The longer axis of the ellipse as a unit vector, and the lengths of both: singular values of the 2 x 2 matrix."""
    uu, vv, uv = ux * ux + uy * uy, vx * vx + vy * vy, ux * vx + uy * vy
    middle, half = 0.5 * (uu + vv), 0.5 * (uu - vv)
    apart = math.sqrt(half * half + uv * uv)
    long = math.sqrt(middle + apart)
    short = abs(ux * vy - uy * vx) / long if long > 0.0 else 0.0
    if half >= 0.0:
        along_u, along_v = half + apart, uv
    else:
        along_u, along_v = uv, apart - half
    length = math.sqrt(along_u * along_u + along_v * along_v)
    if length == 0.0:
        return 1.0, 0.0, long, short
    return along_u / length, along_v / length, long, short


@law
def along(world, level, u, v, axis_u, axis_v, long, apart, wraps_u, wraps_v):
    """The mean of a level's samples along the longer axis, a distance apart (both in texels of the first level)."""
    reach = max(0.5 * long / apart + 1.0 - 0.5 * LONG, 1.0)  # half the samples
    side = np.int64(math.ceil(reach)) - 1  # (a GPU's is a float)
    axis_u, axis_v, one = axis_u * apart, axis_v * apart, np.float32(1.0)
    red, green, blue, sum_ = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for k in range(-side, side + 1):
        share = min(one, np.float32(reach - abs(k)))
        r, g, b = of_level(world, level, u + k * axis_u, v + k * axis_v, wraps_u, wraps_v)
        red, green, blue, sum_ = red + share * r, green + share * g, blue + share * b, sum_ + share
    over = one / sum_
    return red * over, green * over, blue * over


@law
def of_level(world, level, u, v, wraps_u, wraps_v):
    """Between the four nearest texels of a level."""
    first, width, height = world.levels[level, 0], world.levels[level, 1], world.levels[level, 2]
    x0, x1, right = texels_at(u, width, wraps_u)
    y0, y1, down = texels_at(v, height, wraps_v)
    above, below = first + y0 * width, first + y1 * width
    a, b, c, d = above + x0, above + x1, below + x0, below + x1
    w11, t = right * down, world.texels
    w10, w01 = down - w11, right - w11
    w00 = np.float32(1.0) - right - w10
    return (
        w00 * t[a, 0] + w01 * t[b, 0] + w10 * t[c, 0] + w11 * t[d, 0],
        w00 * t[a, 1] + w01 * t[b, 1] + w10 * t[c, 1] + w11 * t[d, 1],
        w00 * t[a, 2] + w01 * t[b, 2] + w10 * t[c, 2] + w11 * t[d, 2],
    )


@law
def texels_at(u, width, wraps):
    """The two texels beside u, and how far it is from the first to the second."""
    u = u - math.floor(u) if wraps else min(max(u, 0.0), 1.0)
    x = u * width + 0.5
    high = int(x)  # (of positive numbers; the first of the two is the one before)
    share, low = np.float32(x - high), high - 1
    if low < 0:
        low = width - 1 if wraps else 0
    if high >= width:
        high = 0 if wraps else width - 1
    return low, high, share
