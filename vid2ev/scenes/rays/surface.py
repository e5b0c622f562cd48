"""The surface at a meeting: its normal, and how (u, v) of its picture change along it.

`place` gives (normal, (u, v), gradient of u, gradient of v) in coordinates of the thing, at a point that is on it; how
pictures lie on shapes is told in `snapshot`.  The normal is that of the shape, outwards, of unit length.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import BOX, MESH, PLANE, SPHERE
from vid2ev.scenes.rays.meet import row
from vid2ev.scenes.rays.shapes import LOW_END, SIDE
from vid2ev.scenes.rays.triangles import triple

NO_CHANGE = (0.0, 0.0, 0.0)
TURN = 2.0 * math.pi
POLE = 1e-12  # where a meridian has no direction


@law
def place(world, thing, part, b1, b2, p):
    """The surface at a point p of a thing."""
    kind, half = world.kind[thing], row(world.half, thing)
    if kind == MESH:
        return place_on_mesh(world, part, b1, b2)
    if kind == PLANE:
        return place_on_side((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), half, p)
    if kind == BOX:
        return place_on_box(part, half, p)
    if kind == SPHERE:
        return place_on_sphere(half, p)
    return place_on_cylinder(part, half, p)


@law
def place_on_side(normal, along_u, along_v, half, p):
    """A flat side, whose u and v go along axes."""
    du, dv = per_extent(along_u, half), per_extent(along_v, half)
    u = 0.5 + du[0] * p[0] + du[1] * p[1] + du[2] * p[2]
    v = 0.5 + dv[0] * p[0] + dv[1] * p[1] + dv[2] * p[2]
    return normal, (u, v), du, dv


@law
def per_extent(axis, half):
    """An axis over the full extents."""
    return ratio(axis[0], 2.0 * half[0]), ratio(axis[1], 2.0 * half[1]), ratio(axis[2], 2.0 * half[2])


@law
def ratio(a, b):
    """a / b, and 0 where there is no extent to divide by."""
    return a / b if b > 1e-300 else 0.0


@law
def place_on_box(part, half, p):
    """The sides -x, +x, -y, +y, -z, +z."""
    if part == 0:
        return place_on_side((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), half, p)
    if part == 1:
        return place_on_side((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), half, p)
    if part == 2:
        return place_on_side((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), half, p)
    if part == 3:
        return place_on_side((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), half, p)
    if part == 4:
        return place_on_side((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), half, p)
    return place_on_side((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), half, p)


@law
def place_on_sphere(half, p):
    """Longitude and latitude on the unit sphere that is scaled to the ellipsoid."""
    x, y, z = p[0] / half[0], p[1] / half[1], p[2] / half[2]
    u, v, ux, uz, vy = longitude_latitude(x, y, -z)
    normal = unit((x / half[0], y / half[1], z / half[2]))
    return normal, (u, v), (ux / half[0], 0.0, -uz / half[2]), (0.0, vy / half[1], 0.0)


@law
def longitude_latitude(x, y, z):
    """(u, v) of a direction of unit length, and du/dx, du/dz, dv/dy."""
    around = max(x * x + z * z, POLE)
    u, v = 0.5 + math.atan2(x, z) / TURN, math.acos(min(max(-y, -1.0), 1.0)) / math.pi
    return u, v, z / (around * TURN), -x / (around * TURN), 1.0 / (math.pi * math.sqrt(around))


@law
def place_on_cylinder(part, half, p):
    """The side, or an end."""
    if part != SIDE:
        if part == LOW_END:
            return place_on_side((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), half, p)
        return place_on_side((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), half, p)
    x, y = p[0] / half[0], p[1] / half[1]
    around = max(x * x + y * y, POLE) * TURN
    u, down = 0.5 - math.atan2(y, x) / TURN, ratio(1.0, 2.0 * half[2])
    normal = unit((x / half[0], y / half[1], 0.0))
    return normal, (u, 0.5 + p[2] * down), (y / around / half[0], -x / around / half[1], 0.0), (0.0, 0.0, down)


@law
def place_on_mesh(world, triangle, b1, b2):
    """A triangle; its normal is that of its plane (`smooth_normal` has the other)."""
    e1, e2 = triple(world.corners, triangle, 1), triple(world.corners, triangle, 2)
    across = cross(e1, e2)
    area2 = dot(across, across)
    t = world.triangle_uv
    u1, v1 = t[triangle, 1, 0] - t[triangle, 0, 0], t[triangle, 1, 1] - t[triangle, 0, 1]
    u2, v2 = t[triangle, 2, 0] - t[triangle, 0, 0], t[triangle, 2, 1] - t[triangle, 0, 1]
    uv = t[triangle, 0, 0] + b1 * u1 + b2 * u2, t[triangle, 0, 1] + b1 * v1 + b2 * v2
    if not area2 > 0.0:
        return (0.0, 0.0, -1.0), uv, NO_CHANGE, NO_CHANGE
    # the gradients of b1 and b2 in the triangle's plane
    g1, g2 = cross(e2, across), cross(across, e1)
    du = ((u1 * g1[0] + u2 * g2[0]) / area2, (u1 * g1[1] + u2 * g2[1]) / area2, (u1 * g1[2] + u2 * g2[2]) / area2)
    dv = ((v1 * g1[0] + v2 * g2[0]) / area2, (v1 * g1[1] + v2 * g2[1]) / area2, (v1 * g1[2] + v2 * g2[2]) / area2)
    return unit(across), uv, du, dv


@law
def smooth_normal(world, triangle, b1, b2, flat):
    """The normal between those of the corners, on the side of the plane's; that one where they cancel out."""
    n0, n1 = triple(world.triangle_normals, triangle, 0), triple(world.triangle_normals, triangle, 1)
    n2, b0 = triple(world.triangle_normals, triangle, 2), 1.0 - b1 - b2
    mixed = (
        b0 * n0[0] + b1 * n1[0] + b2 * n2[0],
        b0 * n0[1] + b1 * n1[1] + b2 * n2[1],
        b0 * n0[2] + b1 * n1[2] + b2 * n2[2],
    )
    return unit(mixed) if dot(mixed, flat) > 0.0 else flat


@law
def cross(a, b):
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@law
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def unit(a):
    """a of length 1; what has no length faces the front."""
    length = math.sqrt(dot(a, a))
    return (a[0] / length, a[1] / length, a[2] / length) if length > 0.0 else (0.0, 0.0, -1.0)
