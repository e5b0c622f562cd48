"""Planes of codes from a decoded picture, and the way up it is to be shown."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import av
import av.filter
import numpy as np

from vid2ev.errors import DataError


def planar(picture: Any, path: object) -> Any:
    """The picture in planes of whole codes: as it is, or rearranged without loss (semi-planar, packed, big-endian);
    codes of red, green or blue that have fewer bits than 8 become the nearest of 8."""
    kind = picture.format
    bits = max(component.bits for component in kind.components)
    unsupported = f"{path}: pixel format {kind.name} is not supported; convert it to 8 to 16 bits of RGB or YUV"
    if bits > 16 or "f16" in kind.name or kind.name.startswith(("bayer", "xyz")):
        raise DataError(unsupported)
    depth = "" if bits <= 8 else f"{bits}le"
    if kind.is_rgb or kind.has_palette:
        wanted = f"gbrp{depth}"
    elif len(kind.components) < 3:
        wanted = f"gray{depth}"
    else:
        chroma = {(1, 1): "420", (1, 0): "422", (0, 0): "444", (0, 1): "440", (2, 0): "411", (2, 2): "410"}
        wanted = f"yuv{chroma[halvings_of(kind.chroma_width), halvings_of(kind.chroma_height)]}p{depth}"
    if kind.name.replace("yuvj", "yuv").replace("yuva", "yuv").replace("gbrap", "gbrp") == wanted:
        return picture
    try:
        made = picture.reformat(format=wanted)
    except OSError as error:  # (swscale cannot read it)
        raise DataError(unsupported) from error
    if kind.is_rgb:
        red, green, blue = (component.bits for component in kind.components[:3])
        for plane, few in zip(made.planes, (green, blue, red), strict=True):
            if few < 8:
                _stretch(plane, few)
    return made


def _stretch(plane: Any, bits: int) -> None:
    """Bring a plane of codes of `bits` bits to those of 8: in swscale's, steps are of whole codes, and white is less
    than 255."""
    step = 1 << 8 - bits if bits > 3 else 255 // (2**bits - 1)
    codes = np.frombuffer(plane, np.uint8)
    codes[:] = np.rint(np.arange(256) * (255 / (step * (2**bits - 1)))).clip(0, 255).astype(np.uint8)[codes]


def orientation_of(picture: Any) -> tuple[bool, bool, bool]:
    """What `upright` is to do, from the display matrix of a picture: transpose, mirror left to right, flip upside down.

    The matrix [a b; c d] takes a stored place (x, y) to the place shown (a x + c y, b x + d y); other angles than
    quarter turns are taken for the nearest.  Source: ISO/IEC 14496-12 section 6.2.2 and libavutil/display.h.
    """
    a, b, c, d = _display_matrix(picture)
    return (True, c < 0, b < 0) if abs(b) > abs(a) else (False, a < 0, d < 0)


def _display_matrix(picture: Any) -> tuple[float, float, float, float]:
    """a, b, c, d."""
    matrix = _beside(picture).get("DISPLAYMATRIX")
    if matrix is None:
        return 1, 0, 0, 1
    a, b, _, c, d = np.frombuffer(matrix, np.int32)[:5].tolist()
    return a, b, c, d


def _beside(picture: Any) -> Mapping[Any, Any]:
    """What FFmpeg says beside a picture, but for colour profiles, of which PyAV frees the name that a PNG gives them
    twice, and for kinds that it has no name for, such as EXIF: it gives nothing at all beside these.  FFmpeg takes
    them away, one after the other."""
    taken = set[str]()
    picture = _without(picture, "ICC_PROFILE")
    while True:
        try:
            return picture.side_data
        except ValueError as error:
            number = re.match(r"\d+", str(error))
            if number is None or number[0] in taken:
                raise
            taken.add(number[0])
            picture = _without(picture, number[0])


def _without(picture: Any, kind: str) -> Any:
    """The same picture without what is beside it of a kind."""
    graph, (width, height) = av.filter.Graph(), (picture.width, picture.height)
    into = graph.add_buffer(None, width, height, picture.format, None, picture.time_base or Fraction(1))
    taken_away = graph.add("sidedata", f"mode=delete:type={kind}")
    graph.link_nodes(into, taken_away, graph.add("buffersink")).configure()
    graph.push(picture)
    return graph.pull()


def upright(light: np.ndarray, orientation: tuple[bool, bool, bool]) -> np.ndarray:
    """The picture as it is to be shown; the very same array if nothing is to be turned."""
    transposed, mirrored, flipped = orientation
    if not any(orientation):
        return light
    light = light.swapaxes(0, 1) if transposed else light
    return np.ascontiguousarray(light[:: -1 if flipped else 1, :: -1 if mirrored else 1])


def codes_of(plane: Any, kind: Any) -> np.ndarray:
    """Codes of a plane [rows x row length in memory]: uint8, or uint16 for more than 8 bits."""
    dtype = np.uint8 if kind.components[0].bits <= 8 else np.uint16
    rows = np.frombuffer(plane, dtype).reshape(plane.height, -1)
    return rows if plane.line_size > 0 else np.ascontiguousarray(rows[::-1])  # (of decoders that go upwards)


def halvings_of(chroma_length: Any) -> int:
    """How often chroma is halved along an axis."""
    return (64 // chroma_length(64)).bit_length() - 1
