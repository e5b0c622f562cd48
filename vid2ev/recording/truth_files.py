"""Files of what is known of a scene, one function for each kind to write and one to read.

    depth      float32 [H, W], m                                 .npy, .exr, .png          `depth_files`
    flow       float32 [H, W, 2], px                             .npz, .flo, .png          `flow_files`
    poses      instants, positions, quaternions                  text                      `pose_text`
    mask       bool [H, W]: 255 where it holds, else 0           .png of 8 bits
    pixel map  float32 [H, W, 2], column and row in the other    .npz, array pixels
               camera; NaN: not known, or behind it

The suffix says how it is kept.  Each file is there as a whole or not at all.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.depth_files import read_depth, write_depth
from vid2ev.recording.disk import whole_file, write_npz
from vid2ev.recording.flow_files import read_flow, write_flow
from vid2ev.recording.pose_text import read_poses, write_poses
from vid2ev.recording.truth_arrays import as_stored, by_suffix, checked, read_npz, read_png, write_png

__all__ = [
    "read_depth",
    "read_flow",
    "read_mask",
    "read_pixel_map",
    "read_poses",
    "write_depth",
    "write_flow",
    "write_mask",
    "write_pixel_map",
    "write_poses",
]


def write_mask(path: Path, mask: np.ndarray) -> None:
    """Write a mask, bool [H, W], as .png.  Raises UsageError for what is none, OSError from the disk."""
    by_suffix(path, {".png": None}, "a mask")
    if mask.ndim != 2 or mask.dtype != bool or not mask.size:
        raise UsageError(f"{path}: a mask is bool [H, W], not {mask.dtype} {list(mask.shape)}")
    write_png(path, np.where(mask, np.uint8(255), np.uint8(0)))


def read_mask(path: Path) -> np.ndarray:
    """A mask, bool [H, W]: where the picture is not 0.  Raises DataError, UsageError if there is none."""
    codes = read_png(path)
    if codes.ndim != 2 or codes.dtype != np.uint8:
        raise DataError(f"{path}: a mask has one channel of 8 bits, not {list(codes.shape)} of {codes.dtype}")
    return codes != 0


def write_pixel_map(path: Path, pixels: np.ndarray) -> None:
    """Write where each pixel is in another camera, [H, W, 2], as .npz.  Raises UsageError for what is no such map,
    OSError from the disk."""
    by_suffix(path, {".npz": None}, "a pixel map")
    with whole_file(path) as file:
        write_npz(file, {"pixels": checked(pixels, 3, "pixel map")})


def read_pixel_map(path: Path) -> np.ndarray:
    """Where each pixel is in another camera, float32 [H, W, 2].  Raises DataError, UsageError if there is none."""
    return as_stored(read_npz(path, "pixels"), 3, path)
