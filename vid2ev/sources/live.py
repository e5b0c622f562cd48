"""Videos that are live: standard input, and cameras.

    -            a video on standard input, in any container that can be read from its start on: Y4M, Matroska, MPEG-TS,
                 fragmented MP4
    camera:0     the first camera; on Linux /dev/video0, on macOS the first of AVFoundation; on Windows its name after
                 the colon

They are read only as their frames are taken, so that what writes into a pipe waits.  What a pipe gives is kept for
whoever wants to read it again (`kept.py`).  A camera counts its time from its first frame, and goes on until it is told
to stop.
"""

from __future__ import annotations

import sys
from typing import Any

import av

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.footage import LiveStream, Piped, reason
from vid2ev.sources.kept import Kept

_opened: list[tuple[Any, Kept]] = []  # the stream that was standard input last, and what was read of it


def open_standard_input() -> Piped:
    """The video on standard input; once more, from its first frame on, until frames were taken of it.

    Raises UsageError if nothing is piped in or it was read already, DataError if it is no video.
    """
    stdin = getattr(sys.stdin, "buffer", None)
    if stdin is None or sys.stdin.isatty():
        raise UsageError("-: nothing is piped in; write `... | vid2ev convert -`, or give a file")
    if not _opened or _opened[0][0] is not stdin:
        _opened[:] = [(stdin, Kept(stdin, "standard input"))]
    kept = _opened[0][1]
    kept.wanted = True
    return Piped(kept)


def open_camera(text: str) -> LiveStream:
    """The camera of a number or name.  Raises DataError if there is none."""
    device, options = device_of(text, sys.platform)
    try:
        container = av.open(device, **options)
    except (av.FFmpegError, ValueError) as error:
        raise DataError(
            f"camera:{text}: no camera that can be opened as {device} ({reason(error)}); connect one, close what"
            " else uses it, or give another number"
        ) from error
    return LiveStream(container, f"camera:{text}")


def device_of(text: str, platform: str) -> tuple[str, dict[str, Any]]:
    """What FFmpeg calls a camera, and how it is opened.  Raises UsageError."""
    if not text or (platform == "win32" and text.isdecimal()):
        expected = "its name, such as camera:Integrated Camera" if platform == "win32" else "a number, such as camera:0"
        raise UsageError(f"camera:{text}: expected {expected}")
    if platform == "darwin":
        return f"{text}:none", {"format": "avfoundation", "options": {"framerate": "30"}}
    if platform == "win32":
        return f"video={text}", {"format": "dshow"}
    return (f"/dev/video{text}" if text.isdecimal() else text), {"format": "v4l2"}
