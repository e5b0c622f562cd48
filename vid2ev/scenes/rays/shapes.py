"""Where a ray first meets a shape: closed forms, in coordinates of the shape.

    X = o + d t,  t > 0

Each law gives (t, part), t infinite for a miss; part tells apart the faces of a box (-x, +x, -y, +y, -z, +z) and the
side and ends of a cylinder.  From inside, a ray meets the far side.  Without extent along an axis, planes and boxes are
met by the very rays that go there, spheres, and cylinders that have none across, by nothing; nothing is NaN.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law

SIDE, LOW_END, HIGH_END = range(3)


@law
def meet_plane(o, d, half):
    """The rectangle |x| <= half x, |y| <= half y in z = 0."""
    if d[2] == 0.0:
        return math.inf, 0
    t = -o[2] / d[2]
    inside = abs(o[0] + t * d[0]) <= half[0] and abs(o[1] + t * d[1]) <= half[1]
    return (t, 0) if inside and t > 0.0 else (math.inf, 0)


@law
def slab(o, d, half):
    """When a ray is within |x| <= half of one axis: from, to; from > to if never."""
    if d == 0.0:
        return (-math.inf, math.inf) if abs(o) <= half else (math.inf, -math.inf)
    one, other = (-half - o) / d, (half - o) / d
    return min(one, other), max(one, other)


@law
def meet_box(o, d, half):
    """Slabs, after Kay and Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986."""
    x0, x1 = slab(o[0], d[0], half[0])
    y0, y1 = slab(o[1], d[1], half[1])
    z0, z1 = slab(o[2], d[2], half[2])
    near, far = max(x0, y0, z0), min(x1, y1, z1)
    if not (near <= far and far > 0.0):
        return math.inf, 0
    t, sign = (near, 1) if near > 0.0 else (far, -1)
    if t == (x0 if sign > 0 else x1):
        axis = 0
    elif t == (y0 if sign > 0 else y1):
        axis = 1
    else:
        axis = 2
    return t, 2 * axis + (1 if sign * d[axis] < 0.0 else 0)


@law
def roots(a, b, c):
    """The roots of a t^2 + 2 b t + c, the smaller first; infinite and crossed if there are none."""
    disc = b * b - a * c
    if not (disc >= 0.0 and a > 0.0):
        return math.inf, -math.inf
    q = -b - math.copysign(math.sqrt(disc), b)
    if q == 0.0:
        return 0.0, 0.0
    return min(q / a, c / q), max(q / a, c / q)


@law
def meet_sphere(o, d, half):
    """The ellipsoid with these half axes."""
    if not (half[0] > 0.0 and half[1] > 0.0 and half[2] > 0.0):
        return math.inf, 0
    ox, oy, oz = o[0] / half[0], o[1] / half[1], o[2] / half[2]
    dx, dy, dz = d[0] / half[0], d[1] / half[1], d[2] / half[2]
    near, far = roots(dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz - 1.0)
    if not (near <= far and far > 0.0):
        return math.inf, 0
    return (near, 0) if near > 0.0 else (far, 0)


@law
def meet_cylinder(o, d, half):
    """The elliptic cylinder along z, with its two ends."""
    if not (half[0] > 0.0 and half[1] > 0.0):
        return math.inf, 0
    ox, oy, dx, dy = o[0] / half[0], o[1] / half[1], d[0] / half[0], d[1] / half[1]
    a, c = dx * dx + dy * dy, ox * ox + oy * oy - 1.0
    side0, side1 = -math.inf, math.inf
    if a > 0.0:
        side0, side1 = roots(a, ox * dx + oy * dy, c)
    elif c > 0.0:
        return math.inf, 0
    z0, z1 = slab(o[2], d[2], half[2])
    near, far = max(side0, z0), min(side1, z1)
    if not (near <= far and far > 0.0):
        return math.inf, 0
    if near > 0.0:
        return near, SIDE if near == side0 else (LOW_END if d[2] > 0.0 else HIGH_END)
    return far, SIDE if far == side1 else (HIGH_END if d[2] > 0.0 else LOW_END)
