"""Layers of light, one before the other, seen by a camera: the inner loop of `layers.py`.

Each pixel takes the light of a layer around its place with the weights of the cubic B-spline, as `vid2ev.light.spline`
does for one photograph: smooth twice over, never negative, and blurring alike wherever between two pixels it falls.
Here a pixel of a layer is never smaller than one of the picture, so there are 4 x 4 of them, and channels are four:
red, green, blue and the share that is covered, times which they are.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached, cached_with


@cached_with(fastmath={"contract", "nsz"})
def _spline(share, weights):  # type: ignore[no-untyped-def]
    """Weights of four pixels about a place `share` behind the second."""
    rest = np.float32(1) - share
    weights[0] = rest * rest * rest / np.float32(6)
    weights[1] = np.float32(2 / 3) - share * share * (np.float32(1) - share / np.float32(2))
    weights[2] = np.float32(2 / 3) - rest * rest * (np.float32(1) - rest / np.float32(2))
    weights[3] = share * share * share / np.float32(6)


@cached_with(fastmath={"contract", "nsz"})
def lay(layer, place, waves, mirrored, out):  # type: ignore[no-untyped-def]
    """Lay a layer [h, w, 4] float32 over light [H, W, 3].

    place      x, y of the layer [px] in the middle of the picture, and the two steps from a pixel to the next in its
               row
    waves      height [px], length [px] and phase of a wave that sways rows to the sides
    mirrored   whether the layer goes on beyond its borders, mirrored; otherwise there is nothing
    """
    rows, columns = layer.shape[0], layer.shape[1]
    height, width = out.shape[0], out.shape[1]
    wx, wy = np.empty(4, np.float32), np.empty(4, np.float32)
    sums = np.empty(4, np.float32)
    at_x, at_y = np.empty(4, np.int64), np.empty(4, np.int64)
    for j in range(height):
        down = j + 0.5 - height / 2
        sway = waves[0] * np.sin(2 * np.pi * (down / waves[1] + waves[2]))
        for i in range(width):
            right = i + 0.5 - width / 2 + sway
            x = place[0] + right * place[2] - down * place[3] - 0.5
            y = place[1] + right * place[3] + down * place[2] - 0.5
            column, row = int(np.floor(x)), int(np.floor(y))
            if not mirrored and (column < -2 or row < -2 or column > columns or row > rows):
                continue
            _spline(np.float32(x - column), wx)
            _spline(np.float32(y - row), wy)
            for k in range(4):
                at_x[k], at_y[k] = column - 1 + k, row - 1 + k
                if mirrored:
                    at_x[k], at_y[k] = _mirrored(at_x[k], columns), _mirrored(at_y[k], rows)
                else:
                    wx[k] = wx[k] if 0 <= at_x[k] < columns else np.float32(0)
                    wy[k] = wy[k] if 0 <= at_y[k] < rows else np.float32(0)
                    at_x[k], at_y[k] = min(max(at_x[k], 0), columns - 1), min(max(at_y[k], 0), rows - 1)
            sums[:] = 0
            for k in range(4):
                for m in range(4):
                    weight = wy[k] * wx[m]
                    for c in range(4):
                        sums[c] += weight * layer[at_y[k], at_x[m], c]
            for c in range(3):
                out[j, i, c] = sums[c] + (np.float32(1) - sums[3]) * out[j, i, c]


@cached
def _mirrored(k, length):  # type: ignore[no-untyped-def]
    k %= 2 * length
    return k if k < length else 2 * length - 1 - k
