"""Frames as pictures: codes of a film, codes or light in files.

png    codes of 8 bits, or 16 where the source has more than 8, by the source's own curve (`interp.own_codes`): those of
       key frames are the source's own
mp4    codes of 8 bits by the source's own curve, so that the film is as bright as the source; by that of BT.709 where
       films have no name for it
exr    float32, linear light, white at 1.0 and no upper end; that of key frames of linear files, or of videos brighter
       than white, is the source's own; needs the package OpenEXR
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import torch

from interp.interpolate.fill import Filled
from interp.interpolate.instants import Grid, Number, Rate, Times, parse_number
from interp.interpolate.take import Take
from interp.light import to_light
from interp.own_codes import recoded, shown
from interp.rows import AT_ONCE
from vid2ev.errors import UsageError
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.light.transfer import parse_transfer
from vid2ev.pictures.film import rate_of_film
from vid2ev.recording.exposures import write_codes

TABLE = 65535  # entries of the table of a curve, less one


class Pictures:
    """Makes pictures of frames.

    kind    mp4, png or exr
    bits    8 or 16, of PNG
    curve   of films and PNG; EXR are linear
    Raises UsageError for EXR without the package.
    """

    def __init__(self, kind: str, bits: int, curve: str):
        self.kind, self.bits, self.curve = kind, bits if kind == "png" else 8, "linear" if kind == "exr" else curve
        self._write = None
        if kind == "exr":
            from vid2ev.scenes.picture_writing import writer_of

            self._write = writer_of("exr")[0]
        self._table = _by_curve(curve) if self.bits == 8 and self.curve not in ("srgb", "linear") else None

    def describe(self) -> str:
        """For people, and for JSON."""
        return "exr" if self.kind == "exr" else f"{self.kind} of {self.bits} bits by the curve {self.curve}"

    def picture(self, frame: Filled) -> np.ndarray:
        """What is written of a frame: codes, or light [H, W, 3]."""
        codes = frame.codes
        if self.kind == "exr":
            light = frame.light
            if light is None:
                light = to_light(torch.from_numpy(np.ascontiguousarray(codes)), "srgb").numpy()
            return light if light.shape[2] == 3 else np.repeat(light, 3, axis=2)
        codes = codes if codes.shape[2] == 3 else codes[..., 0]
        picture = np.empty(codes.shape, np.uint8 if self.bits == 8 else np.uint16)
        rows = max(1, AT_ONCE // max(1, codes[:1].size))
        for top in range(0, len(codes), rows):
            picture[top : top + rows] = self._coded(np.clip(codes[top : top + rows], 0, 1))
        return picture

    def _coded(self, codes: np.ndarray) -> np.ndarray:
        """Whole codes by the curve, of sRGB codes 0 ... 1."""
        if self._table is not None:
            return self._table[_places(codes)]
        signal = recoded(torch.from_numpy(np.ascontiguousarray(codes)), self.curve).numpy()
        return np.rint(signal * np.float32(2**self.bits - 1))

    def of_light(self, light: np.ndarray) -> np.ndarray:
        """The same of light [H, W]."""
        if self.kind == "exr":
            return np.repeat(light[..., None], 3, axis=2)
        return srgb_codes(light)

    def write(self, path: Path, picture: np.ndarray) -> None:
        """Write a picture; raises OSError."""
        if self._write is None:
            write_codes(path, picture)
        else:
            self._write(picture, path)


def checked_play(play: Number | None, kind: str) -> Fraction | None:
    """Frames per second of a film, if they are asked for.  Raises UsageError, also for what is no film."""
    if play is None:
        return None
    if kind != "mp4":
        raise UsageError(f"--play {play} is of films, and what is made is a folder of {kind}; leave it out")
    rate = parse_number(play, "--play")
    if not 0 < rate <= 1000:
        raise UsageError(f"--play {play}: expected more than 0 and at most 1000 frames per second")
    return rate_of_film(rate)


def film_rate(take: Take, grid: Grid, play: Number | None, kind: str) -> Fraction:
    """Frames per second of a film: as asked, or so that it plays in real time.  Raises UsageError."""
    if asked := checked_play(play, kind):
        return asked
    if isinstance(grid, Rate):
        return rate_of_film(grid.rate_hz)
    assert isinstance(grid, Times)
    return rate_of_film(grid.multiple * take.rate)


def _by_curve(curve: str) -> np.ndarray | None:
    """The code of 8 bits [uint8] by a curve of each sRGB code of `TABLE`; None where these are too coarse in the dark
    to tell the codes of the curve apart."""
    light = parse_transfer("srgb").to_light(np.arange(TABLE + 1) / TABLE)
    table = np.rint(255 * np.clip(parse_transfer(curve).to_signal(light), 0, 1)).astype(np.uint8)
    own = np.arange(256, dtype=np.uint8)
    return table if np.array_equal(table[_places(shown(own, curve))], own) else None


def _places(codes: np.ndarray) -> np.ndarray:
    """Where sRGB codes, 0 ... 1, are in a table."""
    return np.rint(codes * np.float32(TABLE)).astype(np.uint16)
