"""Pictures as PNG files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vid2ev.recording.disk import whole_file, writing


def encoded(picture: np.ndarray) -> bytes:
    """The PNG file of a picture, R'G'B' uint8 [H, W, 3]."""
    import cv2

    return cv2.imencode(".png", np.ascontiguousarray(picture[..., ::-1]))[1].tobytes()


def write_png(path: Path, picture: np.ndarray) -> None:
    """Write a picture, which is there as a whole or not at all; raises DataError."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as file:
            file.write(encoded(picture))
