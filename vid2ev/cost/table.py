"""What was measured as text for people."""

from __future__ import annotations

from collections.abc import Sequence

from vid2ev.cost.front import Row, refusal
from vid2ev.cost.measure import Cost
from vid2ev.cost.quality import Quality
from vid2ev.cost.stretch import Stretch
from vid2ev.terminal import counted

SILENT = "nothing happens in the part of the clip that was tried, vid2ev cost --start S tries another"


def table(cost: Cost, *, recommending: bool = True) -> str:
    """The table, what makes light between the frames best, and the recommendation, if it is wanted."""
    lines = [*_headed(cost), ""]
    for way, found in cost.between.items():
        if found is not None:
            lines.append(f"a frame left out, made by --upsample {way}: {_shown(found)}")
    lines += [f"warning: {warning}" for warning in cost.warnings]
    return "\n".join([*lines, *[recommendation(cost)] * recommending]).rstrip()


def recommendation(cost: Cost) -> str:
    """The setting to take, in one line."""
    best = cost.recommended
    if best is None:
        return refusal(cost.settings, cost.budget)
    asked = best.rung.arguments() or "nothing to set"
    silent = cost.reference.events == 0 and best.errors.distance is not None
    doubt = f"; of no events, which says little: {SILENT}" * silent
    return f"within {cost.budget.text}: {best.rung.name} ({asked}), {best.time:.2g} x the length{_errors(best)}{doubt}"


def cells(cost: Cost) -> list[list[str]]:
    """Head and rows of the table: a mark (* on the front, > recommended), the setting, times, errors, what to type."""
    everyone = [cost.reference, *cost.rows]
    dvs = any(row.errors.distance is not None for row in everyone)
    cis = any(row.errors.rms_lsb is not None for row in everyone)
    views = any(row.errors.views is not None for row in everyone)
    head = ["", "setting", "x length", "median"]
    head += ["vR", "count", "timing, us", "95 %"] * dvs + ["frames, LSB"] * cis + ["views"] * views
    ahead, best = cost.front, cost.recommended
    lines = [[*head, "convert ..."]]
    for row in everyone:
        mark = ">" if row is best else "*" if row in ahead else ""
        cut = [mark, row.rung.name, f"{row.time:.3g}", f"{_median(row.times):.3g}"]
        cut += _of_events(row) * dvs + [_lsb(row)] * cis + [_shown(row.errors.views)] * views
        lines.append([*cut, row.rung.arguments() if row.rung.offered else _aside(row)])
    return lines


def _headed(cost: Cost) -> list[str]:
    width, height = cost.size
    part = stretch_in_words(cost.stretch_s)
    threads = counted(cost.threads, "thread")
    return [
        f"{cost.clip}, {part}, {width}x{height}, {threads}; errors against the reference",
        "",
        *columns(cells(cost)),
    ]


def stretch_in_words(stretch_s: Stretch) -> str:
    """Which part of a clip that is."""
    begin, end = stretch_s
    if begin is None and end is None:
        return "all of it"
    return f"from {begin:g} s on" if end is None else f"from {begin or 0:g} to {end:g} s"


def columns(lines: Sequence[Sequence[str]]) -> list[str]:
    """Lines of cells below each other."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]) - 1)]
    return ["  ".join(_set(line, widths)).rstrip() for line in lines]


def _set(line: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Names to the left, numbers to the right."""
    *shown, last = line
    sides = zip(shown, widths, strict=True)
    return [*(cell.ljust(wide) if k < 2 else cell.rjust(wide) for k, (cell, wide) in enumerate(sides)), last]


def _aside(row: Row) -> str:
    """What is compared but not offered."""
    if row.rung.float64:
        return f"{row.rung.arguments()} (float64)".strip()
    return f"{row.rung.arguments()} (another recording)" if row.rung.group else row.rung.arguments()


def _of_events(row: Row) -> list[str]:
    errors = row.errors
    if errors.distance is None:
        return ["-"] * 4
    median, most = ("-", "-") if errors.timing_us is None else map(str, errors.timing_us)
    count = "-" if errors.count_error is None else f"{100 * errors.count_error:.2g} %"
    return [f"{errors.distance:.2g}", count, median, most]


def _lsb(row: Row) -> str:
    return "-" if row.errors.rms_lsb is None else f"{row.errors.rms_lsb:.2g}"


def _shown(found: Quality | None) -> str:
    return "-" if found is None else f"{found.psnr_db:.1f} dB, SSIM {found.ssim:.3f}"


def _errors(row: Row) -> str:
    errors, said = row.errors, []
    if errors.distance is not None:
        said.append(f"vR {errors.distance:.2g}")
    if errors.timing_us is not None:
        said.append(f"{errors.timing_us[0]} us")
    if errors.rms_lsb is not None:
        said.append(f"{errors.rms_lsb:.2g} LSB")
    return "".join(f", {text}" for text in said)


def _median(times: Sequence[float]) -> float:
    ordered = sorted(times)
    return (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
