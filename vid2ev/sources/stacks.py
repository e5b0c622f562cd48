"""Arrays [N, H, W] or [N, H, W, 3] on disk, of which one frame at a time is in memory.

    NpyStack    a .npy file, mapped
    NpzStack    an array in a .npz archive, compressed or not, read from its start on

Of an archive the array called `frames`, `images`, `video`, `light` or `arr_0` counts, or the only one with three or
four axes.  Beside it may be times, one each: `t`, `times` or `timestamps`, with `_s`, `_ms`, `_us` or `_ns` at the end
to say their unit; or a number `fps`.

Source: numpy NEP 1, "A simple file format for NumPy arrays".
"""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import Any, Protocol

import numpy as np

from vid2ev.errors import DataError
from vid2ev.untrusted import array_header, check_bytes, read_array

Shape = tuple[int, ...]
Read = Callable[[int], np.ndarray]

FRAMES = ("frames", "images", "video", "light", "arr_0")
TIMES = re.compile(r"(?:t|times|timestamps)(?:_(s|ms|us|ns))?")
BROKEN = (  # what numpy and zipfile raise for damaged files
    OSError, ValueError, TypeError, EOFError, KeyError, OverflowError,
    RuntimeError, SyntaxError, TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


class Stack(Protocol):
    """An array on disk."""

    shape: Shape
    dtype: np.dtype[Any]

    def opened(self) -> Any:
        """A context that gives a function: frame k, for k that never falls."""


class NpyStack:
    """A .npy file.  Raises DataError."""

    def __init__(self, path: Path):
        self.path = path
        mapped = self._map()
        self.shape, self.dtype = mapped.shape, mapped.dtype

    @contextmanager
    def opened(self) -> Iterator[Read]:
        """Frames are mapped anew each: pages of one long mapping would count as memory in use until its end."""
        yield lambda k: self._map()[k]

    def _map(self) -> np.ndarray:
        try:
            with np.errstate(over="ignore"):  # (of shapes that no file can hold)
                return np.load(self.path, mmap_mode="r", allow_pickle=False)
        except BROKEN as error:
            raise DataError(f"{self.path}: not a .npy array that can be read; write it with numpy.save") from error


class NpzStack:
    """The frames in a .npz archive, their times and their rate.  Raises DataError."""

    def __init__(self, path: Path):
        self.path = path
        with self._archive() as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
            headers = {name: self._header(archive, name)[0] for name in names}
            self.name = self._choice(headers)
            self.shape, self.dtype, transposed = headers[self.name]
            if transposed:
                raise DataError(
                    f"{path}: '{self.name}' is stored column by column; save numpy.ascontiguousarray of it instead"
                )
            self.times: tuple[np.ndarray, str | None] | None = None
            self.fps: float | None = None
            for name in names:
                said = TIMES.fullmatch(name)
                if said:
                    self.times = self._small(archive, name), said[1]
                elif name == "fps":
                    self.fps = float(self._small(archive, name).reshape(-1)[0])

    @contextmanager
    def opened(self) -> Iterator[Read]:
        """Frames are unpacked one after the other."""
        size = math.prod(self.shape[1:]) * self.dtype.itemsize
        check_bytes(self.path, size, f"a frame of shape {list(self.shape[1:])}")
        with self._archive() as archive:
            offset = self._header(archive, self.name)[1]
            with archive.open(f"{self.name}.npy") as member:

                def read(k: int) -> np.ndarray:
                    try:
                        if member.tell() != offset + k * size:
                            member.seek(offset + k * size)
                        codes = np.frombuffer(member.read(size), self.dtype)
                        if k == self.shape[0] - 1:
                            member.read()  # (at the end the checksum is compared)
                        return codes.reshape(self.shape[1:])
                    except BROKEN as error:
                        raise DataError(f"{self.path}: cannot be read beyond frame {k}; write it anew") from error

                yield read

    @contextmanager
    def _archive(self) -> Iterator[zipfile.ZipFile]:
        try:
            archive = zipfile.ZipFile(self.path)
        except BROKEN as error:
            raise DataError(f"{self.path}: not a .npz archive that can be read; write it with numpy.savez") from error
        with archive:
            yield archive

    def _header(self, archive: zipfile.ZipFile, name: str) -> tuple[tuple[Shape, np.dtype[Any], bool], int]:
        """Shape, type and whether it is stored column by column, of an array; and where its data begins."""
        try:
            with archive.open(f"{name}.npy") as member:
                shape, transposed, dtype = array_header(member)  # type: ignore[arg-type]
                return (shape, dtype, transposed and len(shape) > 1), member.tell()
        except BROKEN as error:
            raise DataError(f"{self.path}: its array '{name}' cannot be read; write it with numpy.savez") from error

    def _choice(self, headers: dict[str, tuple[Shape, np.dtype[Any], bool]]) -> str:
        likely = [name for name, (shape, _, _) in headers.items() if len(shape) in (3, 4)]
        named = [name for name in FRAMES if name in likely]
        if not named and len(likely) != 1:
            held = ", ".join(f"{name} {list(shape)}" for name, (shape, _, _) in headers.items())
            raise DataError(f"{self.path}: holds {held}; expected one array [N, H, W] or [N, H, W, 3] called 'frames'")
        return (named or likely)[0]

    def _small(self, archive: zipfile.ZipFile, name: str) -> np.ndarray:
        try:
            with archive.open(f"{name}.npy") as member:
                found = read_array(member, self.path)  # type: ignore[arg-type]
        except DataError:
            raise
        except BROKEN as error:
            raise DataError(f"{self.path}: its array '{name}' cannot be read; write it with numpy.savez") from error
        if found.dtype.kind not in "iuf" or found.size == 0:
            raise DataError(f"{self.path}: '{name}' is {found.dtype} of shape {found.shape}, expected numbers")
        return found
