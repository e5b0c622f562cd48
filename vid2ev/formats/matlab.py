"""Files of MATLAB, of which many event data sets are: no format, as each data set calls its tables as it likes."""

from __future__ import annotations

from pathlib import Path

from vid2ev.errors import DataError
from vid2ev.formats.columns import saved_as_arrays

MAT, MAT_OF_HDF5 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"  # (5 is what versions 5 to 7.2 of MATLAB write)


def is_mat(path: Path) -> bool:
    """Whether a file is one of MATLAB's that scipy reads, by its first bytes."""
    return _begins(path, MAT)


def refuse_mat(path: Path) -> None:
    """Raise DataError for a file of MATLAB's, which says how its events become such that can be read."""
    old = is_mat(path)
    if not old and not _begins(path, MAT_OF_HDF5):
        return
    as_it_is = f"; `vid2ev interpolate` takes it as it is, with {path.stem}.png beside it" if old else ""
    how = saved_as_arrays(path, "scipy.io.loadmat" if old else "h5py.File")
    raise DataError(f"{path} is a file of MATLAB's, which calls its tables as it likes; {how}{as_it_is}")


def _begins(path: Path, magic: bytes) -> bool:
    if not path.is_file():
        return False
    with open(path, "rb") as file:
        return file.read(len(magic)) == magic
