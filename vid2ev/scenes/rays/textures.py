"""The colour of a picture within the footprint of a pixel.

    footprint of a pixel   the ellipse to which (d(u, v)/dx, d(u, v)/dy) map the unit circle, in texels: axes a >= b
    level                  log2 max(b, a / 8, 1), between two levels of the picture's halvings
    along the longer axis  samples a level's texel apart, as many as fit, those at the ends with the share that fits

All of it is continuous in the footprint, and so is light while a camera moves.

Source: L. Williams, "Pyramidal parametrics", SIGGRAPH 1983; the samples along the longer axis after J. McCormack et al.,
"Feline: fast elliptical lines for anisotropic texture mapping", SIGGRAPH 1999.
"""

from __future__ import annotations

import math

from vid2ev.kernel_compiler import inner

LONGEST = 8.0  # times its width: what is longer is blurred across, too


@inner
def colour_of(world, picture, u, v, ux, vx, uy, vy, wraps_u, wraps_v):
    """Red, green and blue at (u, v), with the changes of u and v from pixel to pixel across (x) and down (y)."""
    if not (abs(u) < 1e9 and abs(v) < 1e9):
        u, v = 0.0, 0.0
    first, count = world.pictures[picture, 0], world.pictures[picture, 1]
    width, height = world.levels[first, 1], world.levels[first, 2]
    long_u, long_v, long, short = axes(ux * width, vx * height, uy * width, vy * height)
    if not long < 1e9:
        long_u, long_v, long, short = 0.0, 0.0, 1e9, 1e9
    if long <= 1.0:
        return of_level(world, first, u, v, wraps_u, wraps_v)
    texel = max(short, long / LONGEST, 1.0)
    level = min(math.log2(texel), count - 1.0)
    reach = 0.5 * long / texel + 0.5  # half the samples, in texels of the level
    step_u, step_v = long_u * texel / width, long_v * texel / height
    red, green, blue, sum_ = 0.0, 0.0, 0.0, 0.0
    side = int(math.ceil(reach)) - 1
    for k in range(-side, side + 1):
        share = min(1.0, reach - abs(k))
        r, g, b = between_levels(world, first, count, level, u + k * step_u, v + k * step_v, wraps_u, wraps_v)
        red, green, blue, sum_ = red + share * r, green + share * g, blue + share * b, sum_ + share
    return red / sum_, green / sum_, blue / sum_


@inner
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


@inner
def between_levels(world, first, count, level, u, v, wraps_u, wraps_v):
    """A level may be any number 0 ... count - 1."""
    whole = int(level)
    share = level - whole
    r, g, b = of_level(world, first + whole, u, v, wraps_u, wraps_v)
    if share > 0.0 and whole + 1 < count:
        r1, g1, b1 = of_level(world, first + whole + 1, u, v, wraps_u, wraps_v)
        r, g, b = r + share * (r1 - r), g + share * (g1 - g), b + share * (b1 - b)
    return r, g, b


@inner
def of_level(world, level, u, v, wraps_u, wraps_v):
    """Between the four nearest texels of a level."""
    first, width, height = world.levels[level, 0], world.levels[level, 1], world.levels[level, 2]
    x0, x1, right = texels_at(u, width, wraps_u)
    y0, y1, down = texels_at(v, height, wraps_v)
    above, below = first + y0 * width, first + y1 * width
    w00, w01 = (1.0 - right) * (1.0 - down), right * (1.0 - down)
    w10, w11 = (1.0 - right) * down, right * down
    t = world.texels
    a, b, c, d = above + x0, above + x1, below + x0, below + x1
    return (
        w00 * t[a, 0] + w01 * t[b, 0] + w10 * t[c, 0] + w11 * t[d, 0],
        w00 * t[a, 1] + w01 * t[b, 1] + w10 * t[c, 1] + w11 * t[d, 1],
        w00 * t[a, 2] + w01 * t[b, 2] + w10 * t[c, 2] + w11 * t[d, 2],
    )


@inner
def texels_at(u, width, wraps):
    """The two texels beside u, and how far it is from the first to the second."""
    u = u - math.floor(u) if wraps else min(max(u, 0.0), 1.0)
    x = u * width - 0.5
    low = int(math.floor(x))
    share = x - low
    high = low + 1
    if low < 0:
        low = width - 1 if wraps else 0
    if high >= width:
        high = 0 if wraps else width - 1
    return low, high, share
