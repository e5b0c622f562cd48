"""Files that nobody vouches for: how much memory they may claim, and where the files that they name may be.

A header of a few bytes can claim more memory than there is, and a compressed file hold a thousand times its size.
What one file would put into memory at a time is therefore bounded: by VID2EV_LARGEST_MB in the environment, or 4096.
Files that a file names are in its folder or below; VID2EV_PATHS=anywhere lifts that, for files that one trusts.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
import tempfile
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy

from vid2ev.errors import DataError, UsageError

LARGEST, PATHS = "VID2EV_LARGEST_MB", "VID2EV_PATHS"
DEFAULT_MB = 4096
DIGITS = 9  # of a limit [MB]
TEXT_MB = 16  # of a text in which people write, or which says what a recording is
DEEPEST = 40  # brackets in brackets of YAML
LONGEST_NAME, LONGEST_PATH = 255, 4095  # bytes that file systems, and Linux, allow


def most_bytes() -> int:
    """What one file may put into memory at a time.  Raises UsageError for a limit that is no number."""
    text = os.environ.get(LARGEST, str(DEFAULT_MB))
    if not text.isdecimal() or len(text) > DIGITS:
        raise UsageError(f"{LARGEST}={text[:40]}: expected a whole number of megabytes, such as {DEFAULT_MB}")
    return int(text) << 20


def check_bytes(path: Path | str, count: int, what: str = "its content") -> None:
    """Raise DataError, with the remedy, where a file asks for more memory than it may."""
    if count > most_bytes():
        claimed, most = -(-count >> 20), most_bytes() >> 20
        raise DataError(
            f"{path}: {what} would take {claimed:,} MB of memory, and {most:,} are allowed; if that is meant, set"
            f" {limit_for(count)}"
        )


def limit_for(count: int) -> str:
    """What to set so that so many bytes are allowed."""
    return f"{LARGEST}={min(-(-count >> 20), 10**DIGITS - 1)} in the environment"


def check_file(path: Path) -> None:
    """Raise DataError for a pipe: whoever opens it waits for somebody to write, and what is read of it is gone; and
    for a device: its size says nothing of what it gives, which may have no end."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):  # (whoever opens it says what is wrong)
        return
    if stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
        what = "pipe" if stat.S_ISFIFO(mode) else "device"
        raise DataError(f"{path}: a {what}, expected a file; write to a file what comes out of it, and give that")


def read_text(path: Path) -> str:
    """A text in UTF-8, without the mark that Windows puts before it.

    Raises OSError, UnicodeDecodeError, DataError for a pipe, and for one that is too long to be meant.
    """
    check_file(path)
    size = path.stat().st_size if path.is_file() else 0
    if size > TEXT_MB << 20:
        raise DataError(f"{path}: {size:,} bytes are too many for such a text; expected at most {TEXT_MB} MB")
    return path.read_text(encoding="utf-8-sig")


def read_lines(path: Path, expected: str) -> list[str]:
    """The lines of a text that may be long, such as one with a line for each frame.

    Raises UsageError if there is no such file, DataError for what is not `expected`: a pipe, no text, more than one
    file may put into memory, what cannot be read.
    """
    check_file(path)
    check_bytes(path, os.path.getsize(path) if os.path.isfile(path) else 0)  # (Path's raise OSError for long names)
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; expected {expected}") from error
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise DataError(f"{path} cannot be read: {reason}; expected {expected}") from error


def check_depth(path: Path, text: str) -> None:
    """Raise DataError for YAML with more brackets in brackets than anybody writes.

    What reads it looks at all that are open with each word, and calls itself with each of them.
    """
    depth = 0
    for bracket in re.findall(r"[\[\]{}]", text):
        depth += 1 if bracket in "[{" else -1
        if depth > DEEPEST:
            raise DataError(f"{path} is nested too deeply: more than {DEEPEST} brackets are open; get another copy")


def json_of(text: str | bytes) -> Any:
    """What a text in JSON says.  Raises ValueError for what is none, also for what is nested too deeply and for numbers
    too large to be one."""
    try:
        return json.loads(text, parse_float=_finite)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def _finite(text: str) -> float:
    number = float(text)
    if math.isinf(number):
        raise ValueError(f"{text[:20]} is too large for a number")
    return number


