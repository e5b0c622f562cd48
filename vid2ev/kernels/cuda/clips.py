"""What kernels of a GPU work on: clips of as many pixels and frames each, one after the other, and where events go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Clips(NamedTuple):
    """What is seen, and by which sensors."""

    pixels: int  # of each sensor
    light: np.ndarray  # float32 [frames, clips, pixels]
    sensor_floats: np.ndarray  # [clips, .]: `rows`
    sensor_ints: np.ndarray
    interval_floats: np.ndarray  # [clips or 1, frames, .]: those of one for all
    interval_ints: np.ndarray
    bases: np.ndarray  # uint64 [clips, frames], added to keys
    forced: np.ndarray  # uint8 [clips x pixels], 1 where there are candidates; [0] without


class Candidates(NamedTuple):
    """Candidates of forced events, by pixel and time; the last one is of no pixel."""

    pixel: np.ndarray  # int64, clip x pixels + pixel
    t_ns: np.ndarray  # int64
    wanted: np.ndarray  # float64, as `forced.candidates` has it
    keys: np.ndarray  # int64, room for as many
    chance: np.ndarray  # float64, likewise


class Due(NamedTuple):
    """Those of one pixel."""

    t_ns: np.ndarray
    wanted: np.ndarray
    keys: np.ndarray
    chance: np.ndarray


class Listed(NamedTuple):
    """The pixels that have to be walked."""

    pixel: np.ndarray  # int64 [clips x pixels], clip x pixels + pixel
    frame: np.ndarray  # int32 [clips x pixels], the first frame of the walk
    count: np.ndarray  # int64 [1]


class Sent(NamedTuple):
    """Keys of events, in no order, but those of a pixel in their order."""

    keys: np.ndarray  # uint64
    taken: np.ndarray  # int64 [1], how many, which may be more than there is room for


class Start(NamedTuple):
    """What sensors settle with."""

    t_ns: np.ndarray  # int64 [clips]
    bad: np.ndarray  # uint8 [clips x pixels], 0 where a pixel is good
    random_phase: np.ndarray  # uint8 [clips]


class Totals(NamedTuple):
    """What all threads have counted (`layout.TALLIES`)."""

    counts: np.ndarray  # int64
