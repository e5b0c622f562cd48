"""Films that a browser plays: H.264, yuv420p, BT.709 in limited range, the index first; the same bytes each time.

The transfer curve is a tag alone: BT.709's, unless the pictures' own is given.

In 4:2:0 four pixels share their colour.  Here that is the mean of theirs, weighted by how far each is from gray:

    U = sum w u / sum w,   w = |u| + |v| + 1/100        (V alike; u, v in codes from neutral)

so that a single coloured pixel on gray ground keeps its colour; where all are alike it is the plain mean.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from math import ceil
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import av
import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.pictures.colours import BLUE, BLUE_SPAN, GREEN, NEUTRAL, RED, RED_SPAN

BT709, LIMITED = 1, 1  # codes of ITU-T H.273 and of FFmpeg
MUXER = {"movflags": "+faststart"}  # the index comes first: playing begins while the file is still loading
# (nothing that looks at shrunken pictures in advance: of narrow ones the encoder reads what it never wrote, and now and
# then makes other bytes)
NO_LOOKAHEAD = "mbtree=0:rc-lookahead=0:scenecut=0:weightp=0"
ENCODER = {"preset": "veryfast", "crf": "18", "x264-params": NO_LOOKAHEAD}
SLOWEST_HZ = Fraction(1, 10**5)  # of films
FINEST, TERMS = 10**6, 2**31 - 1  # denominators of their rates, and both terms, at the most


class Film:
    """A film of pictures of `size` (width, height), at `fps` a second or nearly (`rate_of_film`), as a context; raises
    OSError.

    Odd sides are made even, as 4:2:0 needs them: the last row or column is there twice.  `transfer` is the code of
    the curve of the pictures' codes (H.273).
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: Fraction | int, transfer: int = BT709):
        self.rate, self._transfer = rate_of_film(Fraction(fps)), transfer
        self.frames = 0
        width, height = size
        self._margin = (0, height % 2), (0, width % 2), (0, 0)
        self._container, self._stream = open_film(path, film_size(size), self.rate, ENCODER, MUXER, transfer)

    def __enter__(self) -> Self:
        return self

    def add(self, picture: np.ndarray) -> None:
        """The next picture: R'G'B' uint8 [height, width, 3]."""
        coded = planes(np.pad(picture, self._margin, mode="edge"))
        self._container.mux(self._stream.encode(film_frame(coded, self.frames, self.rate, self._transfer)))
        self.frames += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()


def write_film(path: Path, pictures: Iterable[np.ndarray], fps: Fraction | int, transfer: int = BT709) -> int:
    """A film of pictures of one size, at least one, R'G'B' uint8 [height, width, 3], of the transfer curve of a code
    (H.273); returns how many there are.  Raises OSError.
    """
    coming = iter(pictures)
    first = next(coming)
    height, width = first.shape[:2]
    with Film(path, (width, height), fps, transfer) as film:
        for picture in chain([first], coming):
            film.add(picture)
    return film.frames


