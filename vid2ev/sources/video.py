"""Video files, through FFmpeg's libraries (PyAV): any container and codec they know, 8 to 16 bits.

Times are the file's own presentation times, exact.  Pictures go from the decoder's planes to luminance in linear light
in one pass (`luminance.py`), at the decoder's full depth.  FFmpeg's own conversion to RGB (swscale) is darker than the
standards by half an 8-bit code on average and nearly one at worst, at 8, 10 and 12 bits alike; it only rearranges
planes here, where that is lossless.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.luminance import YuvCode, luminance_of_rgb, luminance_of_yuv, signal_table
from vid2ev.sources.planes import codes_of, halvings_of, orientation_of, planar, upright
from vid2ev.sources.tags import BT709_WEIGHTS, WEIGHTS, is_full_range, matrix_of, transfer_of
from vid2ev.sources.times import Clock, parse_fps
from vid2ev.sources.transfer import code_table, parse_transfer
from vid2ev.stream.frames import Frame

REMEDY = "give a video, a folder of images, a .npy array or synthetic:NAME"


class Video:
    """Frames of the first video stream of a file.

    transfer  "auto" (the file's tag; BT.709 if it has none) or a name of `transfer.parse_transfer`
    fps       if given, frame k is at k / fps and the file's times do not count

    Display rotation and mirroring of the file are applied.  Frames whose time is not after the frame before are
    dropped, and frames without a time are placed by the frame rate; both are counted in `warnings`, and so is what is
    missing of a truncated file.  Raises DataError if nothing in the file can be decoded or its codes have no known
    meaning, UsageError for a transfer or fps that cannot be meant.
    """

    def __init__(self, path: str | Path, *, transfer: str = "auto", fps: float | Fraction | None = None):
        self.path = Path(path)
        self.warnings: list[str] = []
        self._fps = None if fps is None else parse_fps(fps)
        if transfer != "auto":
            parse_transfer(transfer)
        with self._opened() as (container, stream):
            self._rate = stream.average_rate or stream.guessed_rate
            self._planned = stream.frames
            self._end_s = announced_end_s(container, stream)
            self._codec = stream.codec_context.name
            first = next(self._pictures(container, stream, []), None)
        if first is None:
            raise DataError(f"{self.path}: no frame in it can be decoded; {REMEDY}")
        self.frames_expected = self._planned or self._estimate()
        self._transfer = transfer_of(first.color_trc, transfer)
        self._tables: dict[Any, np.ndarray] = {}
        self._orientation = orientation_of(first)
        self._coded_size = (first.width, first.height)
        self.size = self._coded_size if not self._orientation[0] else self._coded_size[::-1]
        if first.interlaced_frame:
            self.warnings.append("interlaced video: both fields of a frame are taken for one instant")
        self._about = self._describe(first)
        self._light(first)  # (what cannot be read is refused now, not in the middle of a conversion)

    def describe(self) -> dict[str, Any]:
        """Facts about the file, for the manifest."""
        return dict(self._about)

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on; earlier ones are decoded and passed over, which is exact for any file."""
        clock, index, remarks = Clock(self._fps, self._rate), 0, list[str]()
        picture = None
        with self._opened() as (container, stream):
            for picture in self._pictures(container, stream, remarks):
                t_ns = clock.next(_stamp(picture))
                if t_ns is None:
                    continue
                if index >= start:
                    yield Frame(self._light(picture), t_ns)
                index += 1
        remarks += [*clock.remarks(), *self._cut_short(picture)]
        self.warnings.extend(remark for remark in remarks if remark not in self.warnings)

    # ------------------------------------------------------------------------------------------------- decoding

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, Any]]:
        try:
            # `file:` and the whitelist keep playlists and odd file names from opening anything but local files
            container = av.open(f"file:{self.path}", options={"protocol_whitelist": "file"})
        except (av.FFmpegError, ValueError) as error:
            raise DataError(f"{self.path}: not a video that can be read ({_reason(error)}); {REMEDY}") from error
        with container:
            if container.format.name.endswith("_pipe") or container.format.name == "image2":
                raise UsageError(f"{self.path}: a single picture; give the folder that holds the sequence")
            streams = [s for s in container.streams.video if not s.disposition & s.disposition.attached_pic]
            if not streams or container.format.name == "tty":  # (FFmpeg draws text files as video)
                raise DataError(f"{self.path}: holds no video stream; {REMEDY}")
            streams[0].thread_type = "AUTO"
            yield container, streams[0]

    def _pictures(self, container: Any, stream: Any, remarks: list[str]) -> Iterator[Any]:
        """Decoded pictures in order of presentation; what could not be read is told in `remarks` at the end."""
        whole = broken = 0
        for packet in _packets(container, stream, remarks):
            if packet.is_corrupt:  # (cut off in the middle; the decoder would invent the rest)
                broken += 1
                continue
            whole += packet.size > 0
            try:
                pictures = packet.decode()
            except av.FFmpegError:
                broken += 1
                continue
            yield from pictures
        if broken:
            remarks.append(f"damaged packets of the file left out: {broken}")
        if whole + broken < self._planned:
            remarks.append(f"truncated: the file holds {whole} of the {self._planned} frames it announces")

    def _cut_short(self, last: Any) -> list[str]:
        """A remark if a file that announces no number of frames ends well before the time it announces."""
        stamp = None if last is None else _stamp(last)
        if self._planned or self._end_s is None or stamp is None or not self._rate:
            return []
        seen_s = stamp + max(2 / self._rate, (last.duration or 0) * Fraction(last.time_base))
        if seen_s >= self._end_s:
            return []
        return [f"truncated: the file ends at {float(stamp):.3f} s of the {float(self._end_s):.3f} s it announces"]

    def _estimate(self) -> int | None:
        """The number of frames, from duration and rate."""
        return max(1, round(self._end_s * self._rate)) if self._end_s and self._rate else None

    # ------------------------------------------------------------------------------------------------- to light

    def _light(self, picture: Any) -> np.ndarray:
        """Luminance [float32, H x W] of a decoded picture, upright."""
        if (picture.width, picture.height) != self._coded_size:
            raise DataError(
                f"{self.path}: the picture size changes to {picture.width}x{picture.height} in the middle of the video;"
                " cut it into clips of one size"
            )
        picture = planar(picture, self.path)
        planes = [codes_of(plane, picture.format) for plane in picture.planes]
        bits, name = picture.format.components[0].bits, picture.format.name
        full = is_full_range(picture.color_range, name)
        weights = WEIGHTS.get(picture.color_primaries, BT709_WEIGHTS)
        if name.startswith("yuv"):
            halvings = (halvings_of(picture.format.chroma_width), halvings_of(picture.format.chroma_height))
            code = YuvCode(bits, full, matrix_of(picture.colorspace, *self._coded_size, self.path), halvings)
            light = luminance_of_yuv(planes[:3], self._coded_size, code, self._table(None, True), weights)
        else:
            green, blue, red = planes[:3] if name.startswith("gbr") else planes[:1] * 3
            light = luminance_of_rgb((red, green, blue), self._coded_size, self._table(bits, full), weights)
        return upright(light, self._orientation)

    def _table(self, bits: int | None, full_range: bool) -> np.ndarray:
        if (bits, full_range) not in self._tables:
            made = signal_table(self._transfer) if bits is None else code_table(self._transfer, bits, full_range)
            self._tables[bits, full_range] = made
        return self._tables[bits, full_range]

    def _describe(self, first: Any) -> dict[str, Any]:
        transposed, mirrored, flipped = self._orientation
        return {
            "kind": "video",
            "path": str(self.path),
            "size": list(self.size),
            "codec": self._codec,
            "pixel_format": first.format.name,
            "bits": first.format.components[0].bits,
            "transfer": self._transfer,
            "range": "full" if is_full_range(first.color_range, planar(first, self.path).format.name) else "limited",
            "transposed": transposed,
            "mirrored": mirrored,
            "flipped": flipped,
            "rate": None if self._rate is None else str(self._rate),
            "fps": None if self._fps is None else str(self._fps),
            "frames_expected": self.frames_expected,
        }


def _packets(container: Any, stream: Any, remarks: list[str]) -> Iterator[Any]:
    """The packets of a stream as far as the file can be read, the last one empty: for it a decoder gives its rest."""
    try:
        yield from container.demux(stream)
    except av.FFmpegError as error:
        remarks.append(f"the file cannot be read to its end ({_reason(error)})")
        rest = av.Packet()
        rest.stream, rest.time_base = stream, stream.time_base
        yield rest


def _stamp(picture: Any) -> Fraction | None:
    """Presentation time [s] of a picture."""
    return None if picture.pts is None else picture.pts * Fraction(picture.time_base)


def announced_end_s(container: Any, stream: Any) -> Fraction | None:
    """Where the stream ends [s] by the header: its tag (Matroska), or the duration if the file holds nothing else."""
    tag = re.fullmatch(r"(\d+):(\d+):(\d+(?:\.\d+)?)", stream.metadata.get("DURATION", ""))
    if tag:
        hours, minutes, seconds = map(Fraction, tag.groups())
        return 3600 * hours + 60 * minutes + seconds
    if container.duration and len(container.streams) == 1:
        return Fraction(container.duration, 10**6)
    return None


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
