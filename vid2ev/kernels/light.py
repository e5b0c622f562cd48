"""Light of a block, from codes or numbers, into its scratch."""

from __future__ import annotations

import numpy as np
from numba import types
from numba.core.extending import overload

from vid2ev.compiling.compiler import INNER_OPTIONS, inner
from vid2ev.kernels.layout import NOT_FINITE
from vid2ev.kernels.scratch import NEW
from vid2ev.stream.still import BRIGHTEST as MOST

F = np.float32
BRIGHTEST = F(MOST)


@inner
def read_light(scratch, light, lut, shade, p0, n, tally):
    """Light of a block into scratch, shading applied."""
    # (slices: an index with an offset may be negative for all the compiler knows, and then it does not vectorise)
    take_light(scratch, light[p0 : p0 + n], lut, tally)
    if shade.size == light.size:
        gain = shade[p0 : p0 + n]
        for i in range(n):
            scratch[NEW + i] = scratch[NEW + i] * gain[i]


def take_light(scratch, light, lut, tally):
    """Codes through their table, or linear light with what is not a finite light >= 0 mended."""


@overload(take_light, jit_options=INNER_OPTIONS)
def _take_light(scratch, light, lut, tally):
    if isinstance(light.dtype, types.Integer):

        def codes(scratch, light, lut, tally):
            if lut.size == 1:  # linear codes: the light of code 1
                unit = lut[0]
                for i in range(light.size):
                    scratch[NEW + i] = F(light[i]) * unit
            else:
                for i in range(light.size):
                    scratch[NEW + i] = lut[light[i]]

        return codes

    def linear(scratch, light, lut, tally):
        bad = np.int32(0)
        for i in range(light.size):
            value = F(light[i])
            bad += np.int32(0) if (value >= F(0.0)) & (value <= BRIGHTEST) else np.int32(1)
            value = value if value > F(0.0) else F(0.0)  # a NaN fails the comparison and becomes 0
            scratch[NEW + i] = value if value < BRIGHTEST else BRIGHTEST
        tally[NOT_FINITE] += bad

    return linear
