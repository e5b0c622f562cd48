"""Arrays in NumPy's file format, read and written a part at a time."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.lib import format as npy

from vid2ev.untrusted import array_header as header_of

PART = 1 << 18  # rows read at a time
MOST_OF_A_PART = 1 << 25  # bytes of them
LARGEST_ROW = 1 << 12  # bytes


class Array:
    """An array in an open file: its shape and type, and its rows from first to last."""

    def __init__(self, file: BinaryIO, shape: tuple[int, ...], dtype: np.dtype):
        self.shape, self.dtype, self._file = shape, dtype, file

    def __len__(self) -> int:
        return self.shape[0] if self.shape else 1

    @property
    def row_bytes(self) -> int:
        """Bytes of a row."""
        return math.prod(self.shape[1:]) * self.dtype.itemsize

    def read(self, count: int) -> np.ndarray:
        """The next `count` rows.  Raises EOFError if they are not there."""
        shape = (count, *self.shape[1:])
        content = self._file.read(int(np.prod(shape)) * self.dtype.itemsize)
        return np.frombuffer(content, self.dtype, int(np.prod(shape))).reshape(shape)

    def read_all(self) -> np.ndarray:
        """All rows of an array that is known to be small."""
        return self.read(len(self))


def open_array(file: Any) -> Array:
    """The array in a file that is at its start.

    Raises ValueError and others for what is none, for Python objects, which could do anything when they are read, for
    arrays stored column by column, and for rows so large that they cannot be events.
    """
    shape, fortran, dtype = _header(file)
    row = int(np.prod([1, *shape[1:]], dtype=object)) * dtype.itemsize
    if dtype.hasobject or not 0 < row <= LARGEST_ROW or (fortran and len(shape) > 1):
        raise ValueError(f"{shape}, {dtype}")
    return Array(cast(BinaryIO, file), shape, dtype)


def open_columns(opened: Callable[[], Any], count: int) -> list[Array]:
    """The columns of a table of `count`, if it is one of numbers that is stored column by column, each in a file of its
    own that is `opened`; otherwise none.  Raises ValueError and others for what is no array."""
    shape, fortran, dtype = _header(opened())
    if not fortran or shape[1:] != (count,) or dtype.kind not in "iufb":
        return []
    files = [opened() for _ in range(count)]
    for number, file in enumerate(files):
        _header(file)
        file.seek(number * shape[0] * dtype.itemsize, io.SEEK_CUR)
    return [Array(file, shape[:1], dtype) for file in files]


def _header(file: Any) -> tuple[tuple[int, ...], bool, np.dtype]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # (of headers that Python 2 wrote)
        return header_of(file)


def array_header(shape: tuple[int, ...], dtype: Any) -> bytes:
    """What stands before the numbers."""
    content = io.BytesIO()
    described = npy.dtype_to_descr(np.dtype(dtype).newbyteorder("<"))
    npy.write_array_header_1_0(content, {"descr": described, "fortran_order": False, "shape": shape})
    return content.getvalue()
