"""EXR files of numbers as they are: float32, without a curve, of any range."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vid2ev.untrusted import openexr, plain_name


def write_exr(path: Path, channels: Mapping[str, np.ndarray]) -> None:
    """A file of channels [H, W] float32 by their names, such as R, G, B or Z, compressed without loss.

    Raises UsageError where the package OpenEXR is not installed, OSError where the disk does not take it.
    """
    library = openexr(path)
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    content = {name: np.ascontiguousarray(channel, np.float32) for name, channel in channels.items()}
    with plain_name(path) as plain:
        try:
            library.File(header, content).write(plain)
        except RuntimeError as error:  # (of the library, for whatever the disk says)
            raise OSError(f"{path} cannot be written") from error
