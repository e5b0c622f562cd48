"""Files of optical flow: float32 [H, W, 2], px to the right and down; NaN: not known.

    .npz   array flow, as it is
    .flo   Middlebury: "PIEH", width, height, float32 in pairs; 1e10: not known
    .png   16 bits, red and green: 32768 + codes_per_px * flow; blue: 1 where it is known, else 0.
           KITTI has 64 codes in a pixel, DSEC 128; codes_per_px is in flow.txt

Each file is there as a whole or not at all.  What a file cannot hold is refused, never clipped.

Sources: S. Baker et al., "A database and evaluation methodology for optical flow", IJCV 2011 (.flo); KITTI 2015 devkit,
readme; M. Gehrig et al., "E-RAFT", 3DV 2021, and the page "Optical flow" of DSEC.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.disk import whole_file, write_npz
from vid2ev.recording.truth_arrays import (
    as_stored,
    by_suffix,
    checked,
    read_npz,
    read_png,
    reading,
    state_number,
    stated_number,
    write_png,
)
from vid2ev.untrusted import check_bytes

FLO, FLO_UNKNOWN, FLO_LARGEST = b"PIEH", 1e10, 1e9  # Middlebury: what is above 1e9 is not known
ZERO = 1 << 15  # the code of no motion


def write_flow(path: Path, flow_px: np.ndarray, codes_per_px: int = 128) -> None:
    """Write flow [H, W, 2] as .npz, .flo or .png (with `codes_per_px` for all of the folder: 64 as KITTI, 128 as DSEC).

    Raises UsageError for what is no flow or beyond a PNG, OSError from the disk.
    """
    flow = checked(flow_px, 3, "flow")
    if np.isinf(flow).any():
        raise UsageError(f"{path}: flow is a number of pixels, or NaN where it is not known; found an infinite one")
    by_suffix(path, {".npz": _write_flow_npz, ".flo": _write_flo, ".png": _flow_png(codes_per_px)}, "flow")(path, flow)


def read_flow(path: Path, codes_per_px: int | None = None) -> np.ndarray:
    """Flow [H, W, 2], float32, px.

    codes_per_px  of a .png without flow.txt beside it: 64 as KITTI's, 128 as DSEC's
    Raises DataError, and UsageError for a file that is not there and a scale that cannot be.
    """
    if codes_per_px is not None and codes_per_px < 1:
        raise UsageError(f"{path}: codes_per_px {codes_per_px} must be at least 1; KITTI has 64, DSEC 128")
    readers: dict[str, Callable[[Path], np.ndarray]] = {
        ".npz": lambda path: read_npz(path, "flow"),
        ".flo": _read_flo,
        ".png": lambda path: _read_flow_png(path, codes_per_px),
    }
    return as_stored(by_suffix(path, readers, "flow")(path), 3, path)


def _write_flow_npz(path: Path, flow: np.ndarray) -> None:
    with whole_file(path) as file:
        write_npz(file, {"flow": flow})


def _write_flo(path: Path, flow: np.ndarray) -> None:
    largest = float(np.nan_to_num(np.abs(flow)).max())
    if largest > FLO_LARGEST:
        raise UsageError(f"{path}: .flo takes {largest:g} px for not known; choose .npz")
    unknown = np.isnan(flow).any(axis=2, keepdims=True)
    with whole_file(path) as file:
        file.write(FLO + np.array(flow.shape[1::-1], "<i4").tobytes())
        file.write(np.where(unknown, np.float32(FLO_UNKNOWN), flow).astype("<f4").tobytes())


def _read_flo(path: Path) -> np.ndarray:
    with reading(path):
        check_bytes(path, path.stat().st_size)
        content = path.read_bytes()
    width, height = np.frombuffer(content[4:12].ljust(8, b"\0"), "<i4").tolist()
    if not content.startswith(FLO) or width < 1 or height < 1 or len(content) != 12 + 8 * width * height:
        raise DataError(f"{path}: not a .flo file of {width}x{height} pixels, or damaged; get another copy")
    flow = np.frombuffer(content, "<f4", offset=12).reshape(height, width, 2)
    unknown = ~(np.abs(flow) <= FLO_LARGEST).all(axis=2, keepdims=True)
    return np.where(unknown, np.float32(np.nan), flow).astype(np.float32)


def _flow_png(codes_per_px: int) -> Callable[[Path, np.ndarray], None]:
    def write(path: Path, flow: np.ndarray) -> None:
        known = ~np.isnan(flow).any(axis=2)
        codes = np.round(flow[known].astype(np.float64) * codes_per_px) + ZERO
        if codes_per_px < 1 or np.any((codes < 0) | (codes > 65535)):
            raise UsageError(
                f"{path}: {codes_per_px} codes in a pixel reach {ZERO / max(codes_per_px, 1):g} px, and there are"
                f" {float(np.abs(flow[known]).max()):g}; choose fewer, or .flo or .npz"
            )
        picture = np.zeros((*known.shape, 3), np.uint16)
        picture[known] = np.c_[codes, np.ones(len(codes))]
        state_number(path, "flow.txt", codes_per_px)
        write_png(path, picture)

    return write


def _read_flow_png(path: Path, codes_per_px: int | None) -> np.ndarray:
    picture = read_png(path)
    if picture.shape[2:] != (3,) or picture.dtype != np.uint16:
        raise DataError(f"{path}: flow has three channels of 16 bits, not {list(picture.shape)} of {picture.dtype}")
    scale = codes_per_px if codes_per_px is not None else stated_number(path, "flow.txt")
    flow = ((picture[..., :2].astype(np.float64) - ZERO) / scale).astype(np.float32)
    flow[picture[..., 2] == 0] = np.nan
    return flow
