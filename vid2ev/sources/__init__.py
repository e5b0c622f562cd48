"""Where frames come from: videos, folders of images, arrays, synthetic clips; all linear light with exact times.

A new kind of source is a class that satisfies `Source` and a line in `open_source`.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

from vid2ev.errors import UsageError
from vid2ev.stream.frames import Frame

__all__ = ["Source", "open_source"]

SYNTHETIC_PREFIX = "synthetic:"
PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".webp")


class Source(Protocol):
    """A clip that can be read from its start as often as one likes, one frame at a time, in memory that does not grow.

    Making one opens it, and raises `UsageError` or `DataError` if its first frame cannot be had.
    """

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px] of every frame, upright."""

    @property
    def frames_expected(self) -> int | None:
        """How many frames there should be, by the header; in some formats an estimate, None if there is no telling."""

    @property
    def warnings(self) -> list[str]:
        """What a person should know, one sentence each; more may come while the frames are read to their end."""

    def describe(self) -> dict[str, Any]:
        """What the source is and how its codes were taken, ready for JSON."""

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on, in order of presentation, with strictly increasing times."""


def open_source(path: str | Path, *, transfer: str = "auto", fps: float | Fraction | None = None) -> Source:
    """The source behind a path: a folder of images, a .npy file, `synthetic:NAME`, and otherwise a video.

    transfer  what codes mean: "srgb", "bt709", "linear" or "gamma:G"; "auto" is the tag of a video, BT.709 without
              one, sRGB for images, linear light for floating point, and a refusal for integer arrays, which say nothing
    fps       frames per second; it overrules the times of the source; images and arrays without times need it

    Raises UsageError for a path that does not exist and for options that cannot be meant, DataError for content that
    cannot be read.
    """
    if str(path).startswith(SYNTHETIC_PREFIX):
        return _synthetic(str(path), transfer, fps)
    path = Path(path)
    if path.is_dir():
        from vid2ev.sources.images import ImageFolder

        return ImageFolder(path, transfer=transfer, fps=fps)
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder; give a video, a folder of images or a .npy array")
    if path.suffix.lower() in PICTURE_SUFFIXES:
        raise UsageError(f"{path}: a single picture; give the folder that holds the sequence")
    if path.suffix.lower() == ".npy":
        from vid2ev.sources.arrays import ArrayStack

        return ArrayStack(path, transfer=transfer, fps=fps)
    from vid2ev.sources.video import Video

    return Video(path, transfer=transfer, fps=fps)


def _synthetic(text: str, transfer: str, fps: float | Fraction | None) -> Source:
    from vid2ev.sources.synthetic import parse_synthetic

    if transfer not in ("auto", "linear"):
        raise UsageError(f"{text}: transfer '{transfer}' for light that is linear already; leave it out")
    name = text.removeprefix(SYNTHETIC_PREFIX)
    return parse_synthetic(name if fps is None else f"{name},fps={float(fps)}")
