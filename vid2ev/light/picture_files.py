"""Files of pictures: pixels, and which colours red, green and blue are in them.

OpenCV reads PNG, JPEG, TIFF, BMP, PNM, PFM, WebP, JPEG 2000 and Radiance HDR, and turns them as their EXIF says; PAM
and PNM of text it is given as PNM of bytes (`netpbm`), and some WebP with EXIF that it can read (`webp`).  The package
OpenEXR reads EXR.  A PNG says what its codes stand for (`png_tags`).  Transparency is left out.  Of an EXR with several
parts or layers the first with colour counts: R, G, B or else Y.  Its data window is set into its display window, black
around, and its chromaticities hold.

Sources: OpenEXR, "Technical introduction" (windows, layers, standard attributes); Exif 2.32 tag 0x0112.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import DataError
from vid2ev.light.bmp import check_bmp
from vid2ev.light.icc import profile_name, remarks_on_profile
from vid2ev.light.netpbm import PAM, TEXT, plain_pnm, white_of_pnm
from vid2ev.light.pictures import TYPES, white_of
from vid2ev.light.png_tags import png_tags, remarks_on_png
from vid2ev.light.primaries import Primaries, primaries_at
from vid2ev.light.recognise import BMP, EXR, PNG, TIFF, head_of, is_webp
from vid2ev.light.tiff_tags import check_tiff, packed_bits
from vid2ev.light.webp import without_mark
from vid2ev.untrusted import LARGEST, check_exr, check_png, first_line, openexr, plain_name

AHEAD = 1 << 25  # bytes of pages that are read at once


class Picture(NamedTuple):
    """Pixels [H, W] or [H, W, 3 (red, green, blue)]; the primaries are those of BT.709 if the file names no others, and
    the transfer curve of codes that of sRGB."""

    pixels: np.ndarray
    primaries: Primaries | None = None
    transfer: str | None = None


def pages_of(path: Path) -> int:
    """How many pictures the file holds: the pages of a TIFF, otherwise one."""
    import cv2

    if not head_of(path).startswith(TIFF):
        return 1
    with _silent_decoders(), plain_name(path) as name:
        return max(1, cv2.imcount(name))


def read_picture(path: Path, page: int = 0) -> Picture:
    """A picture, upright.  Raises DataError for a file that holds none, UsageError for an EXR without the package."""
    head = head_of(path)
    if head.startswith(EXR):
        return _checked(_read_exr(path), path)
    pixels = _read(path, page)[0]
    transfer, primaries = png_tags(path) if head.startswith(PNG) else (None, None)
    return _checked(Picture(pixels, primaries, transfer), path)


def white_in(path: Path) -> int | None:
    """The code that is white in a file, where it is not the largest of 8 or 16 bits."""
    if head_of(path).startswith(TIFF):
        bits = packed_bits(path)
        return white_of(bits) if bits else None
    return white_of_pnm(path)


def remarks_on_tags(path: Path, pixels: np.ndarray) -> list[str]:
    """That a file says of its codes what is not taken up; of light, which has no codes, nothing is said."""
    if pixels.dtype.kind == "f":
        return []
    return remarks_on_png(path) if head_of(path).startswith(PNG) else remarks_on_profile(path, profile_name(path))


class PageReader:
    """Reads the pages of a TIFF, some at a time: to find one, OpenCV walks through all before it."""

    def __init__(self, path: Path):
        self._path, self._first = path, 0
        self._pages: list[np.ndarray] = []

    def read(self, page: int) -> Picture:
        """A page; quick for pages in order."""
        if not self._first <= page < self._first + len(self._pages):
            self._first, self._pages = page, []
            one = read_picture(self._path, page).pixels
            self._pages = [one] if one.nbytes > AHEAD else _read(self._path, page, AHEAD // one.nbytes)
        return _checked(Picture(self._pages[page - self._first]), self._path)


def _checked(picture: Picture, path: Path) -> Picture:
    dtype = picture.pixels.dtype
    if dtype not in (np.uint8, np.uint16) and dtype.kind != "f":
        raise DataError(f"{path}: pixels of type {dtype}, expected {TYPES}")
    return picture


def decoded(path: Path, flags: int, page: int = 0, count: int = 1) -> list[np.ndarray]:
    """What OpenCV makes of a file, blue first, [H, W] or [H, W, C]; of a TIFF pages from `page` on, at most `count`,
    in the codes that it holds.

    flags   cv2.IMREAD_...
    Nothing for a file that it cannot read.  Raises DataError for one that claims more memory than it may.
    """
    import cv2

    head = head_of(path)
    if head.startswith(PNG):
        check_png(path)
    try:
        with _silent_decoders(), plain_name(path) as name:
            if head.startswith(TIFF):  # (imread gives up on pages that are to be turned)
                pages, bits = cv2.imreadmulti(name, page, count, flags=flags)[1], packed_bits(path)
                return [np.right_shift(page, 16 - bits) if bits and page.dtype == np.uint16 else page for page in pages]
            anew = plain_pnm(path) if head.startswith((*TEXT, PAM)) else without_mark(path) if is_webp(head) else None
            one = cv2.imread(name, flags) if anew is None else cv2.imdecode(np.frombuffer(anew, np.uint8), flags)
            return [] if one is None else [one]
    except (cv2.error, ValueError, KeyError, OverflowError) as error:
        if "MAX_IMAGE" not in str(error):
            return []
        raise DataError(
            f"{path}: has more pixels than are allowed; if that is meant, set {LARGEST} in the environment"
        ) from error


@contextmanager
def _silent_decoders() -> Iterator[None]:
    """OpenCV says nothing meanwhile, as of each tag of a TIFF that it does not know: what is wrong is said by who
    asks."""
    import cv2

    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def _read(path: Path, page: int, count: int = 1) -> list[np.ndarray]:
    """Pictures from a page on, as many as there are up to `count`.  Raises DataError if there is none."""
    import cv2

    head = head_of(path)
    if head.startswith(TIFF):
        check_tiff(path)
    elif head.startswith(BMP):
        check_bmp(path)
    found = decoded(path, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH, page, count)
    if not found:
        raise DataError(f"{path}: not an image that can be read; remove it or write it anew")
    return [pixels if pixels.ndim == 2 else pixels[..., 2::-1] for pixels in found]


def _read_exr(path: Path) -> Picture:
    library = openexr(path)
    check_exr(path)
    try:
        # (one thread: pictures are read in turn with work that has threads of its own)
        with plain_name(path) as name:
            file = library.File(name, separate_channels=True, num_threads=0)
        parts = [(part.header, part.channels) for part in file.parts]
    except Exception as error:  # (the library raises RuntimeError, ValueError and more)
        raise DataError(f"{path}: not an EXR that can be read ({first_line(error)})") from error
    for header, channels in parts:
        names = _colour_channels(list(channels))
        if names and all(channels[name].xSampling == channels[name].ySampling == 1 for name in names):
            planes = [channels[name].pixels for name in names]
            pixels = planes[0] if len(planes) == 1 else np.dstack(planes)
            return Picture(_in_display_window(pixels, header), _primaries(header, path))
    found = ", ".join(name for _, channels in parts for name in channels)
    raise DataError(f"{path}: EXR with the channels {found}; expected R, G, B or Y")


def _colour_channels(names: list[str]) -> list[str]:
    """The channels of the first layer with R, G, B, or else with Y; the layer without a name comes first."""
    layers = sorted({name.rpartition(".")[0] for name in names}, key=lambda layer: (bool(layer), layer))
    for wanted in ("RGB", "Y"):
        for layer in layers:
            found = [f"{layer}.{letter}".lstrip(".") for letter in wanted]
            if all(name in names for name in found):
                return found
    return []


def _in_display_window(pixels: np.ndarray, header: dict[str, Any]) -> np.ndarray:
    (x0, y0), _ = (np.asarray(corner).tolist() for corner in header["dataWindow"])
    (left, top), (right, bottom) = (np.asarray(corner).tolist() for corner in header["displayWindow"])
    width, height = right - left + 1, bottom - top + 1
    if (x0, y0) == (left, top) and pixels.shape[:2] == (height, width):
        return pixels
    shown = np.zeros((height, width, *pixels.shape[2:]), pixels.dtype)
    rows = slice(max(y0, top), min(y0 + pixels.shape[0], bottom + 1))
    columns = slice(max(x0, left), min(x0 + pixels.shape[1], right + 1))
    if rows.start < rows.stop and columns.start < columns.stop:
        part = pixels[rows.start - y0 : rows.stop - y0, columns.start - x0 : columns.stop - x0]
        shown[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left] = part
    return shown


def _primaries(header: dict[str, Any], path: Path) -> Primaries | None:
    values = header.get("chromaticities")
    if values is None:
        return None
    numbers = [float(value) for value in np.ravel(np.array(values))]
    try:
        return primaries_at(list(zip(numbers[::2], numbers[1::2], strict=True)))
    except ValueError as error:
        raise DataError(f"{path}: {error}; correct the attribute 'chromaticities'") from error