def array_header(file: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether it is stored column by column, and type of the array of a .npy file that is at its start.

    Raises ValueError for what is none.
    """
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    try:
        return read(file)  # type: ignore[no-any-return]
    except TypeError as error:  # (numpy puts the names in there in order without looking what they are)
        raise ValueError("no header of an array") from error


def read_array(file: BinaryIO, path: Path | str) -> np.ndarray:
    """The array of a .npy file that is at its start.

    Raises DataError where it is too large; ValueError and all that numpy and zipfile have for damage, for Python
    objects, too.
    """
    begin = file.tell()
    shape, _, dtype = array_header(file)
    check_bytes(path, math.prod(shape) * max(dtype.itemsize, 1), f"an array of shape {list(shape)[:9]}")
    file.seek(begin)
    return npy.read_array(file, allow_pickle=False)


def read_arrays(path: Path, names: Iterable[str] | None = None) -> dict[str, np.ndarray]:
    """The arrays of a .npz file, or those of them with these names.  Raises as `read_array`."""
    check_file(path)
    with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
        members = {name.removesuffix(".npy"): name for name in archive.namelist() if name.endswith(".npy")}
        wanted = members if names is None else {name: members[name] for name in names if name in members}
        check_bytes(path, sum(archive.getinfo(member).file_size for member in wanted.values()))
        found = {}
        for name, member in wanted.items():
            with archive.open(member) as content:
                found[name] = read_array(content, path)  # type: ignore[arg-type]
        return found


def openexr(of: Path | str) -> Any:
    """The library that reads and writes EXR, which something asks for.  Raises UsageError where it is not installed."""
    try:
        import OpenEXR
    except ImportError as error:
        raise UsageError(f"{of}: EXR needs a package that is not installed; pip install 'vid2ev[formats]'") from error
    return OpenEXR


def check_exr(path: Path) -> None:
    """Raise DataError for an EXR whose header claims more memory than it may, before the library takes it at its word.
    What is damaged otherwise the library finds out."""
    try:
        with plain_name(path) as name:
            parts = [part.header for part in openexr(path).File(name, header_only=True).parts]
        bytes_ = 0
        for header in parts:
            for name in ("dataWindow", "displayWindow"):
                (left, top), (right, bottom) = (np.asarray(corner).tolist() for corner in header[name])
                channels = max(len(header.get("channels", ())), 1)
                bytes_ += max(right - left + 1, 0) * max(bottom - top + 1, 0) * 4 * channels
    except Exception as error:  # (the library raises RuntimeError, ValueError and more)
        raise DataError(f"{path}: not an EXR that can be read ({first_line(error)})") from error
    check_bytes(path, bytes_, "its pixels")


def check_png(path: Path) -> None:
    """Raise DataError for a PNG that has a part that goes on beyond the end of the file: OpenCV makes room for as much
    as it says, up to 4 GB, before it reads.
    """
    size = path.stat().st_size
    with open(path, "rb") as file:
        cut = any(end > size for _, _, end in png_chunks(file))
    if cut:
        raise DataError(f"{path}: not an image that can be read (it is cut short); remove it or write it anew")


def png_chunks(file: BinaryIO) -> Iterator[tuple[bytes, int, int]]:
    """The parts of a PNG up to the one that ends it, or as far as the file goes: name, length of the content, which the
    file is at, and where the part ends, which may be beyond the file."""
    end, kind = len(b"\x89PNG\r\n\x1a\n"), b""
    while kind != b"IEND":
        file.seek(end)
        if not (head := file.read(8)):
            return
        length, kind = int.from_bytes(head[:4], "big"), head[4:]
        end += 12 + length
        yield kind, length, end


def first_line(error: Exception, most: int | None = 200) -> str:
    """What an error of others says, as a clause of at most so many characters; None for all of its first line."""
    return (str(error).splitlines() or [type(error).__name__])[0][:most]


def beside(file: Path, name: str) -> Path:
    """The place of a file that another one names.  Raises UsageError where that is neither in its folder nor below, and
    for names that no file can have.

    What counts is the name: a link in the folder may lead anywhere, since whoever made it could read the file.
    """
    folder = os.path.abspath(file.parent)
    place = os.path.normpath(os.path.join(folder, name))
    if os.environ.get(PATHS) != "anywhere" and os.path.commonpath([folder, place]) != folder:
        raise UsageError(
            f"{file} names {name}, which is not in its folder or below; put it there, or set {PATHS}=anywhere in the"
            " environment if the file is to be trusted"
        )
    if not possible(place):
        raise UsageError(f"{file} names {name}: expected the name of a file, which has {LONGEST_NAME} bytes at most")
    return Path(place)


def possible(place: str) -> bool:
    """Whether a file can have this name."""
    longest = max(len(part.encode(errors="replace")) for part in place.split(os.sep))
    return "\0" not in place and longest <= LONGEST_NAME and len(place.encode(errors="replace")) <= LONGEST_PATH


@contextmanager
def plain_name(path: Path) -> Iterator[str]:
    """A name in UTF-8 by which a library that takes no other finds the file meanwhile: its own wherever that will do,
    otherwise that of a link.

    A file may be called by any bytes.  Python keeps those that are no text as surrogates, and OpenCV ends the program
    at them; where a locale is not UTF-8, it looks for another file.  (Decoded from memory, as most pictures can be, a
    TIFF may not have 2 GB.)  Raises DataError where no link can be made.
    """
    if _is_utf8(str(path)):
        yield str(path)
        return
    try:
        folder = tempfile.TemporaryDirectory(prefix="vid2ev_")
    except OSError as error:
        raise DataError(_without_link(path, error.strerror)) from error
    with folder as place:
        if not _is_utf8(place):
            raise DataError(_without_link(path, "the folder for temporary files has no name in UTF-8 either"))
        link = Path(place, "file")
        try:
            link.symlink_to(path.absolute())
        except OSError as error:
            raise DataError(_without_link(path, error.strerror)) from error
        yield str(link)


def _is_utf8(name: str) -> bool:
    """Whether the bytes by which the system knows a file are those that UTF-8 has for its name."""
    try:
        return name.encode() == os.fsencode(name)
    except UnicodeEncodeError:
        return False


def _without_link(path: Path, why: str | None) -> str:
    return f"{path}: a name that is not UTF-8, and no link to it can be made ({why}); rename it, or set TMPDIR"
