"""Files of depth: float32 [H, W], z in m, > 0; +inf: nothing there; NaN: not known.

    .npy   as it is
    .exr   channel Z, float32, as it is; of the files of others also V, Y or R
    .png   16 bits: z = m_per_code * code; 65535: nothing there; 0: not known.  m_per_code is in depth.txt

Each file is there as a whole or not at all.  What a PNG cannot hold is refused, never clipped.

Source: OpenEXR, "Standard channel names" (Z, the distance of the front of a pixel).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.exr_writing import write_exr
from vid2ev.recording.disk import whole_file, whole_path, write_npy
from vid2ev.recording.truth_arrays import (
    LARGEST,
    SMALLEST,
    as_stored,
    by_suffix,
    checked,
    read_png,
    reading,
    state_number,
    stated_number,
    write_png,
)
from vid2ev.untrusted import check_exr, openexr, plain_name, read_array

SCALE = "depth.txt"
NOTHING, MOST = 65535, 65534  # codes
CHANNELS = ("Z", "V", "Y", "R")  # of depth, of any layer, the likeliest first: renderers differ


def write_depth(path: Path, depth_m: np.ndarray, m_per_code: float = 0.001) -> None:
    """Write depth [H, W] as .npy, .exr or .png (with `m_per_code` for all of the folder).

    Raises UsageError for what is no depth or beyond a PNG, and without the package for EXR; OSError from the disk.
    """
    depth = checked(depth_m, 2, "depth")
    if np.any(depth <= 0):
        raise UsageError(f"{path}: depth is greater than 0, +inf or NaN; found {float(np.nanmin(depth)):g} m")
    by_suffix(path, {".npy": _write_npy, ".exr": _write_exr, ".png": _depth_png(m_per_code)}, "depth")(path, depth)


def read_depth(path: Path) -> np.ndarray:
    """Depth [H, W], float32, m.  Raises DataError, or UsageError if it is not there or an EXR without the package."""
    read = by_suffix(path, {".npy": _read_npy, ".exr": _read_exr, ".png": _read_depth_png}, "depth")
    depth = as_stored(read(path), 2, path)
    if np.any(depth <= 0):  # (OpenEXR gives zeros for what is damaged)
        raise DataError(f"{path} holds depth of {float(np.nanmin(depth)):g} m, not above 0; get another copy")
    return depth


def is_stated(path: Path) -> bool:
    """Whether it is a PNG and what its codes mean is said beside it."""
    return path.suffix.lower() == ".png" and (path.parent / SCALE).is_file()


def _write_npy(path: Path, depth: np.ndarray) -> None:
    with whole_file(path) as file:
        write_npy(file, depth)


def _read_npy(path: Path) -> np.ndarray:
    with reading(path), open(path, "rb") as file:
        return read_array(file, path)


def _write_exr(path: Path, depth: np.ndarray) -> None:
    with whole_path(path) as beside:
        write_exr(beside, {"Z": depth})


def _read_exr(path: Path) -> np.ndarray:
    library = openexr(path)
    with reading(path):
        open(path, "rb").close()  # (the library does not say why it cannot)
        check_exr(path)
        with plain_name(path) as plain:
            channels = library.File(plain, separate_channels=True, num_threads=0).channels()
        name = next((name for last in CHANNELS for name in channels if name.rpartition(".")[2] == last), None)
        if name is None:
            raise DataError(f"{path} has no channel Z of depth, only {', '.join(channels)}; give another file")
        return np.asarray(channels[name].pixels, np.float32)


def _depth_png(m_per_code: float) -> Callable[[Path, np.ndarray], None]:
    def write(path: Path, depth: np.ndarray) -> None:
        known = np.isfinite(depth)
        farthest_m = float(depth[known].max(initial=0))
        if not SMALLEST < m_per_code < LARGEST or farthest_m / m_per_code > MOST + 0.5:
            raise UsageError(
                f"{path}: m_per_code {m_per_code:g} reaches {MOST * m_per_code:g} m, and there are {farthest_m:g} m;"
                f" take {farthest_m / MOST:.3g} or more, or .exr"
            )
        codes = np.where(np.isnan(depth), 0, NOTHING).astype(np.uint16)
        # (what is nearer than half a code is not unknown)
        codes[known] = np.maximum(np.round(depth[known].astype(np.float64) / m_per_code), 1)
        state_number(path, SCALE, m_per_code)
        write_png(path, codes)

    return write


def _read_depth_png(path: Path) -> np.ndarray:
    codes, m_per_code = read_png(path), stated_number(path, SCALE)
    if codes.ndim != 2 or codes.dtype != np.uint16:
        raise DataError(f"{path}: depth has one channel of 16 bits, not {list(codes.shape)} of {codes.dtype}")
    depth = codes * m_per_code
    depth[codes == 0], depth[codes == NOTHING] = np.nan, np.inf
    return depth
