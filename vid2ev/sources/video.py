"""Video, through FFmpeg's libraries (PyAV): any container and codec they know, 8 to 16 bits.

Times are the presentation times of the file, exact.  Pictures go from the decoder's planes to linear light in one pass
(`luminance.py`, `colour.py`), at the decoder's full depth.  FFmpeg's own conversion to RGB (swscale) is darker than the
standards by half an 8-bit code on average and nearly one at worst, at 8, 10 and 12 bits alike; it only rearranges
planes here, where that is lossless.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.colour import rgb_of_rgb, rgb_of_yuv
from vid2ev.light.luminance import YuvCode, luminance_of_rgb, luminance_of_yuv, signal_table
from vid2ev.light.pictures import with_bits
from vid2ev.light.primaries import primaries_of
from vid2ev.light.tags import is_full_range, matrix_of, transfer_of
from vid2ev.light.transfer import KNOWN, code_table, parse_transfer
from vid2ev.sources.footage import Footage, stamp_of
from vid2ev.sources.planes import codes_of, halvings_of, orientation_of, planar, upright
from vid2ev.sources.times import Clock, parse_fps
from vid2ev.stream.frames import Colour, Frame
from vid2ev.terminal import counted


class Video:
    """Frames of footage: the first video stream of a file, of standard input, or a camera.

    transfer  "auto" (the file's tag; without one sRGB of GIF, animated PNG and WebP, else BT.709) or a name of
              `transfer.parse_transfer`
    fps       if given, frame k is at k / fps and the file's times do not count
    colour    "luminance" or "rgb"

    Display rotation and mirroring of the file are applied; pixels that are not square are taken for square, and
    `warnings` says so, as it does of other streams of video.  Frames whose time is not after the frame before are
    dropped, and frames without a time are placed by the frame rate; both are counted in `warnings`, and so is what is
    missing of a truncated file.  A camera's clock starts at its first frame.  Raises DataError if the codes of the
    footage have no known meaning, UsageError for a transfer or fps that cannot be meant.
    """

    dense = False

    def __init__(
        self,
        footage: Footage,
        *,
        transfer: str = "auto",
        fps: float | Fraction | None = None,
        colour: Colour = "luminance",
    ):
        self.warnings: list[str] = []
        self._fps = None if fps is None else parse_fps(fps)
        if transfer != "auto":
            if with_bits(transfer)[1]:
                raise UsageError(f"transfer '{transfer}': a video says of how many bits its codes are; leave them out")
            parse_transfer(transfer, f"auto, {KNOWN}")
        self._footage, self._colour = footage, colour
        self.path, self.rewindable, self.kept = footage.name, footage.rewindable, footage.kept
        first = footage.first
        self.frames_expected = footage.planned or self._estimate()
        self._transfer = transfer_of(first.color_trc, transfer, footage.codec)
        self._tables: dict[Any, np.ndarray] = {}
        self._orientation = orientation_of(first)
        self._coded_size = (first.width, first.height)
        self.size = self._coded_size if not self._orientation[0] else self._coded_size[::-1]
        if first.interlaced_frame:
            self.warnings.append(
                "interlaced video: both fields of a frame are taken for one instant; ffmpeg -i VIDEO -vf bwdif makes a"
                " picture of each"
            )
        self.warnings += self._not_square()
        if footage.streams > 1:
            self.warnings.append(
                f"the first of {footage.streams} video streams is read; ffmpeg -i VIDEO -map 0:V:1 -c copy OTHER.mkv"
                " takes the second out"
            )
        self._zero_s = stamp_of(first) or Fraction(0) if footage.kind == "camera" else Fraction(0)
        self._about = self._describe(first)
        self._light(first)  # (what cannot be read is refused now, not in the middle of a conversion)

    def describe(self) -> dict[str, Any]:
        """Facts about the footage, for the manifest."""
        return dict(self._about)

    @property
    def duration_expected_s(self) -> float | None:
        """From the first frame to the end, by the header."""
        footage, lasting_s = self._footage, self._lasting_s()
        if self._fps is not None:
            return None if self.frames_expected is None else float(self.frames_expected / self._fps)
        if lasting_s is not None:
            return float(lasting_s)
        return float(footage.planned / footage.rate) if footage.planned and footage.rate else None

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on; earlier ones are decoded and passed over, which is exact for any file."""
        return self.frames_between(None, None, start)

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """The frames from `since_ns` to `until_ns`, both included, None without end; from index `start` among these.

        Of a file with an index few frames before the first are decoded, and none beyond the one after the last.
        """
        if start and self._footage.kind == "camera":
            raise UsageError(f"{self.path}: what a camera saw cannot be seen again; begin anew")
        clock, index, remarks = Clock(self._fps, self._footage.rate), 0, list[str]()
        since_s = None if since_ns is None or self._fps is not None else Fraction(since_ns, 10**9)
        picture = None
        for picture in self._footage.pictures(remarks, since_s):
            stamp = stamp_of(picture)
            t_ns = clock.next(None if stamp is None else stamp - self._zero_s)
            if t_ns is None or (since_ns is not None and t_ns < since_ns):
                continue
            if until_ns is not None and t_ns > until_ns:
                return
            if index >= start:
                yield Frame(self._light(picture), t_ns, number=clock.frames - 1 if since_s is None else None)
            index += 1
        remarks += [*clock.remarks(), *self._cut_short(picture)]
        self.warnings.extend(remark for remark in remarks if remark not in self.warnings)

    def _cut_short(self, last: Any) -> list[str]:
        """A remark if a file that announces no number of frames ends well before the time it announces, or lacks some
        of its bytes."""
        footage, stamp = self._footage, None if last is None else stamp_of(last)
        cut = [f"truncated: the file lacks {counted(footage.missing, 'byte')} at its end"] * (footage.missing > 0)
        if footage.planned or footage.end_s is None or stamp is None or not footage.rate:
            return cut
        seen_s = stamp + max(2 / footage.rate, (last.duration or 0) * Fraction(last.time_base))
        if seen_s >= footage.end_s:
            return cut
        return [f"truncated: the file ends at {float(stamp):.3f} s of the {float(footage.end_s):.3f} s it announces"]

    def _not_square(self) -> list[str]:
        """A remark if pixels are shown wider or narrower than they are high, by more than is rounded off a picture."""
        shape = self._footage.pixel_shape
        shape = 1 / shape if self._orientation[0] else shape
        square = round(self.size[0] * max(shape, 1)), round(self.size[1] * max(1 / shape, 1))
        if abs(square[0] - self.size[0]) <= 1 and abs(square[1] - self.size[1]) <= 1:
            return []
        return [
            f"pixels of the video are {shape.numerator}:{shape.denominator} wide to high and are taken for square:"
            f" its picture is out of shape; --size {square[0]}x{square[1]}! straightens it"
        ]

    def _estimate(self) -> int | None:
        """The number of frames, from duration and rate."""
        lasting_s, rate = self._lasting_s(), self._footage.rate
        return max(1, round(lasting_s * rate)) if lasting_s and rate else None

    def _lasting_s(self) -> Fraction | None:
        """From the first picture to the end on the clock of the file, by the header."""
        end_s = self._footage.end_s
        return None if end_s is None else end_s - (stamp_of(self._footage.first) or 0)

    # ------------------------------------------------------------------------------------------------- to light

    def _light(self, picture: Any) -> np.ndarray:
        """Light [float32, H x W or H x W x 3] of a decoded picture, upright."""
        if (picture.width, picture.height) != self._coded_size:
            raise DataError(
                f"{self.path}: the picture size changes to {picture.width}x{picture.height} in the middle of the video;"
                " cut it into clips of one size"
            )
        picture = planar(picture, self.path)
        planes = [codes_of(plane, picture.format) for plane in picture.planes]
        bits, name = picture.format.components[0].bits, picture.format.name
        full = is_full_range(picture.color_range, name)
        weights, to_bt709 = primaries_of(picture.color_primaries)
        size, rgb = self._coded_size, self._colour == "rgb"
        if name.startswith("yuv"):
            halvings = (halvings_of(picture.format.chroma_width), halvings_of(picture.format.chroma_height))
            code = YuvCode(bits, full, matrix_of(picture.colorspace, *size, self.path), halvings)
            table = self._table(None, True)
            if rgb:
                light = rgb_of_yuv(planes[:3], size, code, table, to_bt709)
            else:
                light = luminance_of_yuv(planes[:3], size, code, table, weights)
        else:
            green, blue, red = planes[:3] if name.startswith("gbr") else planes[:1] * 3
            table = self._table(bits, full)
            if rgb:
                light = rgb_of_rgb((red, green, blue), size, table, to_bt709)
            else:
                light = luminance_of_rgb((red, green, blue), size, table, weights)
        return upright(light, self._orientation)

    def _table(self, bits: int | None, full_range: bool) -> np.ndarray:
        if (bits, full_range) not in self._tables:
            made = signal_table(self._transfer) if bits is None else code_table(self._transfer, bits, full_range)
            self._tables[bits, full_range] = made
        return self._tables[bits, full_range]

    def _describe(self, first: Any) -> dict[str, Any]:
        transposed, mirrored, flipped = self._orientation
        rate = self._footage.rate
        return {
            "kind": self._footage.kind,
            "path": self.path,
            "size": list(self.size),
            "codec": self._footage.codec,
            "pixel_format": first.format.name,
            "bits": first.format.components[0].bits,
            "transfer": self._transfer,
            "range": "full" if is_full_range(first.color_range, planar(first, self.path).format.name) else "limited",
            "transposed": transposed,
            "mirrored": mirrored,
            "flipped": flipped,
            "rate": None if rate is None else str(rate),
            "fps": None if self._fps is None else str(self._fps),
            "frames_expected": self.frames_expected,
            "frames_estimated": not self._footage.planned,
        }
