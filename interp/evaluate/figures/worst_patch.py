"""A frame that went wrong: truth, rebuilt, maps of the error, the worst patch of each (the paper's Fig. 13)."""

from __future__ import annotations

import numpy as np

from interp.evaluate.figures.heat_map import error_codes, top_of
from interp.evaluate.figures.heat_map import panel as heat_map
from interp.evaluate.figures.layout import below, beside, cut, framed, in_proportion, resized, titled
from interp.evaluate.figures.lettering import strip
from vid2ev.errors import UsageError

PATCH_PX = 99
WIDTH_PX = 3 * PATCH_PX  # of each picture


def panel(
    truth: np.ndarray,
    rebuilt: np.ndarray,
    corner: tuple[int, int],
    similarity: np.ndarray | None = None,
    width: int = WIDTH_PX,
) -> np.ndarray:
    """Two pictures and their error, and below them the patch of 99x99 pixels at a corner (left, top); uint8 [H, W, 3].

    Pictures are uint8 [H, W, 3] of one size; `similarity` is their map of SSIM [H, W], NaN where there is none.  Each
    column is `width` wide.  Where pictures are smaller than a patch, the patch is as wide or as high as they are.
    Raises UsageError for sizes that differ, and for a patch outside.
    """
    errors = error_codes(truth, rebuilt)
    high, wide = errors.shape
    box = (*corner, min(PATCH_PX, wide), min(PATCH_PX, high))
    maps = [("error", errors, {"high": top_of(errors)})]
    if similarity is not None:
        if similarity.shape != errors.shape:
            raise UsageError(
                f"SSIM {list(similarity.shape)}: expected a map [{high}, {wide}], as large as the pictures"
            )
        maps.append(("SSIM", similarity, {"low": 1.0, "high": 0.0}))
    tall, tall_patch = in_proportion(high, wide, width), in_proportion(box[3], box[2], width)
    above, patches = [], []
    for name, picture in (("truth", truth), ("rebuilt", rebuilt)):
        above.append(_named(name, framed(picture, box, width, tall)))
        patches.append(_named(f"{name}, worst patch", resized(cut(picture, box), width, tall_patch)))
    for name, values, scale in maps:
        unit = "codes" if name == "error" else ""
        above.append(_named(name, heat_map(resized(values, width, tall), unit=unit, **scale)))
        patches.append(
            _named(f"{name} there", heat_map(resized(cut(values, box), width, tall_patch), unit=unit, **scale))
        )
    return below([beside(above), beside(patches)])


def _named(name: str, picture: np.ndarray) -> np.ndarray:
    return titled(picture, strip(name, picture.shape[1]))
