"""Light that reaches a point, and what a surface makes of it.

    sun    E = colour
    point  E = colour reach^2 / distance^2,   the distance at least 1 % of the reach
    light  = albedo (ambient + environment(n) + sum of E (n l) + emission) + specular (sum of E (n l) (n h)^shininess)

n, l, h are unit vectors: normal, towards the lamp, half way between l and the eye.  The environment's light on a normal
is the average over its half of all directions, weighted by the cosine, in spherical harmonics up to the second order.

Sources: J. F. Blinn, SIGGRAPH 1977; R. Ramamoorthi, P. Hanrahan, "An efficient representation for irradiance
environment maps", SIGGRAPH 2001 (equation 12).
"""

from __future__ import annotations

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import POINT
from vid2ev.scenes.rays.meet import row, turned
from vid2ev.scenes.rays.surface import dot, unit

CLOSEST = 1e-4  # of the reach squared


@law
def lit(world, thing, p, normal, view, albedo, shadows):
    """The light that a point of a thing sends along `view` (a unit vector towards the eye)."""
    specular, shininess, emission = row(world.gloss, thing)
    red, green, blue = environment_light(world, turned(world.to_environment, thing, normal[0], normal[1], normal[2]))
    red, green, blue = red + emission, green + emission, blue + emission
    gloss_red, gloss_green, gloss_blue = 0.0, 0.0, 0.0
    for lamp in range(len(world.lamp_kind)):
        if world.lamp_shadows[lamp] and shadows >> lamp & 1:
            continue
        way, strength = towards(world, thing, lamp, p)
        facing = dot(normal, way)
        if facing > 0.0:
            strength *= facing
            r, g, b = row(world.lamp_colour, lamp)
            red, green, blue = red + strength * r, green + strength * g, blue + strength * b
            if specular > 0.0:
                half = unit((way[0] + view[0], way[1] + view[1], way[2] + view[2]))
                strength *= specular * max(dot(normal, half), 0.0) ** shininess
                gloss_red, gloss_green = gloss_red + strength * r, gloss_green + strength * g
                gloss_blue += strength * b
    return albedo[0] * red + gloss_red, albedo[1] * green + gloss_green, albedo[2] * blue + gloss_blue


@law
def towards(world, thing, lamp, p):
    """The unit vector towards a lamp, and how strong its light is there."""
    x, y, z = world.lamp[thing, lamp, 0], world.lamp[thing, lamp, 1], world.lamp[thing, lamp, 2]
    if world.lamp_kind[lamp] != POINT:
        return (x, y, z), 1.0
    way = x - p[0], y - p[1], z - p[2]
    reach2 = world.lamp_reach2[lamp]
    return unit(way), reach2 / max(dot(way, way), CLOSEST * reach2)


@law
def environment_light(world, n):
    """Ambient light on a white surface with this normal, in coordinates of the environment."""
    red, green, blue = row(world.ambient, 0)
    if world.environment >= 0:
        r, g, b = irradiance(world.irradiance, n)
        red, green, blue = red + max(r, 0.0), green + max(g, 0.0), blue + max(b, 0.0)
    return red, green, blue


@law
def irradiance(harmonics, n):
    """The sum of nine harmonics, of which each row has the weights for red, green and blue."""
    x, y, z = n
    h = harmonics
    xy, yz, zz, xz, xx = x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y
    sum_ = (0.0, 0.0, 0.0)
    for k in range(3):
        value = h[0, k] + h[1, k] * y + h[2, k] * z + h[3, k] * x
        value += h[4, k] * xy + h[5, k] * yz + h[6, k] * zz + h[7, k] * xz + h[8, k] * xx
        sum_ = sum_[1], sum_[2], value
    return sum_
