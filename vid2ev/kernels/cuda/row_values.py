"""What the kernels of a frame sensor work on: rows [H, n], each value of which is a thread's.

A plane that is not in use has one value, which changes nothing: only the first thread sees it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Taken(NamedTuple):
    """Light on its way into the sensor."""

    light: np.ndarray  # float32
    rows: np.ndarray  # float32
    mended: np.ndarray  # int64 [1], how many values were no light


class Added(NamedTuple):
    """Sums of an exposure, and two frames that are added to them with weights."""

    total: np.ndarray  # float64
    before: np.ndarray  # float32
    after: np.ndarray
    weight_before: np.ndarray  # float64 [H]
    weight_after: np.ndarray


class Read(NamedTuple):
    """Sums that are read out, with the planes that `kernels.exposures.read_rows` has."""

    total: np.ndarray  # float64
    shade: np.ndarray  # float32, as the following
    gain: np.ndarray
    dark: np.ndarray
    light: np.ndarray
    codes: np.ndarray  # uint16
