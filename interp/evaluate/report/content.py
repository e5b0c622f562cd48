"""What a report says, in its order: the answer, where it holds and breaks, beside the paper, what was left out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from interp.evaluate.conditions import varying
from interp.evaluate.remarks import several
from interp.evaluate.report.about import About
from interp.evaluate.report.beside_paper import comparison_table, quality_table
from interp.evaluate.report.blocks import Block, Cell, Document, Items, Line, Plot, Section, Table, Text
from interp.evaluate.report.coverage import fullest, many, shares, uneven
from interp.evaluate.report.frame_plots import distribution_plot, over_time_plot
from interp.evaluate.report.mean_plots import condition_plot, position_plot
from interp.evaluate.report.numbers import PSNR_DIGITS, SCORES, SSIM_DIGITS, spread
from interp.evaluate.report.overview import (
    breaking_points,
    by_method,
    condition_table,
    full_scale_table,
    position_table,
    protocol_table,
    sequence_table,
    set_table,
)
from interp.evaluate.report.worst import WorstFrame, worst_blocks
from interp.evaluate.row import Row
from interp.evaluate.tables import pooled, split
from vid2ev.terminal import counted

TITLE = "How well the frames between were rebuilt"
FROM_TRUTH = (
    "were simulated from light that passes exactly through the frames that are scored. That is kinder to every method"
    " that uses events than a real recording is, to those that add them up most of all."
)


def document(rows: Sequence[Row], about: About, worst: Sequence[WorstFrame] = ()) -> Document:
    """The report of rows.  Evaluations of several gaps get a chapter for each."""
    opening = list(_from_truth(rows, about.get("events_from_truth", ())))
    gaps = split(rows, lambda row: row.multiple)
    opening += [Text(_answer(gaps[multiple])) for multiple in sorted(gaps)]
    if not rows:
        opening.append(Text("No frame was scored.", warning=True))
    sections = [
        Section(f"{title}, {counted(multiple - 1, 'frame')} skipped" if len(gaps) > 1 else title, tuple(blocks))
        for multiple in sorted(gaps)
        for title, blocks in _chapter(gaps[multiple], about.get("sets", {})).items()
    ]
    if worst:
        sections.append(Section("The worst frames", tuple(worst_blocks(worst))))
    sections += _of_the_evaluation(rows, about)
    return Document(about.get("title", TITLE), tuple(opening), tuple(sections))


def _answer(rows: Sequence[Row]) -> str:
    """The best method and the second, in one sentence; and those that have other frames, which are neither."""
    parts, full, share = by_method(rows), fullest(rows), shares(rows)
    means = {method: pooled(part, "psnr") for method, part in parts.items()}
    scored = sorted((name for name in means if means[name].count), key=lambda name: -means[name].mean)
    frames = len({(row.sequence, row.group, row.position) for row in rows})
    sequences = len({row.sequence for row in rows})
    said = (
        f"{many(frames, 'frame')} of {many(sequences, 'sequence')}, {rows[0].multiple - 1} skipped between key frames"
    )
    if not scored:
        return f"{said}; no score is known."
    named = {name: f"{name}, {share[name]}," if share else name for name in scored}
    psnr = {name: f"{spread(means[name], PSNR_DIGITS)} dB" for name in scored}
    ranked = [name for name in scored if name in full] or scored
    best, *next_best = ranked
    ssim = pooled(parts[best], "ssim")
    said += f": {named[best]} has {psnr[best]} and SSIM {spread(ssim, SSIM_DIGITS)}"
    said += f", {named[next_best[0]]} {psnr[next_best[0]]}" if next_best else ""
    others = several(f"{named[name]} {psnr[name]}" for name in scored if name not in ranked)
    return f"{said}; over other frames, and not to be compared: {others}." if others else f"{said}."


def _from_truth(rows: Sequence[Row], simulated: Sequence[str]) -> Iterator[Block]:
    """What may not be forgotten where sequences have simulated events."""
    if simulated:
        of = "" if {row.sequence for row in rows} <= set(simulated) else f"of {', '.join(simulated)} "
        yield Text(f"The events {of}{FROM_TRUTH}", warning=True)


def _chapter(rows: Sequence[Row], sets: Mapping[str, Sequence[str]]) -> dict[str, list[Block]]:
    conditions = varying(rows)
    chapter: dict[str, list[Block]] = {
        "All methods": [*_warned(uneven(rows)), protocol_table(rows), full_scale_table(rows), *_uneven(rows)],
        "By data set": [set_table(rows, sets, field, name) for field, name in SCORES.items() if len(sets) > 1],
        "By sequence": [
            *_drawn(distribution_plot(rows), "PSNR of the frames of each sequence: middle half, all but 5 % on either"
                    " side, median."),
            *(sequence_table(rows, field, name) for field, name in SCORES.items()),
        ],
        "Between the key frames": [
            *_drawn(position_plot(rows), "Mean score at each place in the gap."),
            *(position_table(rows, field, name) for field, name in SCORES.items()),
        ],
        "Over time": [plot] if (plot := over_time_plot(rows)) else [],
    }  # fmt: skip
    for condition, edges in conditions:
        if not (plot := condition_plot(rows, condition, edges)):  # (of what is known, no score is)
            continue
        chapter[f"Against {condition.title}"] = [
            plot,
            *([Text(breaking_points(rows, condition, edges))] if condition.harder else []),
            *(condition_table(rows, condition, edges, field, name) for field, name in SCORES.items()),
        ]
    chapter["Beside the paper"] = [quality_table(rows), comparison_table(rows)]
    return {title: blocks for title, blocks in chapter.items() if blocks}


def _uneven(rows: Sequence[Row]) -> Iterator[Block]:
    """Means over different frames cannot be compared: then the same over the frames that all methods have."""
    parts = {
        method: {(row.sequence, row.group, row.position): row for row in part}
        for method, part in by_method(rows).items()
    }
    common = set.intersection(*map(set, parts.values()))
    if common and uneven(rows):
        yield Table(
            ("method", "PSNR, pooled", "SSIM, pooled"),
            tuple(_common_line(method, [part[key] for key in sorted(common)]) for method, part in parts.items()),
            "Over the frames that all methods have",
        )


def _common_line(method: str, rows: Sequence[Row]) -> Line:
    psnr, ssim = pooled(rows, "psnr"), pooled(rows, "ssim")
    return Line(method, (Cell(spread(psnr, PSNR_DIGITS)), Cell(spread(ssim, SSIM_DIGITS))))


def _warned(said: str) -> list[Block]:
    return [Text(said, warning=True)] if said else []


def _drawn(svg: str | None, caption: str) -> list[Block]:
    return [] if svg is None else [Plot(svg, caption)]


def _of_the_evaluation(rows: Sequence[Row], about: About) -> Iterator[Section]:
    left_out = dict(about.get("not_scored", {}))
    if unknown := sum(math.isnan(row.psnr) for row in rows):
        left_out["rebuilt, but without a PSNR"] = unknown
    blocks: list[Block] = []
    if left_out:
        lines = tuple(Line(reason, (Cell(f"{count:,}"),)) for reason, count in left_out.items())
        blocks.append(Table(("reason", "number"), lines))
    if remarks := (*about.get("remarks", ()), *_unknown_motion(rows)):
        blocks.append(Items(remarks))
    yield Section("What was not scored", tuple(blocks or [Text("Nothing was left out.")]))
    if sequences := about.get("sequences"):
        head = tuple(next(iter(sequences.values())))
        lines = tuple(
            Line(name, tuple(Cell(_value(facts[title])) for title in head)) for name, facts in sequences.items()
        )
        yield Section("Sequences", (Table(("sequence", *head), lines, words=2),))
    for title, facts in (("Settings", about.get("settings")), ("Versions", about.get("versions"))):
        if facts:
            lines = tuple(Line(name, (Cell(_value(value)),)) for name, value in facts.items())
            yield Section(title, (Table(("", ""), lines, words=2),))


def _unknown_motion(rows: Sequence[Row]) -> Iterator[str]:
    frames = {(row.multiple, row.sequence, row.group, row.position): row.motion_px for row in rows}
    if unknown := sum(map(math.isnan, frames.values())):
        yield (
            f"the motion between the key frames is not known of {unknown} of {many(len(frames), 'frame')}, which are"
            " not among those against motion, speed and blur: optical flow does not follow what changes, as where it"
            " moves far, flickers or is noise"
        )


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(_value, value))
    return str(value)
