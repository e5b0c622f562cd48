"""What Blender answers: multi-layer EXR files, as a picture.

    LAYER.Depth.Z           z of the camera [m]; 1e10 where nothing is
    LAYER.Object Index.X    the number of the thing + 1; 0 where nothing is
    LAYER.Combined.R, G, B  linear light

Source: Blender's manual, "Render passes"; channels are called as in files of 5.0 (of 4.x, the index is IndexOB.X).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.scenes.render import Picture
from vid2ev.untrusted import openexr, plain_name

NOTHING, NOTHING_M = -1, 1e9  # and what is beyond
DEPTH, INDEX = (".Depth.Z",), (".Object Index.X", ".IndexOB.X")
LIGHT = ((".Combined.R",), (".Combined.G",), (".Combined.B",))


def read_answers(paths: Sequence[Path], size: tuple[int, int], larger: np.ndarray) -> Picture:
    """The picture of a geometry and of the light of one or more lamps; `larger` is that of `exchange.Request`.

    Raises DataError for files that are no such answers, UsageError without the package that reads them.
    """
    depth, index = channels_of(paths[0], [DEPTH, INDEX], size)
    light = np.zeros((size[1], size[0], 3), np.float32)
    for path in paths[1:]:
        light += np.stack(channels_of(path, LIGHT, size), axis=-1)
    thing = np.where(depth < NOTHING_M, np.rint(index) - 1, NOTHING).astype(np.int32)
    if thing.min() < NOTHING or thing.max() >= len(larger):
        raise DataError(f"{paths[0]}: has numbers of things from {thing.min()} to {thing.max()}; render it again")
    far = np.where(thing == NOTHING, np.inf, depth / np.append(larger, 1.0)[thing])
    return Picture(light, far.astype(np.float32), thing)


def channels_of(path: Path, wanted: Sequence[Sequence[str]], size: tuple[int, int]) -> list[np.ndarray]:
    """Channels [H, W] float32 of a file, each by the first of some ends of its name."""
    library = openexr(path)
    try:
        with plain_name(path) as plain, library.File(plain, separate_channels=True, num_threads=0) as file:
            found = {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}
    except Exception as error:  # (the library raises whatever it comes across)
        raise DataError(f"{path}: not an EXR file that can be read; render it again") from error
    names = [next((name for end in ends for name in found if f".{name}".endswith(end)), None) for ends in wanted]
    if None in names:
        missing = wanted[names.index(None)][0][1:]
        raise DataError(f"{path}: has no channel {missing}, only {', '.join(found)}; use Blender 4.2 or later")
    arrays = [np.asarray(found[name], np.float32) for name in names if name is not None]
    if any(array.shape != (size[1], size[0]) for array in arrays):
        raise DataError(f"{path}: is no picture of {size[0]}x{size[1]} pixels; render it again")
    return arrays
