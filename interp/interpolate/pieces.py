"""A film while it is made: pieces, 000000-000128.mp4 ..., of frames that are then no longer needed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.light.tags import tag_of
from vid2ev.pictures.film import write_film
from vid2ev.recording.disk import sync


class Pieces:
    """The pieces in a folder.

    rate       frames per second of the film
    transfer   the curve of its codes
    """

    def __init__(self, folder: Path, rate: Fraction, transfer: str):
        self.folder, self.rate, self.transfer = folder, rate, transfer

    @property
    def stop(self) -> int:
        """The number of the first frame that is in none of them."""
        return max([stop for *_, stop in self.found()], default=0)

    def found(self) -> list[tuple[Path, int, int]]:
        """In order, each with the number of its first frame and of the one after its last."""
        named = ((path, re.fullmatch(r"(\d{6,12})-(\d{6,12})", path.stem)) for path in self.folder.glob("*.mp4"))
        return sorted([(path, int(of[1]), int(of[2])) for path, of in named if of], key=lambda piece: piece[1])

    def add(self, pictures: Iterable[np.ndarray], first: int, stop: int) -> None:
        """A piece of frames from `first` up to but not including `stop`, there as a whole or not at all."""
        aside = self.folder.with_name("piece.mp4")
        write_film(aside, map(_rgb, pictures), self.rate, tag_of(self.transfer))
        sync(aside)
        aside.replace(self.folder / f"{first:06d}-{stop:06d}.mp4")
        sync(self.folder)

    def check(self, count: int) -> None:
        """Raise DataError unless they follow one another from the first frame on, up to at most `count`."""
        edges = [(0, 0), *((first, stop) for _, first, stop in self.found())]
        for (_, before), (first, stop) in pairwise(edges):
            if first != before or not first < stop <= count:
                raise DataError(
                    f"{self.folder} has frames {first} to {stop - 1} of {count} after the first {before}; expected each"
                    " once; --overwrite starts again"
                )


def _rgb(codes: np.ndarray) -> np.ndarray:
    return codes if codes.ndim == 3 else np.repeat(codes[..., None], 3, axis=2)
