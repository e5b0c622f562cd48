"""What the rays meet: a world as arrays of numbers, in the order of its things.

A ray is (x, y, 1) in coordinates of the camera, so that the number t at which it meets something is the depth:

    X_thing = eye + turn (x, y, 1) t

Normals, lamps and footprints of pixels are all in coordinates of the thing that was met.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

PLANE, BOX, SPHERE, CYLINDER, MESH = range(5)
POINT, SUN = range(2)
NOTHING = -1
STACK = 96  # nodes of a hierarchy that wait to be looked at; its depth is at most STACK / 2

# A key says what a pixel shows; light is smooth wherever it stays the same.  From the low end: lamps that are hidden,
# whether a mesh is met behind the depth at which it hides itself in this pixel, the part, the thing.
SHADOW_BITS, PART_BITS = 16, 31
BEHIND = 1 << SHADOW_BITS
PART = BEHIND << 1
THING = PART << PART_BITS
MOST_THINGS = (1 << 63) // THING
JUMP = 6.0  # steps of a pixel in depth from one to the next, steeper than 80 degrees: there a mesh may hide itself


class World(NamedTuple):
    """Things: one row each."""

    kind: np.ndarray  # int64 [n]
    order: np.ndarray  # int64 [n]: the things, the nearest first
    half: np.ndarray  # float64 [n, 3]: half extents
    turn: np.ndarray  # float64 [n, 3, 3]: camera to thing
    eye: np.ndarray  # float64 [n, 3]: the camera's centre
    ball: np.ndarray  # float64 [n, 4]: a ball around it, in the camera's coordinates: centre, radius
    nearest: np.ndarray  # float64 [n]: how far away the ball begins
    root: np.ndarray  # int64 [n]: the first node of its mesh
    colour: np.ndarray  # float64 [n, 3]
    gloss: np.ndarray  # float64 [n, 3]: specular, shininess, emission
    repeat: np.ndarray  # float64 [n, 2]
    wraps: np.ndarray  # int64 [n, 2]
    texture: np.ndarray  # int64 [n]: a row of `pictures`
    environment: int  # the same, of the background
    to_environment: np.ndarray  # float64 [n + 1, 3, 3]: thing to environment; the last is from the camera
    environment_gain: float
    irradiance: np.ndarray  # float64 [9, 3]: the environment's, in spherical harmonics; all 0 without one
    ambient: np.ndarray  # float64 [1, 3]
    casts: int  # whether any lamp casts shadows
    lamp_kind: np.ndarray  # int64 [lamps]; those with shadows first, SHADOW_BITS at most
    lamp_colour: np.ndarray  # float64 [lamps, 3]
    lamp_reach2: np.ndarray  # float64 [lamps]
    lamp_shadows: np.ndarray  # int64 [lamps]
    lamp_in_camera: np.ndarray  # float64 [lamps, 3]: position, or the unit vector towards a sun
    lamp: np.ndarray  # float64 [n, lamps, 3]: the same for each thing
    pictures: np.ndarray  # int64 [textures, 2]: first row of `levels`, how many
    levels: np.ndarray  # int64 [levels, 3]: first texel, width, height
    texels: np.ndarray  # float32 [texels, 3]
    bounds: np.ndarray  # float64 [nodes, 6]: low corner, high corner
    links: (
        np.ndarray
    )  # int32 [nodes, 2]: a leaf's first triangle and how many; two children's nodes (second below 0: ~node)
    corners: np.ndarray  # float64 [triangles, 3, 3]: the first corner, and the ways from it to the two others
    triangle_uv: np.ndarray  # float32 [triangles, 3, 2]
    triangle_normals: np.ndarray  # float32 [triangles, 3, 3]
    triangle_colours: np.ndarray  # float32 [triangles, 3, 3]
    triangle_part: np.ndarray  # int32 [triangles]: what is smooth together has one number
