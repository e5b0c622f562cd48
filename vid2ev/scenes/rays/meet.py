"""What a ray meets first among the things of a world, and whether anything stands between a point and a lamp.

A meeting is (thing, t, part, b1, b2): the thing's number or NOTHING, the depth, and the face or triangle, the latter
with its barycentric coordinates.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import BEHIND, BOX, MESH, NOTHING, PART, PLANE, POINT, SPHERE, THING
from vid2ev.scenes.rays.shapes import meet_box, meet_cylinder, meet_plane, meet_sphere
from vid2ev.scenes.rays.triangles import meet_mesh

CLEAR = 1e-7  # of the distance: how far above a surface a ray towards a lamp starts


@law
def turned(turns, i, x, y, z):
    """A direction in coordinates of the camera, in those of a thing."""
    return (
        turns[i, 0, 0] * x + turns[i, 0, 1] * y + turns[i, 0, 2] * z,
        turns[i, 1, 0] * x + turns[i, 1, 1] * y + turns[i, 1, 2] * z,
        turns[i, 2, 0] * x + turns[i, 2, 1] * y + turns[i, 2, 2] * z,
    )


@law
def row(values, i):
    """Three numbers of an array [n, 3]."""
    return values[i, 0], values[i, 1], values[i, 2]


@law
def meet_thing(world, thing, o, d, nearest, stack):
    """(t, part, b1, b2) of a ray in coordinates of the thing; t infinite if nothing is nearer than `nearest`."""
    kind, half = world.kind[thing], row(world.half, thing)
    if kind == MESH:
        return meet_mesh(world, world.root[thing], o, d, nearest, stack)
    if kind == PLANE:
        t, part = meet_plane(o, d, half)
    elif kind == BOX:
        t, part = meet_box(o, d, half)
    elif kind == SPHERE:
        t, part = meet_sphere(o, d, half)
    else:
        t, part = meet_cylinder(o, d, half)
    return (t if t < nearest else math.inf), part, 0.0, 0.0


@law
def meet(world, things, count, x, y, stack):
    """The meeting of the ray (x, y, 1) with the first `count` of `things`, numbers in order of their nearest point."""
    best, found, part, b1, b2 = math.inf, NOTHING, 0, 0.0, 0.0
    length = math.sqrt(x * x + y * y + 1.0)
    for k in range(count):
        i = things[k]
        if best < math.inf and world.nearest[i] > best * length:
            break
        t, hit, one, two = meet_thing(world, i, row(world.eye, i), turned(world.turn, i, x, y, 1.0), best, stack)
        if t < best:
            best, found, part, b1, b2 = t, i, hit, one, two
    return found, best, part, b1, b2


@law
def key_of(world, thing, t, part, shadows, split):
    """The key of a meeting; `split` is the depth at which meshes are parted into what is before it and behind it."""
    if thing < 0:
        return -1
    if world.kind[thing] == MESH:
        return thing * THING + world.triangle_part[part] * PART + (BEHIND if t > split else 0) + shadows
    return thing * THING + part * PART + shadows


@law
def shadows_at(world, x, y, t, normal, stack):
    """Which lamps are hidden from a point of a thing, as bits; `normal` in coordinates of the camera, towards it."""
    bits = 0
    px, py, pz = t * x, t * y, t
    clear = CLEAR * t * math.sqrt(x * x + y * y + 1.0)
    for lamp in range(len(world.lamp_kind)):
        if world.lamp_shadows[lamp]:
            wx, wy, wz = row(world.lamp_in_camera, lamp)
            limit = math.inf
            if world.lamp_kind[lamp] == POINT:
                wx, wy, wz, limit = wx - px, wy - py, wz - pz, 1.0
            facing = normal[0] * wx + normal[1] * wy + normal[2] * wz
            if facing > 0.0:
                start = px + clear * normal[0], py + clear * normal[1], pz + clear * normal[2]
                if hidden(world, start, (wx, wy, wz), limit, stack):
                    bits |= 1 << lamp
    return bits


@law
def hidden(world, start, way, limit, stack):
    """Whether a thing is met from a point on a way, in coordinates of the camera, before `limit` times the way."""
    for i in range(len(world.kind)):
        if near_ball(world.ball, i, start, way, limit):
            ox, oy, oz = turned(world.turn, i, start[0], start[1], start[2])
            o = ox + world.eye[i, 0], oy + world.eye[i, 1], oz + world.eye[i, 2]
            t, _, _, _ = meet_thing(world, i, o, turned(world.turn, i, way[0], way[1], way[2]), limit, stack)
            if t < limit:
                return True
    return False


@law
def near_ball(ball, i, start, way, limit):
    """Whether a ray may meet what is within a ball."""
    x, y, z = ball[i, 0] - start[0], ball[i, 1] - start[1], ball[i, 2] - start[2]
    along = x * way[0] + y * way[1] + z * way[2]
    length2 = way[0] * way[0] + way[1] * way[1] + way[2] * way[2]
    share = min(max(along / length2, 0.0), limit) if length2 > 0.0 else 0.0
    x, y, z = x - share * way[0], y - share * way[1], z - share * way[2]
    return x * x + y * y + z * z <= ball[i, 3] * ball[i, 3] * (1.0 + 1e-9)
