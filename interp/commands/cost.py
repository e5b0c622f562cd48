"""`vid2ev cost --rebuild`: what it costs to rebuild frames."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from typing import Any

from vid2ev.cost.store import Findings
from vid2ev.cost.turns import Report
from vid2ev.errors import UsageError
from vid2ev.sources import OPTIONS

OF_OUTPUT = {"source", "output", "overwrite", "as_json", "quiet"}
OF_BOTH = {"multiple", "networks", "gaps", "sensor", "overrides", "seed", "repeats", "threads", *OPTIONS}


def rebuild(
    source: str,
    *,
    given: Collection[str],
    report: Report,
    multiple: int,
    networks: Sequence[str],
    gaps: int,
    sensor: str,
    overrides: Sequence[str],
    seed: int,
    repeats: int,
    threads: int | None,
    **options: Any,
) -> Findings:
    """Measure it.  Raises UsageError for options that are of conversions."""
    from interp.cost.measure import rebuilding
    from interp.cost.shown import plot, table
    from interp.evaluate.simulated import Simulated
    from vid2ev.commands.progress import option

    if strange := sorted({*given} - OF_BOTH - OF_OUTPUT):
        raise UsageError(f"{option(strange[0])} is of conversions; leave it out, or --rebuild")
    edits = {key: value for key in OPTIONS if (value := options.get(key)) not in (None, "auto")}
    asked = edits or {*given} & {"sensor", "overrides", "seed"}
    simulated = Simulated.of(sensor if "sensor" in given else "clean", overrides, seed, **edits) if asked else None
    found = rebuilding(
        source,
        multiple=multiple,
        networks=networks,
        simulated=simulated,
        gaps=gaps,
        repeats=repeats,
        threads=threads,
        report=report,
    )
    return Findings(found.describe(), table(found), partial(plot, found))
