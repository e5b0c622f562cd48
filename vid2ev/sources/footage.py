"""Where decoded pictures come from: a video file, a pipe, whose bytes are kept, or a camera, which passes once.

Both give PyAV's pictures in order of presentation, and what is damaged costs no more than it has to.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any, Protocol

import av

from vid2ev.errors import DataError, UsageError
from vid2ev.light.recognise import is_animated_png, recognise
from vid2ev.sources.avi import stamps_in_order
from vid2ev.sources.ends import TAIL, remarks_on_end
from vid2ev.sources.ffv1 import is_sound
from vid2ev.sources.kept import Kept, Reader
from vid2ev.sources.matroska import missing_bytes

REMEDY = "give a video, a folder of images, a .npy or .npz array or synthetic:NAME"
STREAMS = "Y4M, Matroska, MPEG-TS or fragmented MP4"
DURATION = re.compile(r"(\d{1,9}):(\d{1,9}):(\d{1,9}(?:\.\d{1,99})?)")  # hours, minutes, seconds
ANY_TEXT = "replace"  # of titles and remarks, which may be of any bytes
SEEKABLE = ("mp4", "matroska")  # containers with an index, and a presentation time for every picture
STEPS_BACK_S = (0, 2, 10)  # how far before the place a key frame is looked for


class Footage(Protocol):
    """Pictures of one clip, and what is known of it before the first."""

    name: str
    kind: str
    rewindable: bool
    codec: str
    rate: Fraction | None  # nominal, frames per second
    pixel_shape: Fraction  # width of a stored pixel by its height, 1 if nobody says
    streams: int  # of video, of which this is the first
    planned: int  # frames by the header, 0 if it does not say
    end_s: Fraction | None  # by the header, on the clock of the pictures
    first: Any  # the first picture
    missing: int  # bytes of the file by its header, 0 if it does not say

    @property
    def kept(self) -> Kept | None:
        """What was read of what passes once."""

    def pictures(self, remarks: list[str], since_s: Fraction | None = None) -> Iterator[Any]:
        """The pictures; some of those before `since_s` may be left out.  `remarks` is told what could not be read."""


class VideoFile:
    """The first video stream of a file."""

    kind = "video"
    rewindable = True
    kept = None

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.name = str(path)
        self.missing = missing_bytes(self.path) if self.path.is_file() else 0
        # FFmpeg takes one for a still where it says that it moves behind a large profile
        self._format = "apng" if self.path.is_file() and is_animated_png(self.path) else None
        with self._opened() as (container, stream):
            self.rate, self.pixel_shape, self.codec, self.streams = _said_of(stream)
            self.planned = _announced(container, stream)
            self._indexed = any(name in container.format.name.split(",") for name in SEEKABLE)
            self.first = _first(container, stream, self.planned, self.name, REMEDY)
            self.end_s = announced_end_s(container, stream, stamp_of(self.first) or Fraction(0))

    def pictures(self, remarks: list[str], since_s: Fraction | None = None) -> Iterator[Any]:
        """The pictures from the first one on, or from a key frame before `since_s`, where such a one is known."""
        if since_s is not None and self._indexed:
            for back_s in STEPS_BACK_S:
                with self._opened() as (container, stream):
                    yet: list[str] = []
                    found = _sought(container, stream, since_s - back_s, since_s, yet)
                    if found is not None:
                        yield from found
                        remarks += yet
                        return
        with self._opened() as (container, stream):
            yield from _decoded(container, stream, self.planned, remarks)
            remarks += remarks_on_end(container.format.name, self._tail())

    def _tail(self) -> bytes:
        """The last bytes of the file; none if it was moved away meanwhile, which costs no picture."""
        try:
            with open(self.path, "rb") as file:
                file.seek(-min(TAIL, file.seek(0, os.SEEK_END)), os.SEEK_END)
                return file.read()
        except OSError:
            return b""

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, Any]]:
        try:
            # `file:` and the whitelist keep playlists and odd file names from opening anything but local files
            whitelist = {"protocol_whitelist": "file"}
            container = av.open(f"file:{self.path}", format=self._format, options=whitelist, metadata_errors=ANY_TEXT)
        except (av.FFmpegError, ValueError) as error:
            raise DataError(f"{self.path}: not a video that can be read ({reason(error)}); {REMEDY}") from error
        with container:
            if container.format.name == "image2":  # (by the name alone)
                raise DataError(f"{self.path}: named as a picture is, but not one that can be read; {REMEDY}")
            if container.format.name == "webp_pipe" and recognise(self.path) == "video":
                raise DataError(
                    f"{self.path}: an animated WebP, of which this FFmpeg decodes nothing; make a video, an animated"
                    " PNG or a folder of pictures of it"
                )
            stream = None if container.format.name.endswith("_pipe") else video_stream(container, self.name)
            if stream is None or _is_still(stream):  # (those that are read are no matter of FFmpeg's)
                raise UsageError(f"{self.path}: a single picture, of a kind that is not read; make a PNG or TIFF of it")
            yield container, stream


class Piped:
    """A video in a stream of bytes that passes once, read only as its pictures are taken.  It can be read again where
    `kept.wanted` was set before the first time."""

    kind = "pipe"
    rewindable = False
    planned = missing = 0

    def __init__(self, kept: Kept):
        self.name, self.kept = kept.name, kept
        with self._opened(kept.reader()) as (container, stream):
            self.rate, self.pixel_shape, self.codec, self.streams = _said_of(stream)
            self.first = _first(container, stream, 0, self.name, f"pipe {STREAMS} into it")
            kept.wanted = False
            self.end_s = announced_end_s(container, stream, stamp_of(self.first) or Fraction(0))

    def pictures(self, remarks: list[str], since_s: Fraction | None = None) -> Iterator[Any]:
        """The pictures from the first one on.  Raises UsageError if they are not kept any more."""
        reader = self.kept.reader(TAIL)
        with self._opened(reader) as (container, stream):
            yield from _decoded(container, stream, 0, remarks)
            remarks += remarks_on_end(container.format.name, reader.tail)

    @contextmanager
    def _opened(self, reader: Reader) -> Iterator[tuple[Any, Any]]:
        try:
            container = av.open(reader, options={"protocol_whitelist": ""}, metadata_errors=ANY_TEXT)
        except (av.FFmpegError, ValueError) as error:
            raise DataError(
                f"{self.name}: not a video that can be read from a pipe ({reason(error)}); pipe {STREAMS} in, or give"
                " the file"
            ) from error
        with container:
            stream = video_stream(container, self.name)
            if _is_still(stream):
                raise UsageError(
                    f"{self.name}: a single picture; pipe {STREAMS} in, or give a PNG of it with --motion pan"
                )
            yield container, stream


class LiveStream:
    """A video that passes once: an open container (of a camera), read only as its pictures are taken."""

    kind = "camera"
    rewindable = False
    kept = None
    planned = missing = 0
    end_s: Fraction | None = None

    def __init__(self, container: Any, name: str):
        self.name = name
        stream = video_stream(container, name)
        self.rate, self.pixel_shape, self.codec, self.streams = _said_of(stream)
        self._remarks: list[str] = []
        self._coming: Iterator[Any] | None = _decoded(container, stream, 0, self._remarks)
        self._container = container  # (closed with the last reference to it)
        self.first = next(self._coming, None)
        if self.first is None:
            raise DataError(f"{name}: gives no picture that can be decoded; look whether it works elsewhere")

    def pictures(self, remarks: list[str], since_s: Fraction | None = None) -> Iterator[Any]:
        """The pictures, the first one too; a second time raises UsageError."""
        coming, self._coming = self._coming, None
        if coming is None:
            raise UsageError(f"{self.name}: can be read once only; save what it gives as a file to read it again")
        yield from chain([self.first], coming)
        remarks += self._remarks


def video_stream(container: Any, name: str) -> Any:
    """The first video stream that is no cover picture.  Raises DataError."""
    streams = _video_streams(container)
    if not streams or container.format.name == "tty":  # (FFmpeg draws text files as video)
        raise DataError(f"{name}: holds no video stream; {REMEDY}")
    if streams[0].codec_context is None:
        raise DataError(f"{name}: its video is in a codec that is not known; convert it to H.264 or FFV1")
    streams[0].thread_type = "AUTO"
    return streams[0]


def _video_streams(container: Any) -> list[Any]:
    """Those that are no cover pictures, nor stills beside what moves (of animated AVIF)."""
    streams = [s for s in container.streams.video if not s.disposition & s.disposition.attached_pic]
    return [s for s in streams if not _is_still(s)] or streams


def _is_still(stream: Any) -> bool:
    """Whether it is an item of HEIF, such as AVIF and HEIC: a picture, part of one, its transparency or its preview."""
    return stream.time_base == 1 and stream.duration is None and "mp4" in stream.container.format.name.split(",")


def _said_of(stream: Any) -> tuple[Fraction | None, Fraction, str, int]:
    """What a stream says of itself: nominal frames per second, width of a pixel by its height, and its codec; and how
    many of video there are."""
    rate, shape = stream.average_rate or stream.guessed_rate, Fraction(stream.sample_aspect_ratio or 1)
    return Fraction(rate) if rate else None, shape, stream.codec_context.name, len(_video_streams(stream.container))


def _announced(container: Any, stream: Any) -> int:
    """Frames by the header, 0 if it does not say; of those that are stored, the ones that an edit list shows."""
    if not stream.frames or "mp4" not in container.format.name.split(","):
        return int(stream.frames)
    return sum(not entry.is_discard for entry in stream.index_entries)


def stamp_of(picture: Any) -> Fraction | None:
    """Presentation time [s] of a picture."""
    return None if picture.pts is None else picture.pts * Fraction(picture.time_base)


def announced_end_s(container: Any, stream: Any, begin_s: Fraction) -> Fraction | None:
    """Where a stream that begins at `begin_s` ends [s] by the header: its tag (Matroska), or the duration if the file
    holds nothing else.

    Containers say how long it lasts, and so does Matroska as mkvmerge writes it; libavformat writes the end there and
    in FLV and ASF, and reads it so of NUT.
    """
    tag = DURATION.fullmatch(stream.metadata.get("DURATION", ""))
    if tag:
        hours, minutes, seconds = map(Fraction, tag.groups())
        said_s = 3600 * hours + 60 * minutes + seconds
    elif container.duration and len(container.streams) == 1:
        said_s = Fraction(container.duration, 10**6)
    else:
        return None
    kinds = set(container.format.name.split(","))
    of_lavf = bool(kinds & {"matroska", "flv", "asf"}) and _muxer(container).startswith("Lavf")
    is_end = (of_lavf or "nut" in kinds) and said_s > begin_s
    return said_s if is_end else begin_s + said_s


def _muxer(container: Any) -> str:
    return next((text for key, text in container.metadata.items() if key.lower() == "encoder"), "")


def reason(error: Exception) -> str:
    """What FFmpeg says of an error."""
    return getattr(error, "strerror", None) or str(error)


def _sought(
    container: Any, stream: Any, target_s: Fraction, since_s: Fraction, remarks: list[str]
) -> Iterator[Any] | None:
    """The pictures from a key frame at or before `since_s` on; None if the file does not lead to one that is whole.

    (Without what is in front of the first picture, decoders guess at all of H.264 in 4:4:4 by x264 before its build
    151: they have to know of its mistakes, and its name is there.)
    """
    try:
        container.seek(int(target_s // Fraction(stream.time_base)), stream=stream, backward=True)
    except av.FFmpegError:
        return None
    coming = _decoded(container, stream, 0, remarks)
    first = next(coming, None)
    stamp = None if first is None else stamp_of(first)
    if first is None or stamp is None or not first.key_frame or first.is_corrupt or stamp > since_s:
        return None
    return chain([first], coming)


def _first(container: Any, stream: Any, planned: int, name: str, remedy: str) -> Any:
    """The first picture.  Raises DataError if there is none."""
    remarks: list[str] = []
    picture = next(_decoded(container, stream, planned, remarks), None)
    if picture is None:
        because = f" ({remarks[0]})" if remarks else ""
        raise DataError(f"{name}: no frame in it can be decoded{because}; {remedy}")
    return picture


def _decoded(container: Any, stream: Any, planned: int, remarks: list[str]) -> Iterator[Any]:
    """Decoded pictures in order of presentation; what could not be read is told in `remarks` at the end."""
    pictures = _of_packets(container, stream, planned, remarks)
    in_order = stream.container.format.name != "avi" or stream.codec_context.codec.intra_only
    return pictures if in_order else stamps_in_order(pictures)


def _of_packets(container: Any, stream: Any, planned: int, remarks: list[str]) -> Iterator[Any]:
    """As `_decoded`, with the stamps that the decoder gives them."""
    whole = broken = locked = guessed = sound = unsound = places = 0
    checked = stream.codec_context.name == "ffv1"
    for packet in _packets(container, stream, remarks):
        if stream.container.format.name == "avi" and packet.dts is not None:
            places = packet.dts + 1  # (some are empty: frames that were dropped when it was recorded)
        if packet.is_corrupt:  # (cut off in the middle; the decoder would invent the rest)
            broken += 1
            continue
        if packet.has_sidedata("encryption_info"):  # (some decoders make pictures of that, too)
            locked += 1
            continue
        whole += packet.size > 0 and not packet.is_discard  # (what an edit list hides leads to what it shows)
        if checked and packet.size:
            right = is_sound(bytes(packet))
            sound, unsound = sound + right, unsound + (not right)
        try:
            pictures = packet.decode()
        except av.FFmpegError:
            broken += 1
            continue
        guessed += sum(picture.is_corrupt for picture in pictures)
        yield from pictures
    guessed += unsound if sound else 0  # (where none is right, there are no checksums)
    if guessed:
        remarks.append(f"damaged pictures, which the decoder has guessed with those that build on them: {guessed}")
    if locked:
        remarks.append(
            f"encrypted packets left out: {locked}; ffmpeg -decryption_key KEY -i VIDEO -c copy OTHER decrypts them"
        )
    if broken:
        remarks.append(f"damaged packets of the file left out: {broken}")
    if max(whole + broken + locked, places) < planned:
        remarks.append(f"truncated: the file holds {whole + locked} of the {planned} frames it announces")


def _packets(container: Any, stream: Any, remarks: list[str]) -> Iterator[Any]:
    """The packets of a stream as far as the file can be read, the last one empty: for it a decoder gives its rest."""
    try:
        yield from container.demux(stream)
    except av.FFmpegError as error:
        remarks.append(f"the file cannot be read to its end ({reason(error)})")
        rest = av.Packet()
        rest.stream, rest.time_base = stream, stream.time_base
        yield rest