def rate_of_film(rate: Fraction) -> Fraction:
    """The rate nearest to one, above 0, that a film can have."""
    slow = max(rate, SLOWEST_HZ)
    return slow.limit_denominator(max(1, min(FINEST, TERMS // ceil(slow))))


def film_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a `Film` of pictures of a size."""
    width, height = size
    return width + width % 2, height + height % 2


def remarks_on_size(name: str, size: tuple[int, int]) -> list[str]:
    """That a film of pictures of a size has another, if it does."""
    width, height = film_size(size)
    if (width, height) == tuple(size):
        return []
    last = ["the last column"] * (width > size[0]) + ["the last row"] * (height > size[1])
    twice = f"{' and '.join(last)} of {size[0]}x{size[1]} {'is' if len(last) == 1 else 'are'} there twice"
    why = f"films have even sides, so {twice}"
    return [f"{name} has {width}x{height} pixels: {why}"]


def join_films(path: Path, pieces: Iterable[tuple[Path, int]], rate: Fraction | int) -> None:
    """One film of several at a rate, without encoding them again: each with the number of its first picture in the
    whole.  They must have been made by `open_film` with one size, rate and encoder.  Raises OSError."""
    with _opened(path, "w", options=MUXER) as whole:
        stream: Any = None
        for piece, first in pieces:
            with _opened(piece, "r") as part:
                stream = stream or whole.add_stream_from_template(part.streams.video[0])
                for packet in part.demux(video=0):
                    if packet.dts is not None and packet.pts is not None and packet.time_base:
                        shift = round(first / (rate * Fraction(packet.time_base)))
                        packet.pts, packet.dts = packet.pts + shift, packet.dts + shift
                        packet.stream = stream
                        whole.mux(packet)


def open_film(
    path: Path,
    size: tuple[int, int],
    rate: Fraction,
    encoder: dict[str, str],
    muxer: dict[str, str] | None = None,
    transfer: int = BT709,
) -> tuple[Any, Any]:
    """A container to be written, and its stream; what is encoded does not depend on the machine's cores."""
    container = _opened(path, "w", options=muxer or {})
    stream = container.add_stream("libx264", rate=rate, options=encoder)
    stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
    context = stream.codec_context
    context.time_base = 1 / rate
    context.max_b_frames = 0  # pieces can then be put one after the other as they are
    context.thread_count = 1  # more would make other bits
    context.gop_size = max(1, round(4 * rate))
    context.colorspace = context.color_primaries = BT709
    context.color_trc = transfer
    context.color_range = LIMITED
    return container, stream


def _opened(path: Path, mode: Literal["r", "w"], **options: Any) -> Any:
    """A film to be read or written.  (Without `file:`, what is before a colon in a name is taken for a protocol.)"""
    return av.open(f"file:{path}", mode, format="mp4", **options)


def film_frame(picture: np.ndarray, number: int, rate: Fraction, transfer: int = BT709) -> Any:
    """Planes Y, U, V, one after the other as yuv420p has them, as the frame of a number."""
    frame = av.VideoFrame.from_ndarray(picture, format="yuv420p")
    frame.pts, frame.time_base = number, 1 / rate
    frame.colorspace = frame.color_primaries = BT709
    frame.color_trc = transfer
    frame.color_range = LIMITED
    return frame


def planes(picture: np.ndarray) -> np.ndarray:
    """Planes Y, U, V of yuv420p [3 height / 2, width] of R'G'B' uint8 [height, width, 3], both sides even."""
    height, width = picture.shape[:2]
    coded = np.empty((height * 3 // 2, width), np.uint8)
    _encode(picture, coded[:height], coded[height:].reshape(2, height // 2, width // 2))
    return coded


_RED, _GREEN, _BLUE = (np.float32(share) for share in (RED, GREEN, BLUE))
_LUMA, _U, _V = (np.float32(scale / 255) for scale in (219, 224 / BLUE_SPAN, 224 / RED_SPAN))
_LEAST, _HALF = np.float32(0.01), np.float32(0.5)


@cached
def _encode(picture, luma, chroma):  # type: ignore[no-untyped-def]
    for block_i in range(chroma.shape[1]):
        for block_j in range(chroma.shape[2]):
            u_sum = v_sum = weights = np.float32(0)
            for k in range(4):
                i, j = 2 * block_i + k // 2, 2 * block_j + k % 2
                red, green, blue = picture[i, j, 0], picture[i, j, 1], picture[i, j, 2]
                y = _RED * np.float32(red) + _GREEN * np.float32(green) + _BLUE * np.float32(blue)
                u, v = _U * (np.float32(blue) - y), _V * (np.float32(red) - y)
                weight = abs(u) + abs(v) + _LEAST
                u_sum, v_sum, weights = u_sum + weight * u, v_sum + weight * v, weights + weight
                luma[i, j] = np.uint8(np.float32(16) + _LUMA * y + _HALF)
            chroma[0, block_i, block_j] = np.uint8(np.float32(NEUTRAL) + u_sum / weights + _HALF)
            chroma[1, block_i, block_j] = np.uint8(np.float32(NEUTRAL) + v_sum / weights + _HALF)
