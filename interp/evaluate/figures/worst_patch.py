"""A frame that went wrong: truth, rebuilt, the error, and the worst patch of both, larger (the paper's Fig. 13)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from interp.evaluate.figures.heat_map import error_codes, top_of
from interp.evaluate.figures.heat_map import panel as heat_map
from interp.evaluate.figures.layout import below, beside, cut, framed, resized, titled
from interp.evaluate.figures.lettering import strip
from interp.evaluate.figures.png import write_png

PATCH_PX = 99
WIDTH_PX = 3 * PATCH_PX  # of each picture


def panel(truth: np.ndarray, rebuilt: np.ndarray, corner: tuple[int, int], width: int = WIDTH_PX) -> np.ndarray:
    """Two pictures and their error, and below it the patch of 99x99 pixels at a corner (left, top); uint8 [H, W, 3].

    Pictures are uint8 [H, W, 3] of one size; each column is so wide.  Where they are smaller than a patch, the patch
    is as wide or as high as they are.  Raises UsageError.
    """
    errors = error_codes(truth, rebuilt)
    high, wide = truth.shape[:2]
    box = (*corner, min(PATCH_PX, wide), min(PATCH_PX, high))
    tall = max(1, round(high * width / wide))
    pictures = {"truth": truth, "rebuilt": rebuilt}
    wholes = [_named(name, framed(one, box, width, tall)) for name, one in pictures.items()]
    tall_patch = max(1, round(box[3] * width / box[2]))
    patches = [
        _named(f"{name}, worst patch", resized(cut(one, box), width, tall_patch)) for name, one in pictures.items()
    ]
    top = top_of(errors)
    maps = [
        _named(name, heat_map(resized(values, width, height), high=top))
        for name, values, height in (("error", errors, tall), ("error of the patch", cut(errors, box), tall_patch))
    ]
    return below([beside([*wholes, maps[0]]), beside([*patches, maps[1]])])


def write_worst_patch(path: Path, truth: np.ndarray, rebuilt: np.ndarray, corner: tuple[int, int]) -> None:
    """Write a panel as a PNG file; raises DataError."""
    write_png(path, panel(truth, rebuilt, corner))


def _named(name: str, picture: np.ndarray) -> np.ndarray:
    return titled(picture, strip(name, picture.shape[1]))
