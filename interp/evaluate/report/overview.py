"""Tables of all methods: the protocol's scores, those against 255, by sequence, by place in the gap, by condition."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from interp.evaluate.conditions import Condition
from interp.evaluate.report.blocks import Cell, Line, Table
from interp.evaluate.report.coverage import fullest
from interp.evaluate.report.numbers import cells, digits_of, marked, number, short, spread
from interp.evaluate.row import Row
from interp.evaluate.tables import Bin, Mean, binned, breaks_at, by_position, least, per_sequence, pooled, split

CLEARLY_DB = 3.0  # by which a score has broken down
NOTHING = Mean(math.nan, math.nan, 0)
PROTOCOL = "Each frame against the range of its own truth, key frames not scored."
FULL_SCALE = (
    "Against 255. Moving pixels are those whose truth is more than 10 codes away from either key frame."
    " The worst patch is the least of all 99×99 windows of all frames, PSNR and SSIM each for itself;"
    " of a frame that is smaller, all of it."
)


def by_method(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The rows of each method."""
    return split(rows, lambda row: row.method)


def best_method(rows: Sequence[Row]) -> str | None:
    """The method of the highest mean PSNR, of those with the most frames, and the same; None if none has a score."""
    full = fullest(rows)
    means = {method: pooled(part, "psnr") for method, part in by_method(rows).items() if method in full}
    return max((name for name in means if means[name].count), key=lambda name: means[name].mean, default=None)


def protocol_table(rows: Sequence[Row]) -> Table:
    """Pooled and per sequence, by the Time Lens protocol."""
    means: list[tuple[str, Callable[[Sequence[Row], str], Mean], str]] = [
        ("PSNR, pooled", pooled, "psnr"),
        ("SSIM, pooled", pooled, "ssim"),
        ("PSNR, of sequences", per_sequence, "psnr"),
        ("SSIM, of sequences", per_sequence, "ssim"),
    ]
    parts, full = by_method(rows), fullest(rows)
    columns = [
        [(found.mean, spread(found, digits_of(field))) for found in (mean(part, field) for part in parts.values())]
        for _, mean, field in means
    ]
    counts = [Cell(f"{len(part):,}") for part in parts.values()]
    lines = zip(parts, counts, marked(columns, [method in full for method in parts]), strict=True)
    return Table(
        ("method", "frames", *(name for name, _, _ in means)),
        tuple(Line(method, (count, *line)) for method, count, line in lines),
        "Time Lens protocol",
        PROTOCOL + " “Pooled” is the mean ± standard deviation over all frames, “of sequences” over the means of the"
        " sequences.",
    )


def full_scale_table(rows: Sequence[Row]) -> Table:
    """Against 255: all, moving and static pixels, and the worst."""
    means = {"PSNR": "psnr_255", "SSIM": "ssim_255", "moving": "psnr_moving", "static": "psnr_static"}
    worst = {
        "worst frame, PSNR": "psnr_255",
        "worst frame, SSIM": "ssim_255",
        "worst patch, PSNR": "patch_psnr",
        "worst patch, SSIM": "patch_ssim",
    }
    parts, full = by_method(rows), fullest(rows)
    columns = [[_plain(pooled(part, field).mean, field) for part in parts.values()] for field in means.values()]
    columns += [[_plain(least(part, field), field) for part in parts.values()] for field in worst.values()]
    lines = zip(parts, marked(columns, [method in full for method in parts]), strict=True)
    return Table(
        ("method", *means, *worst),
        tuple(Line(method, line) for method, line in lines),
        "Against full scale, and the worst",
        FULL_SCALE,
    )


def set_table(rows: Sequence[Row], sets: Mapping[str, Sequence[str]], field: str, title: str) -> Table:
    """A line for each data set, of all its frames."""
    parts = by_method(rows)
    lines = [
        Line(
            name,
            cells(
                [pooled([row for row in part if row.sequence in of], field) for part in parts.values()],
                _shown(field),
            ),
        )
        for name, of in sets.items()
    ]
    return Table(("data set", *parts), tuple(lines), title)


def sequence_table(rows: Sequence[Row], field: str, title: str) -> Table:
    """A line for each sequence, and one for all frames."""
    parts = by_method(rows)
    lines = []
    for sequence, scored in split(rows, lambda row: row.sequence).items():
        own = by_method(scored)
        found = [pooled(own.get(method, []), field) for method in parts]
        lines.append(Line(sequence, cells(found, _shown(field))))
    everything = [pooled(part, field) for part in parts.values()]
    lines.append(Line("all frames", cells(everything, _shown(field))))
    return Table(("sequence", *parts), tuple(lines), title)


def position_table(rows: Sequence[Row], field: str, title: str) -> Table:
    """A line for each place between the key frames."""
    parts = {method: by_position(part, field) for method, part in by_method(rows).items()}
    lines = []
    for position in sorted({row.position for row in rows}):
        found = [places.get(position, NOTHING) for places in parts.values()]
        lines.append(Line(f"{position}/{rows[0].multiple}", cells(found, _shown(field))))
    return Table(("place in the gap", *parts), tuple(lines), title, folded=True)


def condition_table(rows: Sequence[Row], condition: Condition, edges: Sequence[float], field: str, title: str) -> Table:
    """A line for each bin of a condition."""
    parts = {
        method: {one.low: one for one in binned(part, condition.field, field, edges)}
        for method, part in by_method(rows).items()
    }
    lines = []
    for low in sorted({low for bins in parts.values() for low in bins}):
        here = [bins.get(low) for bins in parts.values()]
        some = next(one for one in here if one is not None)
        frames = max(one.score.count for one in here if one is not None)
        found = [NOTHING if one is None else one.score for one in here]
        lines.append(Line(_span(some, edges), (Cell(f"{frames:,}"), *cells(found, _shown(field)))))
    return Table((f"{condition.axis} [{condition.unit}]", "frames", *parts), tuple(lines), title, folded=True)


def breaking_points(rows: Sequence[Row], condition: Condition, edges: Sequence[float]) -> str:
    """From where on each method is clearly worse than where the condition is easiest, in one sentence."""
    said = []
    for method, part in by_method(rows).items():
        bins = binned(part, condition.field, "psnr", edges)
        if bins:
            found = breaks_at(bins, CLEARLY_DB)
            said.append(f"{method} {'nowhere' if found is None else f'from {short(found.low, edges)}'}")
    if said and all(each.endswith(" nowhere") for each in said):
        return f"No method is more than {CLEARLY_DB:g} dB below its own mean in the first bin."
    return f"More than {CLEARLY_DB:g} dB below its own mean in the first bin [{condition.unit}]: {', '.join(said)}."


def _span(one: Bin, edges: Sequence[float]) -> str:
    """What a bin is of: one value where values are a bin each, otherwise from edge to edge."""
    if one.low == one.high or (math.isclose(one.at, one.low) and edges[-1] == edges[-2]):
        return short(one.low, edges)
    return f"{short(one.low, edges)} … {short(one.high, edges)}"


def _plain(value: float, field: str) -> tuple[float, str]:
    return value, number(value, digits_of(field))


def _shown(field: str) -> Callable[[float], str]:
    return lambda value: number(value, digits_of(field))
