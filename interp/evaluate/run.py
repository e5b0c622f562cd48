"""An evaluation: every method rebuilds every group of every sequence, and what is known of each frame becomes a row.

REPORT/rows.csv        a line for each frame and method         REPORT/report.md, .html   what it comes to, for people
REPORT/summary.json    what they come to                        REPORT/worst/             pictures of the worst frames
REPORT/job.json, kept/ what it takes to go on                REPORT/figures/           films and sheets, if asked for

Sequences are gone through in order, and groups within, all methods together, so that a film is simulated once.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from interp.evaluate.figures.of_evaluation import write_figures
from interp.evaluate.group import Footage, Group
from interp.evaluate.kept import Kept, KeptRows
from interp.evaluate.prediction_folders import passed_over
from interp.evaluate.predictions import predictions_in
from interp.evaluate.protocol import Protocol
from interp.evaluate.rebuilders import Rebuilder, methods_of
from interp.evaluate.remarks import not_scored
from interp.evaluate.report.of_evaluation import write_pages
from interp.evaluate.row import Row
from interp.evaluate.rows import ROWS, write_rows
from interp.evaluate.scoring import conditions_of, rows_of
from interp.evaluate.sets import Found, check_simulated, footage_of
from interp.evaluate.simulated import Simulated
from interp.evaluate.summary import summarised
from interp.evaluate.worst import WorstPictures, lost, prune
from interp.methods import METHODS
from vid2ev.cluster.task import Task, Tell, share_of
from vid2ev.cluster.work import Share, outcomes
from vid2ev.cluster.workers import Workers
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing
from vid2ev.recording.manifest import versions
from vid2ev.requests import is_whole
from vid2ev.terminal import counted

SUMMARY = "summary.json"
FEWEST = 3  # frames of which one can be rebuilt
ALONE = Workers()
Report = Callable[[int, int, str], object]  # groups done, of about how many, and the sequence


@dataclass(frozen=True)
class Evaluation:
    """All rows, in order of sequences, methods, groups and positions; and what they come to (`summary.json`)."""

    rows: list[Row]
    summary: dict[str, Any]


def evaluate(
    datasets: Sequence[str | Path],
    folder: str | Path,
    *,
    networks: Sequence[str | Path] = (),
    baselines: Sequence[str] = tuple(METHODS),
    predictions: Sequence[str | Path] = (),
    protocol: Protocol | None = None,
    simulated: Simulated | None = None,
    limit: int | None = None,
    resume: bool = False,
    device: str = "cpu",
    report: Report | None = None,
    figures: bool = False,
    workers: Workers = ALONE,
    share: Share = outcomes,
) -> Evaluation:
    """Score methods on data sets, into a folder.

    datasets      folders with recordings (own, HS-ERGB, BS-ERGB), videos, folders of these or of pictures, `scene:NAME`
    networks      weights (`interp.pretrained.path_of`)
    baselines     names of closed forms (`interp.methods.METHODS`)
    predictions   folders with pictures that others have made (`predictions.py`)
    simulated     the event camera that looks at films; by default a clean one, and without films none
    limit         groups of each sequence, from its first on
    resume        go on with what is in the folder; methods may be added
    figures       films and sheets of the first gaps, too (`figures/of_evaluation.py`)
    report        told how far it is where sequences are not shared out
    workers       who score a sequence each; they change nothing but the time it takes
    share         shares sequences out among several workers
    Raises UsageError for what cannot be meant, DataError for what cannot be read or written, or where nothing is
    scored.
    """
    for several in (datasets, networks, baselines, predictions):
        if isinstance(several, str | Path):
            raise UsageError(f"{several}: expected a list, also of one; give ['{several}']")
    if not datasets:
        raise UsageError("no data set: expected folders of recordings, videos or scene:NAME")
    if limit is not None and not is_whole(limit, 1):
        raise UsageError(f"limit {limit!r}: expected a whole number of at least 1; leave it out for all gaps")
    for name, value, kind in (("protocol", protocol, Protocol), ("simulated", simulated, Simulated)):
        if not isinstance(value, kind | None):
            raise UsageError(f"{name} {value!r}: expected a {kind.__name__}; leave it out for the usual one")
    folder, protocol = Path(folder), protocol or Protocol()
    sensor = replace(simulated or Simulated.of("clean"), threads=None if workers.alone else workers.threads)
    methods: list[Rebuilder] = [*methods_of(baselines, networks, protocol, device)]
    if not (methods or predictions):
        raise UsageError("nothing to score: expected a baseline, a network or predictions")
    found = footage_of([*map(str, datasets)], protocol, sensor, limit, [folder])
    check_simulated(found.footage, simulated)
    for place in predictions:
        methods += predictions_in(place, found.footage, [folder])
        if said := passed_over(Path(place), found.footage):
            found.unusable[str(place)] = said
    _check(methods)
    job = {
        "vid2ev": versions()["vid2ev"], "protocol": asdict(protocol), "limit": limit, "device": device,
        "sensor": sensor.describe(), "sequences": {each.name: each.identity for each in found.footage},
    }  # fmt: skip
    with Kept(folder, job, {method.name: method.identity for method in methods}, resume) as kept:
        frames = len(protocol.positions)
        _forget_unseen(found.footage, methods, kept)
        if not workers.alone:
            _share_out(found.footage, methods, frames, kept, workers, share)
            report = None
        rows, about = _scored(found.footage, methods, frames, kept, report)
        if not rows:
            reasons = [*(_unscored(name, of, protocol) for name, of in about.items()), *found.reasons]
            raise DataError(f"no frame could be scored: {'; '.join(reasons[:3])}")
        for method in methods:
            prune(folder, method.name, rows)
        summary = _summary(job, found, methods, rows, about)
        with writing(folder, THEN_RESUME):
            write_rows(folder / ROWS, rows)
            with whole_file(folder / SUMMARY) as file:
                file.write(f"{json.dumps(summary, indent=1, allow_nan=False)}\n".encode())
        write_pages(folder, rows, summary)
        if figures:
            write_figures(folder, found.footage, methods, rows)
    return Evaluation(rows, summary)


def _unscored(name: str, about: Mapping[str, Any], protocol: Protocol) -> str:
    """Why nothing of a sequence was scored."""
    if reasons := not_scored({"sequences": {name: about}}):
        return f"{name}: {', '.join(reasons)}"
    remedy = "give a smaller --skip" if about["frames"] >= FEWEST else "give more of it"
    frames = counted(about["frames"], "frame")
    return f"{name}: {frames}, expected {protocol.multiple + 1} or more; {remedy}"


def _check(methods: Sequence[Rebuilder]) -> None:
    names = [method.name for method in methods]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise UsageError(f"two methods are called '{twice}': expected names that differ; rename a file or folder")


def _forget_unseen(footage: Sequence[Footage], methods: Sequence[Rebuilder], kept: Kept) -> None:
    """Have sequences scored again by methods, where pictures of their worst frames are gone."""
    for method in methods:
        of = {each.name: kept.rows(each.name, method.name) for each in footage}
        known = [row for groups in of.values() for rows in groups.values() for row in rows]
        for name in {row.sequence for row in lost(kept.folder, known)}:
            kept.forget(name, method.name)


def _share_out(
    footage: Sequence[Footage],
    methods: Sequence[Rebuilder],
    frames: int,
    kept: Kept,
    workers: Workers,
    share: Share,
) -> None:
    """Have workers score the sequences that are not done, each by itself.  Raises what one of them ends with, when the
    others are done."""
    left = [
        each
        for each in footage
        for about in (kept.about(each.name),)
        if not all(_is_done(method.name, about, frames, kept.rows(each.name, method.name)) for method in methods)
    ]
    rows = KeptRows(kept.folder)
    tasks = [Task(each.name, partial(_score_sequence, each, methods, frames, rows)) for each in left]
    errors = [outcome.error for outcome in share(tasks, workers) if outcome.error]
    if errors:
        raise errors[0]


def _score_sequence(each: Footage, methods: Sequence[Rebuilder], frames: int, kept: KeptRows, tell: Tell) -> None:
    """Score a sequence, as a task."""
    _scored([each], methods, frames, kept, lambda done, count, _: tell(share_of(done, count)))


def _scored(
    footage: Sequence[Footage], methods: Sequence[Rebuilder], frames: int, kept: KeptRows, report: Report | None
) -> tuple[list[Row], dict[str, Any]]:
    """All rows, and what is known of each sequence; `frames` of a group are scored."""
    before = {(each.name, method.name): kept.rows(each.name, method.name) for each in footage for method in methods}
    worst = {
        method.name: WorstPictures(
            kept.folder, [row for each in footage for rows in before[each.name, method.name].values() for row in rows]
        )
        for method in methods
    }
    rows, known, total, done = list[Row](), dict[str, Any](), sum(each.expected for each in footage), 0
    for each in footage:

        def seen(number: int, name: str = each.name, done: int = done) -> None:
            if report:
                report(min(done + number, total), total, name)

        found = {method.name: dict(before[each.name, method.name]) for method in methods}
        about = _scored_sequence(each, methods, frames, kept, found, worst, seen)
        done += each.expected
        known[each.name] = about | {
            key: {method.name: of[method.name] for method in methods if method.name in of}
            for key, of in ((key, about.get(key, {})) for key in ("missing", "unfit", "of_methods"))
        }
        rows += [row for method in methods for group in sorted(found[method.name]) for row in found[method.name][group]]
    if report:
        report(total, total, "")
    return rows, known


def _scored_sequence(
    footage: Footage,
    methods: Sequence[Rebuilder],
    frames: int,
    kept: KeptRows,
    found: Mapping[str, dict[int, list[Row]]],
    worst: Mapping[str, WorstPictures],
    seen: Callable[[int], None],
) -> dict[str, Any]:
    """What is known of a sequence, whose rows are added to those that were `found` before."""
    about = kept.about(footage.name)
    unfinished = [method for method in methods if not _is_done(method.name, about, frames, found[method.name])]
    if about is not None and not unfinished:
        return about
    running = [method.begin(footage) for method in unfinished]
    for group in footage.groups():
        seen(group.number)
        _score_group(footage.name, group, running, found, kept, worst)
    facts = footage.about()
    unfit = {method.name: dict(method.unfit) for method in running}
    missing = {name: _missing(facts["groups"] * frames, found[name], reasons) for name, reasons in unfit.items()}
    said = {method.name: [*method.remarks] for method in running if method.remarks}
    lacking: dict[str, dict[str, Any]] = {"missing": missing, "unfit": unfit, "of_methods": said}
    about = facts | {key: (about or {}).get(key, {}) | of for key, of in lacking.items()}
    kept.finish(footage.name, about)
    return about


def _is_done(name: str, about: Mapping[str, Any] | None, frames: int, rows: Mapping[int, Sequence[Row]]) -> bool:
    """Whether a sequence is done for a method: it is known why each frame has no row, if not; some may be lost."""
    if about is None or name not in about["missing"]:
        return False
    return about["missing"][name] == _missing(about["groups"] * frames, rows, about["unfit"][name])


def _missing(frames: int, rows: Mapping[int, Sequence[Row]], unfit: Mapping[str, Sequence[str]]) -> int:
    """How many frames have neither a row nor a reason why they cannot be scored."""
    return frames - sum(map(len, [*rows.values(), *unfit.values()]))


def _score_group(
    sequence: str,
    group: Group,
    methods: Sequence[Rebuilder],
    found: Mapping[str, dict[int, list[Row]]],
    kept: KeptRows,
    worst: Mapping[str, WorstPictures],
) -> None:
    """Score a group, where that is not done yet."""
    conditions: dict[str, float] = {}
    for method in methods:
        done = group.number in found[method.name]
        if done and not method.sequential:
            continue
        made = method.frames(group)
        if done:  # (made for what it leaves in the method's memory)
            continue
        conditions = conditions or conditions_of(group)
        rows = rows_of(sequence, method.name, group, made, conditions)
        worst[method.name].see(rows, group, made)
        kept.add(sequence, method.name, group.number, rows)
        found[method.name][group.number] = rows


def _summary(
    job: Mapping[str, Any], found: Found, methods: Sequence[Rebuilder], rows: Sequence[Row], about: Mapping[str, Any]
) -> dict[str, Any]:
    names = [method.name for method in methods]
    facts = {key: job[key] for key in ("vid2ev", "protocol", "limit", "sensor")}
    return facts | {
        "sets": found.sets,
        "sequences": about,
        "unusable": found.unusable,
        "identities": {method.name: method.identity for method in methods},
        "methods": summarised(rows, names, found.sets),
    }
