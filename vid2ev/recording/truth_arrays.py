"""What all files of truth have in common: arrays that are checked, pictures of codes, numbers beside them.

A picture of codes has a number that says what a code is worth, the same for all of its folder, in a file beside it:

    depth.txt: m_per_code 0.001         flow.txt: codes_per_px 128
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.picture_files import decoded
from vid2ev.recording.disk import whole_file
from vid2ev.untrusted import check_file, read_arrays, read_text

NUMBERS = {"depth.txt": ("m_per_code", 0.001), "flow.txt": ("codes_per_px", 128)}  # what each states, as an example
SMALLEST, LARGEST = 1e-9, 1e9


def by_suffix(path: Path, known: dict[str, Any], what: str) -> Any:
    """What is known for the suffix of a file.  Raises UsageError for another suffix."""
    if path.suffix not in known:
        raise UsageError(f"{path}: {what} is kept as {' or '.join(known)}, not '{path.suffix}'")
    return known[path.suffix]


def checked(values: np.ndarray, dimensions: int, what: str) -> np.ndarray:
    """An array of truth as float32, [H, W] or with 3 dimensions [H, W, 2].  Raises UsageError for another one."""
    wanted = "[H, W]" if dimensions == 2 else "[H, W, 2]"
    fits = values.ndim == dimensions and values.size and (dimensions == 2 or values.shape[2] == 2)
    if not fits or values.dtype.kind != "f":
        raise UsageError(f"{what} is float {wanted}, not {values.dtype} {list(values.shape)}")
    with np.errstate(over="ignore"):  # (what is too large for float32 becomes infinite)
        return np.ascontiguousarray(values, np.float32)


def as_stored(values: np.ndarray, dimensions: int, path: Path) -> np.ndarray:
    """The same of an array that was read.  Raises DataError."""
    try:
        return checked(values, dimensions, str(path))
    except UsageError as error:
        raise DataError(f"{error}; the file holds something else") from error


def read_npz(path: Path, name: str) -> np.ndarray:
    """An array of an .npz file.  Raises as `reading` does."""
    with reading(path):
        with zipfile.ZipFile(path) as whole:
            held = [member.removesuffix(".npy") for member in whole.namelist()]
        if name not in held:
            said = ", ".join(held)[:200].replace("\n", " ") or "none"
            raise DataError(f"{path} has no array '{name}', only {said}; give another file")
        return read_arrays(path, [name])[name]


def write_png(path: Path, picture: np.ndarray) -> None:
    """Write a picture [H, W] or [H, W, 3 (red, green, blue)], uint8 or uint16."""
    import cv2

    written, content = cv2.imencode(".png", picture if picture.ndim == 2 else picture[..., ::-1])
    if not written:
        raise UsageError(f"{path}: {picture.shape[1]}x{picture.shape[0]} pixels are too many for a PNG")
    with whole_file(path) as file:
        file.write(content.tobytes())


def read_png(path: Path) -> np.ndarray:
    """A picture as `write_png` takes it; transparency is left out.  Raises as `reading` does."""
    import cv2

    with reading(path):
        path.stat()
    found = decoded(path, cv2.IMREAD_UNCHANGED)
    if not found:
        raise DataError(f"{path}: not a PNG that can be read; get another copy")
    return found[0] if found[0].ndim == 2 else found[0][..., 2::-1]


def state_number(path: Path, name: str, value: float) -> None:
    """State a number for all of the PNGs in a folder, beside them.  Raises UsageError if another one holds there."""
    beside = path.with_name(name)
    if not beside.exists():
        with whole_file(beside) as file:
            file.write(f"{NUMBERS[name][0]} {np.asarray(value).item()!r}\n".encode())
    elif (stated := stated_number(path, name)) != value:
        raise UsageError(f"{beside} says {stated:g}, not {value:g}; write to another folder, or as before")


def stated_number(path: Path, name: str) -> float:
    """The number that is stated beside a file.  Raises DataError."""
    beside, (wanted, example) = path.with_name(name), NUMBERS[name]
    try:
        key, value = read_text(beside).split()
        number = float(value)
    except (OSError, ValueError) as error:
        raise DataError(f"{path} needs {beside} beside it, with a line such as '{wanted} {example}'") from error
    if key != wanted or not SMALLEST < number < LARGEST:
        raise DataError(
            f"{beside} holds '{key[:40]} {value[:40]}', not a line such as '{wanted} {example}'; correct it"
        )
    return number


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Whatever goes wrong with a file within becomes one sentence: UsageError if it is not there, else DataError."""
    check_file(path)
    try:
        yield
    except (DataError, UsageError):
        raise
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; give a file of truth that vid2ev wrote") from error
    except Exception as error:  # (numpy, zipfile, zlib and OpenEXR have a dozen of their own)
        raise DataError(f"{path} cannot be read: it is cut short or damaged; get another copy") from error
