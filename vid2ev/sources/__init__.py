"""Where frames come from: videos, images, arrays, a photograph in motion, a camera, synthetic clips, rendered scenes;
all linear light with exact times.

    source -> cut (start, stop) -> slowed -> cropped, brought to a size

A new kind of source is a class that satisfies `Source` (`source.py`) and a line in `_opened`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.source import LARGEST, Source, begins_s
from vid2ev.sources.times import parse_fps
from vid2ev.stream.frames import Colour

if TYPE_CHECKING:
    from vid2ev.rig.intrinsics import Framing

__all__ = ["OPTIONS", "Source", "begins_s", "open_source", "short_name"]

SYNTHETIC_PREFIX, SCENE_PREFIX, CAMERA_PREFIX, STANDARD_INPUT = "synthetic:", "scene:", "camera:", "-"
OPTIONS = ("transfer", "fps", "colour", "slowdown", "start", "stop", "crop", "size", "motion")  # of `open_source`


def open_source(
    path: str | Path,
    *,
    transfer: str = "auto",
    fps: float | Fraction | None = None,
    colour: Colour = "luminance",
    slowdown: float | Fraction | None = None,
    start: float | Fraction | None = None,
    stop: float | Fraction | None = None,
    crop: str | None = None,
    size: str | Sequence[int] | None = None,
    motion: str | None = None,
    seen_through: Callable[[Source, Framing | None], Source] | None = None,
) -> Source:
    """The source behind a path: a folder of images, a TIFF with pages, a .npy or .npz, `synthetic:NAME`, `scene:NAME`
    or a scene file, `-` for standard input, `camera:0`, and otherwise a video.  What a file is, its content says.

    transfer     what codes mean: "srgb", "bt709", "pq", "hlg", "linear", "gamma:G" and others; "auto" is the tag of a
                 video, BT.709 without one, sRGB for images, still or animated, linear light for floating point, and a
                 refusal for integer arrays, which say nothing; "linear:10bit" of codes of a sensor that do not fill
                 their 16 bits
    fps          frames per second; it overrules the times of the source; images and arrays without times need it
    colour       "luminance" gives frames [H, W], "rgb" [H, W, 3] (see `Frame`)
    start, stop  the part to read [s on the source's own clock], both ends included
    slowdown     the footage plays so many times slower than the world went: its times are divided by it
    crop, size   as in `framing.py`, such as "640x480+0+60" and "346x260" or (346, 260)
    seen_through what else is done to the source before it is cut and framed, such as giving it depth; it is told how it
                 is going to be framed
    motion       makes a clip of a photograph: "pan", "saccade", "zoom" or a .csv file, as in `motion.py`

    Raises UsageError for a path that does not exist and for options that cannot be meant, DataError for content that
    cannot be read.
    """
    if colour not in ("luminance", "rgb"):
        raise UsageError(f"colour '{colour}': expected luminance or rgb")
    if fps is not None:
        fps = parse_fps(fps)
    if motion is None:
        source = _opened(str(path), transfer, fps, colour)
    else:
        source = _in_motion(Path(path), motion, transfer=transfer, fps=fps, colour=colour, crop=crop, size=size)
        crop = size = None
    if max(source.size) > LARGEST:
        raise DataError(
            f"{path}: {source.size[0]}x{source.size[1]} pixels; expected at most {LARGEST} along each side, so make the"
            " pictures smaller first"
        )
    if seen_through is not None:
        source = seen_through(source, _framing(source, crop, size))
    if start is not None or stop is not None:
        from vid2ev.sources.cut import Cut

        source = Cut(source, start, stop)
    if slowdown is not None:
        from vid2ev.sources.cut import Slowed

        source = Slowed(source, slowdown)
    if crop is not None or size is not None:
        from vid2ev.sources.framing import Framed

        source = Framed(source, crop, size)
    return source


def _framing(source: Source, crop: str | None, size: str | Sequence[int] | None) -> Framing | None:
    if crop is None and size is None:
        return None
    from vid2ev.sources.framing import Framed

    return Framed(source, crop, size).framing


def _opened(name: str, transfer: str, fps: float | Fraction | None, colour: Colour) -> Source:
    """The source of a name, unedited."""
    if name.startswith(SYNTHETIC_PREFIX):
        return _synthetic(name, transfer, fps, colour)
    if is_scene(name):
        return _scene(name.removeprefix(SCENE_PREFIX), transfer, fps, colour)
    if is_live(name):
        from vid2ev.sources.live import open_camera, open_standard_input
        from vid2ev.sources.video import Video

        live = open_standard_input() if name == STANDARD_INPUT else open_camera(name.removeprefix(CAMERA_PREFIX))
        return Video(live, transfer=transfer, fps=fps, colour=colour)
    path = _existing(Path(name))
    if path.is_dir():
        from vid2ev.sources.images import Images

        return Images(path, transfer=transfer, fps=fps, colour=colour)
    return _file(path, transfer, fps, colour)


def _file(path: Path, transfer: str, fps: float | Fraction | None, colour: Colour) -> Source:
    from vid2ev.formats.matlab import refuse_mat
    from vid2ev.light.recognise import recognise

    refuse_mat(path)
    match recognise(path):
        case "picture":
            from vid2ev.sources.images import Images

            if is_single_picture(path):
                raise UsageError(
                    f"{path}: a single picture; give the folder that holds the sequence, or let a camera move over it"
                    " with --motion pan"
                )
            return Images(path, transfer=transfer, fps=fps, colour=colour)
        case "array":
            from vid2ev.sources.arrays import ArrayStack

            return ArrayStack(path, transfer=transfer, fps=fps, colour=colour)
        case "arrays":
            from vid2ev.sources.arrays import ArrayStack
            from vid2ev.sources.stacks import NpzStack

            return ArrayStack(path, NpzStack(path), transfer=transfer, fps=fps, colour=colour)
        case _:
            from vid2ev.sources.footage import VideoFile
            from vid2ev.sources.video import Video

            return Video(VideoFile(path), transfer=transfer, fps=fps, colour=colour)


def is_single_picture(path: Path) -> bool:
    """Whether there is a file that holds one picture, which by itself is no source.  Raises as `open_source`."""
    from vid2ev.light.picture_files import pages_of
    from vid2ev.light.recognise import recognise

    return os.path.isfile(path) and recognise(path) == "picture" and pages_of(path) == 1


def _in_motion(path: Path, motion: str, **options: Any) -> Source:
    from vid2ev.light.recognise import recognise
    from vid2ev.sources.photograph import Photograph

    if _existing(path).is_dir() or recognise(path) != "picture":
        raise UsageError(f"{path}: motion '{motion}' is for a photograph, such as a PNG, JPEG or EXR; leave it out")
    return Photograph(path, motion, **options)


def _synthetic(text: str, transfer: str, fps: float | Fraction | None, colour: Colour) -> Source:
    from vid2ev.sources.edit import Grey
    from vid2ev.sources.synthetic import parse_synthetic

    if transfer not in ("auto", "linear"):
        raise UsageError(f"{text}: transfer '{transfer}' for light that is linear already; leave it out")
    name = text.removeprefix(SYNTHETIC_PREFIX)
    clip = parse_synthetic(name if fps is None else f"{name},fps={float(fps)}")
    return clip if colour == "luminance" else Grey(clip)


def _scene(text: str, transfer: str, fps: float | Fraction | None, colour: Colour) -> Source:
    from vid2ev.scenes.source import open_scene

    if transfer not in ("auto", "linear"):
        raise UsageError(f"{text}: transfer '{transfer}' for light that is linear already; leave it out")
    return open_scene(text, fps=fps, colour=colour)


def is_scene(name: str) -> bool:
    """Whether a source is a scene: by its prefix, or a text of TOML (nothing else that can be read has this suffix)."""
    return name.startswith(SCENE_PREFIX) or (name.endswith(".toml") and os.path.isfile(name))


def is_live(name: str) -> bool:
    """Whether a source passes once: standard input, or a camera."""
    return name == STANDARD_INPUT or name.startswith(CAMERA_PREFIX)


def check_there(name: str) -> None:
    """Raise UsageError for a source that is a file or a folder, and is not there."""
    if not name.startswith((SYNTHETIC_PREFIX, SCENE_PREFIX)) and not is_live(name):
        _existing(Path(name))


def _existing(path: Path) -> Path:
    if not os.path.exists(path):  # (Path.exists raises OSError for a name that is too long)
        raise UsageError(f"{path}: no such file or folder; give a video, a folder of images or a .npy array")
    return path


def short_name(name: str) -> str:
    """What a source is called after: without folder, suffix, or what is asked of a scene or a synthetic clip."""
    if name == STANDARD_INPUT:
        return "stdin"
    if name.startswith(CAMERA_PREFIX):  # (a name may be a path, such as /dev/video0)
        return f"camera{Path(name.removeprefix(CAMERA_PREFIX)).name}"
    for prefix in (SYNTHETIC_PREFIX, SCENE_PREFIX):
        if name.startswith(prefix):
            name = name.removeprefix(prefix).partition(",")[0]
    path = Path(os.path.abspath(name))
    return path.name if os.path.isdir(path) else path.stem
