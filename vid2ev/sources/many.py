"""The many sources that one argument stands for: those in a folder, or in a list."""

from __future__ import annotations

import os
from itertools import islice
from pathlib import Path

from vid2ev.errors import UsageError
from vid2ev.formats import recognise
from vid2ev.light.recognise import MOTION_JPEG_SUFFIXES, head_of, natural, pictures_in
from vid2ev.recording.manifest import is_recording
from vid2ev.sources import is_live
from vid2ev.untrusted import read_lines

CLIPS = {
    ".mp4", ".mkv", ".avi", ".mov", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".wmv", ".flv", ".y4m", ".ogv", ".3gp",
    ".mts", ".m2ts", ".mxf", ".vob", ".asf", ".3g2", ".m2v", ".dv", ".ivf", ".nut", ".h264", ".h265", ".gif", ".apng",
    *MOTION_JPEG_SUFFIXES, ".npy", ".npz",
}  # fmt: skip
ARRAYS = {".npy", ".npz"}

DEEPEST, MOST = 3, 1000  # folders below one without clips, in which some are looked for to be named

LIST = ".txt"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # marks before a text that has zeros (and is refused as what it is)


def sources_in(video: str) -> list[str]:
    """The sources that an argument stands for: itself, what a folder holds that is not of pictures (videos, arrays and
    folders of pictures, in natural order, but no recordings, nor what is hidden or may not be read), or what the lines
    of a list NAME.txt stand for, as on the command line.

    Raises UsageError for a list without any, DataError for a list that cannot be read.
    """
    folder = Path(video)
    if is_list(folder):
        return [source for line in _listed(folder) for source in sources_in(line)]
    if is_live(video) or not os.path.isdir(video) or is_recording(folder):  # (Path's raise OSError for long names)
        return [video]
    try:
        held = [path for path in folder.iterdir() if not path.name.startswith(".")]
    except OSError:
        return [video]  # (who opens it says why it cannot be read; the others go on)
    clips = [path for path in held if _is_clip(path)]
    films = sum(path.suffix.lower() not in ARRAYS for path in clips)
    if len(pictures_in(folder)) > films:  # (if they are no more, they are covers and stills of these)
        return [video]
    # (of recordings that were made before, perhaps into the folder of their videos, pictures are of probed pixels)
    folders = [path for path in held if _may_be_read(path) and holds_pictures(path) and not is_recording(path)]
    found = sorted(clips + folders, key=lambda path: natural(path.name))
    return [str(path) for path in found] or [video]


def clips_below(folder: Path) -> Path | None:
    """The first folder below one that stands for clips, if there is one not far below."""
    folders = (path for depth in range(1, DEEPEST + 1) for path in sorted(folder.glob("*/" * depth)))
    return next((path for path in islice(folders, MOST) if sources_in(str(path)) != [str(path)]), None)


def _is_clip(path: Path) -> bool:
    return path.suffix.lower() in CLIPS and path.is_file() and not path.stem.endswith("_timestamps")


def _may_be_read(path: Path) -> bool:
    """Whether it is a folder, and not one of the system's own."""
    return path.is_dir() and os.access(path, os.R_OK | os.X_OK)


def holds_pictures(folder: Path) -> bool:
    """Whether a folder has pictures in it."""
    return bool(pictures_in(folder))


def is_list(path: Path) -> bool:
    """Whether a file named NAME.txt is a list: a text that holds no events."""
    if path.suffix.lower() != LIST or not os.path.isfile(path):
        return False
    head = head_of(path)
    return (b"\0" not in head or head.startswith(UTF_16)) and recognise(path) is None


def _listed(path: Path) -> list[str]:
    """The lines of a list but for empty ones and those that begin with #.  Raises DataError, UsageError."""
    lines = [line.strip() for line in read_lines(path, "a list of videos, a line for each")]
    found = [line for line in lines if line and not line.startswith("#")]
    if not found:
        raise UsageError(f"{path} names no videos; expected a line for each")
    if inner := next((line for line in found if is_list(Path(line))), None):
        raise UsageError(f"{path} names {inner}, a list within a list; expected videos and folders of them")
    return found
