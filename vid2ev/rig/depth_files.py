"""Depth maps in files: one for all frames of a video, or one for each.

    a folder                  its files in natural order (2 before 10), a map each
    .npy, .npz                [H, W], or [N, H, W] for N frames; in an .npz the only array, or the one called depth,
                              disparity, depths or disparities
    PNG, TIFF                 8 or 16 bits in steps of `scale` (0.001 for millimetres, 1/256 for KITTI's disparities),
                              which must be given; TIFF also floating point
    PNG beside a depth.txt    depth that vid2ev wrote (`recording/depth_files.py`), if no scale is given: 65535 is
                              infinitely far
    PFM                       floating point, as Middlebury's disparities
    EXR                       the channel Z, Depth.Z or the like, or the only one; needs `vid2ev[formats]`

The content decides, not the name.  What the numbers mean is in `depth.py`.

Sources: P. Debevec, J. Malik, PFM as in Middlebury's "MiddEval3 SDK"; OpenEXR, "Standard attributes and channel names";
KITTI's development kit, "Stereo evaluation 2015".
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.picture_files import read_picture
from vid2ev.light.recognise import EXR, head_of, natural, recognise
from vid2ev.recording.depth_files import is_stated, read_depth
from vid2ev.rig.depth import DepthScale
from vid2ev.untrusted import check_exr, first_line, openexr, plain_name, read_arrays

SUFFIXES = (".png", ".tif", ".tiff", ".pfm", ".exr", ".npy", ".npz")
NAMES = ("depth", "depths", "disparity", "disparities")


class DepthFiles:
    """Depth maps of a file or a folder, read when they are asked for.

    Raises UsageError if there is no such file, or codes come without a scale; DataError for a file that holds no map,
    or one of another size than `size` (width, height).
    """

    plane_m: float | None = None

    def __init__(self, path: Path, size: tuple[int, int], scale: DepthScale):
        if not path.exists():
            raise UsageError(f"{path}: no such file or folder of depth; give one, or plane:METRES, or model:NAME")
        self.path, self.size, self.scale = path, size, scale
        self._files, self._stack = [path], None
        if path.is_dir():
            found = (file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and file.name[0] != ".")
            self._files = sorted(found, key=lambda file: natural(file.name))
            if not self._files:
                raise DataError(f"{path}: no depth maps in this folder; expected {', '.join(SUFFIXES)}")
        else:
            values = read_values(path)
            self._stack = values if values.ndim == 3 else None
        maps = len(self._files) if self._stack is None else len(self._stack)
        self.count = None if maps == 1 else maps
        self._kept: dict[int, np.ndarray] = {}
        if not (self.at(0) > 0).any() and self.count is None:
            raise DataError(
                f"{path}: none of its depth is known, all of it is 0, less than that or NaN; correct the map, or the"
                " scale, shift and kind that are given"
            )

    def at(self, index: int, light: np.ndarray | None = None) -> np.ndarray:
        """The map of frame `index`."""
        if self.count is None:
            index = 0
        elif index >= self.count:
            raise DataError(
                f"{self.path}: {self.count} depth maps, but the video has more frames; give one for each or for all"
            )
        if index not in self._kept:
            file = self._files[0 if self._stack is not None else index]
            values = self._values_of(file) if self._stack is None else self._stack[index]
            depth_m = self._checked(values, file)
            self._kept = {index: depth_m}
        return self._kept[index]

    def _values_of(self, file: Path) -> np.ndarray:
        """The numbers of a file; depth [m] where it says itself what its codes mean and nothing else is said."""
        given = self.scale
        if (given.kind, given.scale, given.shift) == ("depth", None, 0) and is_stated(file):
            return read_depth(file)
        return read_values(file)

    def _checked(self, values: np.ndarray, file: Path) -> np.ndarray:
        if values.shape != self.size[::-1]:
            width, height = self.size
            shape = "x".join(map(str, values.shape[::-1]))
            raise DataError(f"{file}: depth of {shape} pixels, expected {width}x{height} like the video; resize it")
        if values.dtype.kind in "iu" and self.scale.scale is None:
            raise UsageError(
                f"{file}: {values.dtype} codes may mean any depth; give the scale of one step, such as 0.001 for mm"
            )
        return self.scale.depth_m(values)


def read_values(path: Path) -> np.ndarray:
    """The numbers of a file as they stand: [H, W], or [N, H, W].  Raises DataError if it holds none."""
    kind = recognise(path)
    if kind == "picture":
        values = _read_exr(path) if head_of(path).startswith(EXR) else read_picture(path).pixels
    elif kind in ("array", "arrays"):
        values = _read_arrays(path)
    else:
        raise DataError(f"{path}: not a depth map; expected PNG, TIFF, PFM, EXR, .npy or .npz")
    dimensions = (2, 3) if kind != "picture" else (2,)
    if values.ndim not in dimensions or values.dtype.kind not in "iuf" or 0 in values.shape:
        raise DataError(f"{path}: {values.dtype} of shape {list(values.shape)} is no depth map; expected [H, W]")
    return values


def _read_arrays(path: Path) -> np.ndarray:
    try:
        if recognise(path) == "array":
            return np.load(path, mmap_mode="r", allow_pickle=False)
        with zipfile.ZipFile(path) as archive:
            files = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
        named = [name for name in files if name in NAMES]
        if len(files) != 1 and len(named) != 1:
            held = ", ".join(files)[:200].replace("\n", " ") or "nothing"
            raise DataError(f"{path}: holds {held}; expected one array, or one called 'depth'")
        return next(iter(read_arrays(path, (named or files)[:1]).values()))
    except DataError:
        raise
    except Exception as error:  # (damaged archives raise almost anything: of zipfile, zlib, struct, numpy)
        raise DataError(
            f"{path}: cannot be read ({first_line(error, None)}); write it with numpy.save or savez"
        ) from error


def _read_exr(path: Path) -> np.ndarray:
    library = openexr(path)
    try:
        check_exr(path)
        with plain_name(path) as plain:
            file = library.File(plain, separate_channels=True, num_threads=0)
        channels = {name: channel for part in file.parts for name, channel in part.channels.items()}
        named = [name for name in channels if name.rpartition(".")[2] in ("Z", "depth", "Depth")]
        if not named and len(channels) != 1:
            raise DataError(f"{path}: EXR with the channels {', '.join(channels)}; expected Z, or one only")
        return np.array(channels[min(named, key=len) if named else next(iter(channels))].pixels)
    except DataError:
        raise
    except Exception as error:  # (the library raises RuntimeError, ValueError and more)
        raise DataError(f"{path}: not an EXR that can be read ({first_line(error, None)})") from error
