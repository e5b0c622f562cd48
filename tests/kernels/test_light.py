"""Light of a block: what is no light is mended and counted, codes go through their table, shading is applied."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.layout import NOT_FINITE, TALLIES
from vid2ev.kernels.light import BRIGHTEST, read_light
from vid2ev.kernels.scratch import NEW, SCRATCH

P0, N = 70, 100
F = np.float32
NO_SHADE, NO_TABLE = np.ones(1, F), np.zeros(0, F)


@compiled
def taken(scratch, light, lut, shade, p0, n, tally):
    """Light of the pixels from p0 on, into scratch."""
    read_light(scratch, light, lut, shade, p0, n, tally)


def read(light: np.ndarray, lut: np.ndarray, shade: np.ndarray) -> tuple[np.ndarray, int]:
    """The light of N pixels from P0 on, and how many of them were none; nothing else is written."""
    scratch, tally = np.full(SCRATCH, F(7)), np.zeros(TALLIES, np.int64)
    taken(scratch, light, lut, shade, P0, N, tally)
    assert (np.delete(scratch, np.arange(NEW, NEW + N)) == 7).all()
    return scratch[NEW : NEW + N], int(tally[NOT_FINITE])


@pytest.mark.parametrize("shaded", [False, True])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_no_light_is_mended(dtype, shaded):
    rng = np.random.default_rng(0)
    light = (10 ** rng.uniform(-3, 6, 200)).astype(dtype)
    odd = [(np.nan, 0.0, 1), (-1.0, 0.0, 1), (np.inf, BRIGHTEST, 1), (-np.inf, 0.0, 1), (-0.0, 0.0, 0), (0.0, 0.0, 0),
           (float(BRIGHTEST), BRIGHTEST, 0), (2 * float(BRIGHTEST), BRIGHTEST, 1), (1e-45, F(1e-45), 0)]  # fmt: skip
    meant, bad = light.astype(F), 0
    for k, (value, mended, counted) in enumerate(odd):
        light[P0 + 3 * k], meant[P0 + 3 * k], bad = value, mended, bad + counted
    light[:P0] = np.nan  # (of others)
    shade = rng.uniform(0.2, 1, 200).astype(F) if shaded else NO_SHADE
    got, count = read(light, NO_TABLE, shade)
    np.testing.assert_array_equal(got, (meant * shade)[P0 : P0 + N])
    assert count == bad


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_codes_are_of_their_table_or_so_many_units(dtype):
    rng = np.random.default_rng(0)
    codes = rng.integers(0, np.iinfo(dtype).max, 200, dtype, endpoint=True)
    for table in (rng.uniform(0, 1, np.iinfo(dtype).max + 1).astype(F), np.array([0.25], F)):
        got, count = read(codes, table, NO_SHADE)
        light = table[codes] if table.size > 1 else codes.astype(F) * table[0]
        np.testing.assert_array_equal(got, light[P0 : P0 + N])
        assert count == 0
