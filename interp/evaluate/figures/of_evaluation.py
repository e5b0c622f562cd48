"""Figures of an evaluation, of the first gaps of its first sequences.

    figures/SEQUENCE/METHOD.mp4     frame camera, events, rebuilt and truth: the scored frames, slowly
    figures/SEQUENCE/moments.png    methods by moments of that gap of these in which scores are lowest
    figures/SEQUENCE/errors.png     maps of the error halfway through it, all on one scale

Pictures are made again for them, as an evaluation keeps none but the worst.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from interp.evaluate.figures.four_panels import panel as four_panels
from interp.evaluate.figures.four_panels import write_four_panels
from interp.evaluate.figures.heat_map import error_codes, top_of
from interp.evaluate.figures.heat_map import panel as heat_map
from interp.evaluate.figures.layout import below, beside, filled, in_proportion, resized, titled
from interp.evaluate.figures.lettering import strip
from interp.evaluate.figures.moments import write_moments
from interp.evaluate.figures.png import write_png
from interp.evaluate.figures.worst_patch import PATCH_PX
from interp.evaluate.group import Footage, Group
from interp.evaluate.rebuilders import Rebuilder
from interp.evaluate.row import Row
from interp.evaluate.tables import lowest, pooled

FOLDER = "figures"
SEQUENCES, GAPS, MOMENTS = 3, 4, 3
PER_SECOND = 10  # frames of a film
FILM_PX, MAP_PX = (240, 480), (160, 320)  # widths of pictures: no less, no more
ACROSS = 3  # maps beside each other

Made = Mapping[str, Sequence[np.ndarray]]  # of each method


def write_figures(
    folder: Path, footage: Sequence[Footage], methods: Sequence[Rebuilder], rows: Sequence[Row]
) -> list[Path]:
    """Write the figures of an evaluation's folder, and say which; each is there as a whole or not at all.

    footage, methods, rows   of the evaluation
    Raises DataError.
    """
    parts = [(each, [row for row in rows if row.sequence == each.name]) for each in footage]
    return [
        path
        for each, scored in [(each, scored) for each, scored in parts if scored][:SEQUENCES]
        for path in _of_sequence(folder / FOLDER / each.name, each, methods, scored)
    ]


def _of_sequence(folder: Path, footage: Footage, methods: Sequence[Rebuilder], rows: Sequence[Row]) -> list[Path]:
    gaps = sorted({row.group for row in rows})[:GAPS]
    hardest = min(gaps, key=lambda gap: pooled((row for row in rows if row.group == gap), "psnr_255").mean)
    running = [method.begin(footage) for method in methods]
    panels: dict[str, list[np.ndarray]] = {}
    for group in footage.groups():
        if group.number > gaps[-1]:
            break
        drawn = group.number in gaps
        pictures_of = {method.name: method.frames(group) for method in running if drawn or method.sequential}
        if not drawn:
            continue
        made = whole(pictures_of)
        for name, pictures in made.items():
            panels.setdefault(name, []).extend(film_panels(group, name, pictures))
        if group.number == hardest and made:
            own = [row for row in rows if row.group == hardest]
            _write_moments(folder / "moments.png", group, made, own)
            write_png(folder / "errors.png", error_sheet(group.truth, made))
    for name, shown in panels.items():
        write_four_panels(folder / f"{name}.mp4", shown, PER_SECOND)
    return sorted(folder.iterdir()) if folder.exists() else []


def whole(made: Mapping[str, Sequence[np.ndarray | None]]) -> dict[str, list[np.ndarray]]:
    """The methods that lack no picture of a gap."""
    there = {name: [picture for picture in pictures if picture is not None] for name, pictures in made.items()}
    return {name: pictures for name, pictures in there.items() if len(pictures) == len(made[name])}


def film_panels(group: Group, name: str, made: Sequence[np.ndarray]) -> list[np.ndarray]:
    """A picture of four panels for each scored frame of a gap, with the events since the one before."""
    high, wide = group.truth.shape[1:3]
    width = min(max(wide, FILM_PX[0]), FILM_PX[1])
    size = width, in_proportion(high, wide, width)
    steps = group.events.off_on.shape[2]
    shares = (group.times_us[list(group.positions)] - group.times_us[0]) / group.gap_us
    edges = np.rint(np.append(0, shares) * steps).astype(int)
    before = resized(group.keys[0], *size)
    return [
        four_panels(
            before, group.events.off_on[0, :, first:last].sum(1).numpy(), resized(picture, *size), resized(true, *size),
            ("frame camera", "event camera", name, "truth"),
        )
        for (first, last), picture, true in zip(pairwise(edges), made, group.truth, strict=True)
    ]  # fmt: skip


def error_sheet(truth: np.ndarray, made: Made) -> np.ndarray:
    """The true picture halfway through a gap, and where each method errs there; uint8 [H, W, 3]."""
    middle = len(truth) // 2
    high, wide = truth.shape[1:3]
    width = min(max(wide, MAP_PX[0]), MAP_PX[1])
    size = width, in_proportion(high, wide, width)
    errors = {name: error_codes(truth[middle], pictures[middle]) for name, pictures in made.items()}
    top = top_of(np.stack(list(errors.values())))
    maps = {name: heat_map(resized(values, *size), high=top) for name, values in errors.items()}
    height, width = next(iter(maps.values())).shape[:2]
    cells = {"truth": filled(resized(truth[middle], *size), height, width), **maps}
    shown = [titled(picture, strip(name, width)) for name, picture in cells.items()]
    return below([beside(shown[k : k + ACROSS]) for k in range(0, len(shown), ACROSS)])


def _write_moments(path: Path, group: Group, made: Made, rows: Sequence[Row]) -> None:
    count = len(group.positions)
    picked = sorted({round(k) for k in np.linspace(0, count - 1, MOMENTS)})
    rebuilt = {name: [pictures[k] for k in picked] for name, pictures in made.items()}
    lines = {"truth": [*group.truth[picked]], **rebuilt}
    moments = [f"{group.positions[k]}/{len(group.times_us) - 1}" for k in picked]
    write_moments(path, lines, moments, patch_of(rows, *group.truth.shape[1:3]))


def patch_of(rows: Sequence[Row], high: int, wide: int) -> tuple[int, int, int, int]:
    """The middle of the worst window of rows: a square of at most half the picture."""
    side = max(1, min(PATCH_PX, high // 2, wide // 2))
    worst = lowest(rows, "patch_psnr")
    left, top = (worst.patch_x, worst.patch_y) if worst else (0, 0)
    return left + (min(PATCH_PX, wide) - side) // 2, top + (min(PATCH_PX, high) - side) // 2, side, side
