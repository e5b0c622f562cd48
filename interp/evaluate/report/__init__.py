"""An evaluation for people: one text, as Markdown and as a page that needs nothing else.

    write_report(folder, rows, {"settings": {...}, "not_scored": {...}, "versions": {...}})

All numbers are worked out from the rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from interp.evaluate.report.about import About
from interp.evaluate.report.worst import WorstFrame
from interp.evaluate.row import Row
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing

__all__ = ["MARKDOWN", "PAGE", "About", "WorstFrame", "write_report"]

MARKDOWN, PAGE = "report.md", "report.html"


def write_report(folder: Path, rows: Sequence[Row], about: About, worst: Sequence[WorstFrame] = ()) -> None:
    """Write `report.md` and `report.html` into a folder, each there as a whole or not at all; raises DataError.

    `worst` are frames to be shown with their errors, in the order given: of each method the first, or the first two.
    """
    from interp.evaluate.report.content import document
    from interp.evaluate.report.markdown import markdown
    from interp.evaluate.report.page import page

    said = document(rows, about, worst)
    for name, text in ((MARKDOWN, markdown(said)), (PAGE, page(said))):
        with writing(folder / name, THEN_RESUME):
            folder.mkdir(parents=True, exist_ok=True)
            with whole_file(folder / name) as file:
                file.write(text.encode())
