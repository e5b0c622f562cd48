"""poses.txt: where a camera was, and how it was turned, in the format of the TUM RGB-D benchmark.

    # timestamp tx ty tz qx qy qz qw
    0.033333333 0.015 0.0 0.0 0.0 0.0 0.0 1.0

Seconds with nine decimals, metres, and a unit quaternion from the camera's coordinates to those of the world.

Source: J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, page "File formats".
"""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.decimals import decimal
from vid2ev.recording.disk import whole_file
from vid2ev.requests import number_of
from vid2ev.untrusted import read_lines

HEADER = "# timestamp tx ty tz qx qy qz qw\n"
COLUMNS = 8
NEARLY_ONE = 1e-3  # how far a quaternion of few digits may be from length 1
LATEST_S = 1 << 32


def write_poses(path: Path, t_ns: np.ndarray, positions_m: np.ndarray, quaternions: np.ndarray) -> None:
    """Write poses: instants [N] int64, positions [N, 3], unit quaternions x, y, z, w [N, 4].

    Raises UsageError for what are no poses, OSError from the disk.
    """
    lines = pose_lines(t_ns, positions_m, quaternions)
    with whole_file(path) as file:
        file.write(f"{HEADER}{lines}".encode())


def pose_lines(t_ns: np.ndarray, positions_m: np.ndarray, quaternions: np.ndarray) -> str:
    """A line for each pose, for a file that grows; the first line of the file is `HEADER`.  Raises UsageError."""
    shapes = [np.shape(each) for each in (t_ns, positions_m, quaternions)]
    if shapes != [(n := len(t_ns),), (n, 3), (n, 4)] or np.asarray(t_ns).dtype.kind not in "iu":
        found = ", ".join(str(list(shape)) for shape in shapes)
        raise UsageError(f"poses are instants [N] int64, positions [N, 3] and quaternions [N, 4]; found {found}")
    poses = np.c_[positions_m, quaternions].astype(np.float64)
    if not np.isfinite(poses).all() or any(abs(math.hypot(*pose[3:]) - 1) > NEARLY_ONE for pose in poses.tolist()):
        raise UsageError("poses are finite, and their quaternions of length 1")
    # (+ 0.0: a zero without a sign)
    return "".join(
        f"{decimal(int(t), 9)} {' '.join(repr(value + 0.0) for value in pose)}\n"
        for t, pose in zip(t_ns, poses.tolist(), strict=True)
    )


def read_poses(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants [N] int64 ns, positions [N, 3] m, unit quaternions x, y, z, w [N, 4].  Raises DataError, UsageError if
    there is no such file."""
    lines = enumerate(read_lines(path, "a file of poses"), start=1)
    rows = [(number, line.split()) for number, line in lines if _holds(line)]
    times = np.array([_nanoseconds(path, number, row) for number, row in rows], np.int64)
    poses = np.array([_numbers(path, number, row) for number, row in rows], np.float64).reshape(-1, 7)
    quaternions = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return times, poses[:, :3], quaternions


def _holds(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _nanoseconds(path: Path, number: int, row: list[str]) -> int:
    try:
        seconds = Decimal(row[0])
    except InvalidOperation:
        seconds = Decimal("nan")
    if not seconds.is_finite() or abs(seconds) > LATEST_S:
        raise DataError(f"{path}: line {number} begins with '{row[0][:40]}', not an instant in seconds; correct it")
    return int((seconds * 10**9).to_integral_value())


def _numbers(path: Path, number: int, row: list[str]) -> list[float]:
    values = [number_of(word) for word in row[1:]]
    fits = len(row) == COLUMNS and len(values) == COLUMNS - 1 and bool(np.isfinite(values).all())
    if not fits or abs(math.hypot(*values[3:]) - 1) > NEARLY_ONE:
        raise DataError(f"{path}: line {number} is no pose; expected t x y z and a unit quaternion qx qy qz qw")
    return values
