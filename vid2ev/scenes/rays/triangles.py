"""Where a ray first meets a mesh: its hierarchy of boxes, nearer children first.

    X = v + b1 (v1 - v) + b2 (v2 - v),   b1, b2 >= 0,  b1 + b2 <= 1

Sources: T. Möller, B. Trumbore, "Fast, minimum storage ray-triangle intersection", 1997; slabs after Kay and Kajiya.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law

SLACK = 1e-12  # of b1, b2: no ray slips between two triangles


@law
def meet_mesh(world, root, o, d, nearest, stack):
    """(t, triangle, b1, b2), t infinite if nothing is nearer than `nearest`; `stack` is int64 [STACK] to work in."""
    way = inverse(d[0]), inverse(d[1]), inverse(d[2])
    best, found, b1, b2 = nearest, -1, 0.0, 0.0
    waiting, node = 0, root
    if not enters(world.bounds, root, o, way, best) < math.inf:
        waiting, node = 0, -1
    while node >= 0:
        first, second = world.links[node, 0], world.links[node, 1]
        if second >= 0:  # a leaf
            for triangle in range(first, first + second):
                t, one, two = meet_triangle(world.corners, triangle, o, d)
                if t < best:
                    best, found, b1, b2 = t, triangle, one, two
            node = -1
        else:
            near, far = first, ~second
            t_near, t_far = enters(world.bounds, near, o, way, best), enters(world.bounds, far, o, way, best)
            if t_far < t_near:
                near, far, t_near, t_far = far, near, t_far, t_near
            if t_far < math.inf:
                stack[waiting] = far
                waiting += 1
            node = near if t_near < math.inf else -1
        while node < 0 and waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if not enters(world.bounds, node, o, way, best) < math.inf:
                node = -1
    return (best if found >= 0 else math.inf), found, b1, b2


@law
def inverse(d):
    """1 / d, and a number too large to matter, but not infinite, where d is 0."""
    return 1.0 / d if abs(d) > 1e-300 else 1e300


@law
def enters(bounds, node, o, way, nearest):
    """When a ray enters a box; infinite if it does not before `nearest`."""
    x0, x1 = (bounds[node, 0] - o[0]) * way[0], (bounds[node, 3] - o[0]) * way[0]
    y0, y1 = (bounds[node, 1] - o[1]) * way[1], (bounds[node, 4] - o[1]) * way[1]
    z0, z1 = (bounds[node, 2] - o[2]) * way[2], (bounds[node, 5] - o[2]) * way[2]
    near = max(min(x0, x1), min(y0, y1), min(z0, z1))
    far = min(max(x0, x1), max(y0, y1), max(z0, z1))
    # (a rounding more than the box, whose triangles may lie in its sides)
    return near if near <= far + 1e-12 * abs(far) and far >= 0.0 and near <= nearest else math.inf


@law
def meet_triangle(corners, triangle, o, d):
    """(t, b1, b2), t infinite for a miss."""
    e1x, e1y, e1z = triple(corners, triangle, 1)
    e2x, e2y, e2z = triple(corners, triangle, 2)
    vx, vy, vz = triple(corners, triangle, 0)
    px, py, pz = d[1] * e2z - d[2] * e2y, d[2] * e2x - d[0] * e2z, d[0] * e2y - d[1] * e2x
    volume = e1x * px + e1y * py + e1z * pz
    if volume == 0.0:
        return math.inf, 0.0, 0.0
    sx, sy, sz = o[0] - vx, o[1] - vy, o[2] - vz
    b1 = (sx * px + sy * py + sz * pz) / volume
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    b2 = (d[0] * qx + d[1] * qy + d[2] * qz) / volume
    t = (e2x * qx + e2y * qy + e2z * qz) / volume
    inside = b1 >= -SLACK and b2 >= -SLACK and b1 + b2 <= 1.0 + SLACK and t > 0.0
    return (t, b1, b2) if inside else (math.inf, 0.0, 0.0)


@law
def triple(values, i, j):
    """Three numbers of an array [n, 3, 3]."""
    return values[i, j, 0], values[i, j, 1], values[i, j, 2]
