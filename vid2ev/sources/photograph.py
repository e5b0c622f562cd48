"""A still photograph over which a camera moves: a clip with exact light at exact times, as dense as one likes.

    place in the photograph = its middle + ((x, y) + turned (column, row) of the picture's middle / zoom) / scale

`motion.py` has the paths, `spline.py` what becomes of the light, of which infinite is 65504, and what is no number 0.
Unless told otherwise the picture has the shape of the photograph and is the largest, up to 1280x720, that never sees
beyond its border; of a given size it sees as much as it can.
The frame rate is such that nothing moves more than half a pixel from frame to frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.light.picture_files import read_picture, remarks_on_tags, white_in
from vid2ev.light.pictures import PictureReader
from vid2ev.light.resample import resampled, taps_of
from vid2ev.light.spline import seen
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS
from vid2ev.sources.framing import crop_box, parse_size
from vid2ev.sources.motion import Motion, parse_motion
from vid2ev.sources.times import parse_fps, round_ns
from vid2ev.stream.frames import Colour, Frame

LARGEST = (1280, 720)  # of the pictures made, if no size is given; on edge for upright photographs
SLOWEST_FPS = 30
STEP_PX = 0.5  # the most that anything moves from frame to frame
FASTEST_PX_S = 4e8  # about as fast as frames a nanosecond apart can show by such steps
FINENESS = 2  # pixels of the photograph, at least, for each that is seen, when a large one is made smaller in advance
BORDER_PX = 2  # which the picture keeps from the border of the photograph


class Photograph:
    """Frames of a photograph seen by a moving camera, at k / fps from the beginning of the motion to its end.

    motion   as for `parse_motion`
    crop     the part of the photograph to use
    size     of the pictures, as in `framing.py`

    Raises UsageError for a motion that leaves the photograph and for options that cannot be meant, DataError for a
    photograph that cannot be read.
    """

    rewindable = True
    kept = None
    dense = False

    def __init__(
        self,
        path: str | Path,
        motion: str,
        *,
        transfer: str = "auto",
        fps: float | Fraction | None = None,
        colour: Colour = "luminance",
        crop: str | None = None,
        size: str | Sequence[int] | None = None,
    ):
        self.path, self.warnings = Path(path), list[str]()
        self._motion = parse_motion(motion)
        pixels, primaries, tagged = read_picture(self.path)
        if transfer == "auto":
            self.warnings += remarks_on_tags(self.path, pixels)
            transfer = "linear" if pixels.dtype.kind == "f" else tagged or "srgb"
        self._reader, self._crop = PictureReader(transfer, colour, white_in(self.path)), crop
        self.warnings += self._reader.remarks_on(pixels)
        light = self._reader.light(pixels, primaries)
        # (means over many pixels would make many of one that is not finite)
        self._light = np.nan_to_num(light, nan=0.0, posinf=MOST_OF_HALF_FLOATS, neginf=0.0)
        if crop is not None:
            x, y, width, height = map(int, crop_box(crop, (pixels.shape[1], pixels.shape[0])))
            self._light = np.ascontiguousarray(self._light[y : y + height, x : x + width])
        self._whole = (self._light.shape[1], self._light.shape[0])
        self.size, self._scale = self._fitted(size)
        if self._scale > 1 and not self._motion.scale:
            self.warnings.append(f"the photograph is enlarged {self._scale:.3g} times; a smaller --size would not be")
        self._factor, self._corner = 1, (0, 0)
        self._shrink()
        speed = self.speed()
        if fps is None and speed > FASTEST_PX_S:
            raise UsageError(
                f"{self.path}: the motion is up to {speed:.3g} px/s fast, too much for any rate of frames; make it"
                " slower, or give a --fps"
            )
        self._fps = parse_fps(max(SLOWEST_FPS, math.ceil(speed / STEP_PX * 1.01))) if fps is None else parse_fps(fps)
        if speed > self._fps:
            self.warnings.append(
                f"up to {speed / float(self._fps):.2g} px of motion from frame to frame; a higher --fps is truer"
            )
        self._begin = Fraction(str(self._motion.begin_s))
        self.frames_expected = math.floor(Fraction(str(self._motion.duration_s)) * self._fps) + 1
        self.duration_expected_s = float((self.frames_expected - 1) / self._fps)

    def describe(self) -> dict[str, Any]:
        """Facts about the photograph and the motion, for the manifest."""
        return {
            "kind": "photograph",
            "path": str(self.path),
            "size": list(self.size),
            **self._reader.about(),
            "crop": self._crop,
            "scale": self._scale,
            "fps": str(self._fps),
            "frames_expected": self.frames_expected,
            **{key: value for key, value in self._motion.describe().items() if key != "scale"},
        }

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        return self.frames_between(None, None, start)

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """The frames from `since_ns` to `until_ns`, both included, None without end; from index `start` among these."""
        first = 0 if since_ns is None else math.ceil((Fraction(2 * since_ns - 1, 2 * 10**9) - self._begin) * self._fps)
        for k in range(max(0, first) + start, self.frames_expected):
            if until_ns is not None and self._time_ns(k) > until_ns:
                return
            yield self._frame(k)

    def speed(self) -> float:
        """The fastest that anything in the picture moves [px/s]."""
        t_s = self._motion.instants()
        x, y = _corners(self._motion, t_s, self.size)
        zoom = self._motion.at(t_s).zoom
        return float(np.max(np.hypot(np.diff(x), np.diff(y)) * np.maximum(zoom[1:], zoom[:-1]) / np.diff(t_s)))

    def _frame(self, k: int) -> Frame:
        t = self._begin + k / self._fps
        x, y, angle, zoom = (float(value[0]) for value in self._motion.at(np.array([float(t)])))
        place = (self._whole[0] / 2 + x / self._scale, self._whole[1] / 2 + y / self._scale)
        centre = ((place[0] - self._corner[0]) / self._factor, (place[1] - self._corner[1]) / self._factor)
        return Frame(seen(self._light, self.size, centre, angle, self._scale * zoom * self._factor), self._time_ns(k))

    def _time_ns(self, k: int) -> int:
        return round_ns(self._begin + k / self._fps)

    def _shrink(self) -> None:
        """Make one pixel of many, as long as two of them are left for each pixel that is seen at the closest."""
        closest = self._scale * float(np.max(self._motion.at(self._motion.instants()).zoom))
        self._factor = max(1, math.floor(1 / (FINENESS * closest)))
        if self._factor > 1:
            columns, rows = (side // self._factor for side in self._whole)
            self._corner = (self._whole[0] % self._factor // 2, self._whole[1] % self._factor // 2)
            self._light = resampled(
                self._light,
                taps_of(self._whole[1], Fraction(self._corner[1]), Fraction(rows * self._factor), rows),
                taps_of(self._whole[0], Fraction(self._corner[0]), Fraction(columns * self._factor), columns),
            )

    def _fitted(self, size: str | Sequence[int] | None) -> tuple[tuple[int, int], float]:
        """The size of the pictures, and output pixels per pixel of the photograph."""
        if size is not None:
            width, height, stretched = parse_size(size, self._whole)
            if stretched:
                raise UsageError(f"size '{size}': a photograph in motion is not stretched; leave the '!' out")
            least = self._least_scale((width, height))
            if self._motion.scale and self._motion.scale < least:
                raise UsageError(
                    f"{self.path}: at scale {self._motion.scale:g} the motion leaves the photograph; expected at least"
                    f" {least:.4g}, a smaller size, or less motion"
                )
            return (width, height), self._motion.scale or least
        most = LARGEST if self._whole[0] >= self._whole[1] else LARGEST[::-1]
        scale = self._motion.scale or min(1.0, most[0] / self._whole[0], most[1] / self._whole[1])
        low, high = 0.0, min(1.0, most[0] / (self._whole[0] * scale), most[1] / (self._whole[1] * scale))
        for _ in range(40):
            share = (low + high) / 2
            fits = self._least_scale((share * self._whole[0] * scale, share * self._whole[1] * scale)) <= scale
            low, high = (share, high) if fits else (low, share)
        width, height = (math.floor(low * side * scale) for side in self._whole)
        if min(width, height) < 1:
            raise UsageError(
                f"{self.path}: the motion leaves the photograph of {self._whole[0]}x{self._whole[1]} pixels; make it"
                " slower or shorter, or give a --size to look at it enlarged"
            )
        return (width, height), scale

    def _least_scale(self, size: tuple[float, float]) -> float:
        """The least scale at which pictures of this size never see beyond the border."""
        x, y = _corners(self._motion, self._motion.instants(), size)
        widest, highest = (2 * (float(np.abs(places).max()) + BORDER_PX) for places in (x, y))
        return max(widest / self._whole[0], highest / self._whole[1])


def _corners(motion: Motion, t_s: np.ndarray, size: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Where the corners of the picture are [4, instants], by output pixels at zoom 1 from the photograph's middle."""
    x, y, angle, zoom = motion.at(t_s)
    turn = np.radians(angle)
    right = np.array([[-1], [1], [-1], [1]]) * size[0] / 2 / zoom
    down = np.array([[-1], [-1], [1], [1]]) * size[1] / 2 / zoom
    return x + right * np.cos(turn) - down * np.sin(turn), y + right * np.sin(turn) + down * np.cos(turn)
