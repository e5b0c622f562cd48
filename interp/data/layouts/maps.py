"""Where pixels of a camera were in another: a map, instant by instant, as `vid2ev convert --truth map` writes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from vid2ev.errors import DataError
from vid2ev.recording.exposures import TIMESTAMPS
from vid2ev.recording.manifest import as_stated
from vid2ev.recording.truth_files import read_pixel_map
from vid2ev.untrusted import read_text

NEAR_US = 50_000  # from a map's instant: 30 a second are written, unless less are asked for


class Maps:
    """Those in the folder `truth` of a camera with pictures of a size (width, height), of another camera; there may be
    none.  Raises DataError for times that are none."""

    def __init__(self, folder: Path, other: str, size: tuple[int, int]):
        self._folder, self._size = folder / f"map_{other}", size
        stamps, self._times_us = folder / TIMESTAMPS, np.empty(0, np.int64)
        if self._folder.is_dir() and stamps.is_file():
            with as_stated(stamps):
                self._times_us = np.array(read_text(stamps).split(), np.int64)

    def near(self, t_us: int) -> torch.Tensor | None:
        """The map nearest in time, [H, W, 2] px float32, NaN where it is not known; None if none is near.  Raises
        DataError for one that is damaged."""
        apart_us = np.abs(self._times_us - t_us)
        if not apart_us.size or apart_us.min() > NEAR_US:
            return None
        path = self._folder / f"{int(apart_us.argmin()):06d}.npz"
        pixels = read_pixel_map(path)
        if pixels.shape[1::-1] != self._size:
            (width, height), (wide, high) = pixels.shape[1::-1], self._size
            raise DataError(
                f"{path}: {width}x{height} pixels, expected {wide}x{high} as frames have; copy the recording again"
            )
        return torch.from_numpy(pixels)
