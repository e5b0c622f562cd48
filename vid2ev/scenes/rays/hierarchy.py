"""The hierarchy of boxes around the triangles of a mesh.

    cost of a split = area(left) * triangles(left) + area(right) * triangles(right)

of the boxes' areas; the cheapest of 16 places along the widest axis of the triangles' centres is taken, or their median
where no place separates them or the hierarchy has become deep.

Source: I. Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner

LEAF = 4  # triangles
BINS = 16
DEEP = 40


@compiled
def build(lows, highs):
    """The order of triangles with these boxes [n, 3], and the nodes: `bounds` and `links` of `layout.World`."""
    n = len(lows)
    order = np.arange(n)
    bounds, links = np.empty((2 * n, 6)), np.empty((2 * n, 2), np.int32)
    tasks = np.empty((128, 4), np.int64)  # node, first, end, depth
    tasks[0], waiting, nodes = (0, 0, n, 0), 1, 1
    while waiting > 0:
        waiting -= 1
        node, first, end, depth = tasks[waiting]
        enclose(lows, highs, order, first, end, bounds, node)
        if end - first <= LEAF:
            links[node, 0], links[node, 1] = first, end - first
            continue
        middle = split(lows, highs, order, first, end, depth >= DEEP)
        links[node, 0], links[node, 1] = nodes, ~(nodes + 1)
        tasks[waiting] = (nodes, first, middle, depth + 1)
        tasks[waiting + 1] = (nodes + 1, middle, end, depth + 1)
        waiting, nodes = waiting + 2, nodes + 2
    return order, bounds[:nodes].copy(), links[:nodes].copy()


@inner
def enclose(lows, highs, order, first, end, bounds, node):
    """The box around triangles."""
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(first, end):
            low, high = min(low, lows[order[k], axis]), max(high, highs[order[k], axis])
        bounds[node, axis], bounds[node, axis + 3] = low, high


@inner
def split(lows, highs, order, first, end, by_median):
    """Put triangles in two heaps; where the second begins."""
    axis, low, width = widest(lows, highs, order, first, end)
    middle = first
    if width > 0.0 and not by_median:
        place = cheapest(lows, highs, order, first, end, axis, low, width)
        for k in range(first, end):
            if bin_of(lows, highs, order[k], axis, low, width) < place:
                order[k], order[middle] = order[middle], order[k]
                middle += 1
    if first < middle < end:
        return middle
    centres = lows[order[first:end], axis] + highs[order[first:end], axis]
    order[first:end] = order[first:end][np.argsort(centres)]
    return (first + end) // 2


@inner
def widest(lows, highs, order, first, end):
    """The axis along which the centres (doubled) differ most, the lowest of them, and how much they differ."""
    found, start, width = 0, 0.0, -1.0
    for axis in range(3):
        low, high = np.inf, -np.inf
        for k in range(first, end):
            centre = lows[order[k], axis] + highs[order[k], axis]
            low, high = min(low, centre), max(high, centre)
        if high - low > width:
            found, start, width = axis, low, high - low
    return found, start, width


@inner
def bin_of(lows, highs, triangle, axis, low, width):
    """The place of a triangle's centre, 0 ... BINS - 1."""
    return min(int((lows[triangle, axis] + highs[triangle, axis] - low) / width * BINS), BINS - 1)


@inner
def cheapest(lows, highs, order, first, end, axis, low, width):
    """The bin with which the second heap should begin."""
    boxes, counts = np.empty((BINS, 6)), np.zeros(BINS)
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for k in range(first, end):
        bin_ = bin_of(lows, highs, order[k], axis, low, width)
        counts[bin_] += 1.0
        for j in range(3):
            boxes[bin_, j] = min(boxes[bin_, j], lows[order[k], j])
            boxes[bin_, j + 3] = max(boxes[bin_, j + 3], highs[order[k], j])
    after = np.empty(BINS)
    sweep = np.empty(6)
    sweep[:3], sweep[3:], count = np.inf, -np.inf, 0.0
    for bin_ in range(BINS - 1, 0, -1):
        count += counts[bin_]
        after[bin_] = count * widened(sweep, boxes, bin_)
    sweep[:3], sweep[3:], count = np.inf, -np.inf, 0.0
    best, place = np.inf, 0
    for bin_ in range(1, BINS):
        count += counts[bin_ - 1]
        cost = count * widened(sweep, boxes, bin_ - 1) + after[bin_]
        if cost < best:
            best, place = cost, bin_
    return place


@inner
def widened(box, boxes, bin_):
    """Let a box hold another; half its surface, 0 while it holds nothing."""
    for j in range(3):
        box[j], box[j + 3] = min(box[j], boxes[bin_, j]), max(box[j + 3], boxes[bin_, j + 3])
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x if x >= 0.0 else 0.0
