"""What one ray of a picture sees: the light that comes along it, and the key of what it meets.

The footprint of a pixel on a surface: where the ray turns by dd from pixel to pixel, the point that it meets moves by

    dX = t (dd - d (n dd) / (n d))

Source: H. Igehy, "Tracing ray differentials", SIGGRAPH 1999.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import MESH
from vid2ev.scenes.rays.light import lit
from vid2ev.scenes.rays.meet import row, shadows_at, turned
from vid2ev.scenes.rays.surface import dot, longitude_latitude, place, smooth_normal
from vid2ev.scenes.rays.textures import colour_of
from vid2ev.scenes.rays.triangles import triple

GRAZING = 1e-9


@law
def shadows_of(world, meeting, x, y, stack):
    """Which lamps are hidden from a meeting, as bits."""
    thing, t, part, b1, b2 = meeting
    if thing < 0 or not world.casts:
        return 0
    d = turned(world.turn, thing, x, y, 1.0)
    p = world.eye[thing, 0] + t * d[0], world.eye[thing, 1] + t * d[1], world.eye[thing, 2] + t * d[2]
    n, _, _, _ = place(world, thing, part, b1, b2, p)
    side = 1.0 if dot(n, d) <= 0.0 else -1.0
    turn = world.turn
    back = (
        side * (turn[thing, 0, 0] * n[0] + turn[thing, 1, 0] * n[1] + turn[thing, 2, 0] * n[2]),
        side * (turn[thing, 0, 1] * n[0] + turn[thing, 1, 1] * n[1] + turn[thing, 2, 1] * n[2]),
        side * (turn[thing, 0, 2] * n[0] + turn[thing, 1, 2] * n[1] + turn[thing, 2, 2] * n[2]),
    )
    return shadows_at(world, x, y, t, back, stack)


@law
def light_of(world, meeting, x, y, across, down, shadows):
    """Red, green and blue along the ray (x, y, 1), which turns by `across` and `down` (x, y) from pixel to pixel."""
    thing, t, part, b1, b2 = meeting
    if thing < 0:
        return background(world, x, y, across, down)
    d = turned(world.turn, thing, x, y, 1.0)
    p = world.eye[thing, 0] + t * d[0], world.eye[thing, 1] + t * d[1], world.eye[thing, 2] + t * d[2]
    normal, uv, du, dv = place(world, thing, part, b1, b2, p)
    albedo, smooth = row(world.colour, thing), normal
    if world.texture[thing] >= 0:
        r, g, b = colour_on(world, thing, uv, du, dv, normal, d, t, across, down)
        albedo = albedo[0] * r, albedo[1] * g, albedo[2] * b
    if world.kind[thing] == MESH:
        r, g, b = colour_of_corners(world, part, b1, b2)
        albedo = albedo[0] * r, albedo[1] * g, albedo[2] * b
        smooth = smooth_normal(world, part, b1, b2, normal)
    if dot(normal, d) > 0.0:  # (the side that one sees is that of the plane, not of the smooth normal)
        smooth = -smooth[0], -smooth[1], -smooth[2]
    length = math.sqrt(dot(d, d))
    return lit(world, thing, p, smooth, (-d[0] / length, -d[1] / length, -d[2] / length), albedo, shadows)


@law
def colour_on(world, thing, uv, du, dv, normal, d, t, across, down):
    """The colour of a thing's picture within the footprint of a pixel."""
    moved = footprint(normal, d, turned(world.turn, thing, across[0], across[1], 0.0), t)
    lowered = footprint(normal, d, turned(world.turn, thing, down[0], down[1], 0.0), t)
    repeat_u, repeat_v = world.repeat[thing, 0], world.repeat[thing, 1]
    return colour_of(
        world, world.texture[thing], repeated(uv[0], repeat_u), repeated(uv[1], repeat_v),
        dot(du, moved) * repeat_u, dot(dv, moved) * repeat_v,
        dot(du, lowered) * repeat_u, dot(dv, lowered) * repeat_v,
        world.wraps[thing, 0], world.wraps[thing, 1],
    )  # fmt: skip


@law
def repeated(u, times):
    """The place in a picture that is there so many times; of a mirrored one (times < 0), from its far end."""
    return u * times + 1.0 if times < 0.0 else u * times


@law
def footprint(normal, d, turn, t):
    """How the point that a ray meets moves along the surface when the ray turns."""
    facing = dot(normal, d)
    if abs(facing) < GRAZING:
        facing = GRAZING
    along = dot(normal, turn) / facing
    return t * (turn[0] - d[0] * along), t * (turn[1] - d[1] * along), t * (turn[2] - d[2] * along)


@law
def colour_of_corners(world, triangle, b1, b2):
    """The colour between those of a triangle's corners."""
    c0, c1 = triple(world.triangle_colours, triangle, 0), triple(world.triangle_colours, triangle, 1)
    c2, b0 = triple(world.triangle_colours, triangle, 2), 1.0 - b1 - b2
    return (
        b0 * c0[0] + b1 * c1[0] + b2 * c2[0],
        b0 * c0[1] + b1 * c1[1] + b2 * c2[1],
        b0 * c0[2] + b1 * c1[2] + b2 * c2[2],
    )


@law
def background(world, x, y, across, down):
    """The environment in a direction; black where the lens sees nothing."""
    if world.environment < 0 or x != x:
        return 0.0, 0.0, 0.0
    camera = len(world.kind)
    e = turned(world.to_environment, camera, x, y, 1.0)
    moved = turned(world.to_environment, camera, across[0], across[1], 0.0)
    lowered = turned(world.to_environment, camera, down[0], down[1], 0.0)
    length = math.sqrt(dot(e, e))
    e = e[0] / length, e[1] / length, e[2] / length
    u, v, ux, uz, vy = longitude_latitude(e[0], e[1], e[2])
    climb_x, climb_y = moved[1] - e[1] * dot(e, moved), lowered[1] - e[1] * dot(e, lowered)
    r, g, b = colour_of(
        world, world.environment, u, v,
        (ux * moved[0] + uz * moved[2]) / length, vy * climb_x / length,
        (ux * lowered[0] + uz * lowered[2]) / length, vy * climb_y / length,
        1, 0,
    )  # fmt: skip
    gain = world.environment_gain
    return gain * r, gain * g, gain * b
