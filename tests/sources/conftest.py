"""Clips to read, encoded on the spot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from vid2ev.sources import footage

Encode = Callable[..., Path]


def picture(planes: list[np.ndarray], pixel_format: str, **tags: int) -> av.VideoFrame:
    """A picture of these planes of codes; tags are attributes of the picture (color_range, colorspace, ...)."""
    height, width = planes[0].shape
    made = av.VideoFrame(width, height, pixel_format)
    for target, codes in zip(made.planes, planes, strict=True):
        rows = np.frombuffer(target, codes.dtype).reshape(target.height, -1)
        rows[:, : codes.shape[1]] = codes
    for name, value in tags.items():
        setattr(made, name, value)
    return made


@pytest.fixture
def encode(tmp_path: Path) -> Encode:
    """encode(name, pictures, codec=..., ...) -> path of a video in a temporary folder.

    pictures   grey arrays [H, W] uint8, or `picture`s; ffv1 keeps their codes to the bit
    stamps     presentation times in ticks of time_base, 0, 1, 2, ... if left out
    tags       attributes of the codec context (color_range, color_trc, ...)
    """

    def encode(
        name: str,
        pictures: Iterable[Any],
        *,
        codec: str = "ffv1",
        stamps: list[int] | None = None,
        time_base: Fraction = Fraction(1, 30),
        options: dict[str, str] | None = None,
        container_options: dict[str, str] | None = None,
        **tags: int,
    ) -> Path:
        frames = [p if isinstance(p, av.VideoFrame) else picture([p], "gray") for p in pictures]
        path = tmp_path / name
        with av.open(str(path), "w", options=container_options or {}) as container:
            stream = container.add_stream(codec, rate=round(1 / time_base), options=options or {})
            stream.width, stream.height = frames[0].width, frames[0].height
            stream.pix_fmt = "yuv420p" if codec == "libx264" else frames[0].format.name
            stream.codec_context.time_base = time_base
            stream.time_base = time_base
            for attribute, value in tags.items():
                setattr(stream.codec_context, attribute, value)
            for k, frame in enumerate(frames):
                if codec == "libx264":
                    frame = frame.reformat(format="yuv420p", dst_color_range=1)
                frame.pts, frame.time_base = k if stamps is None else stamps[k], time_base
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        return path

    return encode


@pytest.fixture(scope="session")
def shared_videos() -> Path:
    """Folder of real clips."""
    folder = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos"
    if not folder.is_dir():
        pytest.skip("the real clips are not here (../shared/data/videos)")
    return folder


@pytest.fixture
def make_picture() -> Callable[..., av.VideoFrame]:
    """`picture`, for tests that give planes."""
    return picture


@pytest.fixture
def stamps_passing(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[int]]:
    """stamps_passing(name) -> the stamps of the pictures that a function of `footage` has given, as they come."""

    def passing(name: str) -> list[int]:
        given, seen = getattr(footage, name), list[int]()

        def counted(*arguments: Any) -> Iterator[Any]:
            for picture in given(*arguments):
                seen.append(picture.pts)
                yield picture

        monkeypatch.setattr(footage, name, counted)
        return seen

    return passing
