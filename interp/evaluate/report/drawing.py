"""Figures as SVG that becomes part of a page: its colours, by day and by night, and its letters.

Matplotlib draws with stand-ins for four colours; in the SVG they are the page's own, as variables of its style.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from interp.evaluate.naming import shortened
from vid2ev.compare.plots import lettered

WIDTH_IN = 7.6
INK, SOFT, FAINT, ACCENT = "#010203", "#040506", "#070809", "#0a0b0c"  # stand-ins
VARIABLES = {INK: "var(--ink)", SOFT: "var(--soft)", FAINT: "var(--faint)", ACCENT: "var(--accent)"}
LOOK: Any = {
    "svg.fonttype": "none",  # letters stay letters: in the page's font, to be searched and copied
    "svg.hashsalt": "vid2ev",  # the same figure is the same text
    "text.parse_math": False,  # names may have $ in them
    "font.size": 9.0,
    "axes.facecolor": "none",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 9.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.size": 0,
    "ytick.minor.size": 0,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
}
QUIET = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)))  # of lines that are not the accent
MARKS = ("o", "s", "^", "D", "v", "P")


@contextmanager
def look() -> Iterator[None]:
    """All drawing happens within: the house's look."""
    import matplotlib

    with matplotlib.rc_context(LOOK), lettered():  # (in the page's own letters, which may have those)
        yield


def figure(width_in: float, height_in: float) -> Any:
    """An empty figure, without a ground of its own."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(width_in, height_in), layout="constrained")
    made.patch.set_alpha(0)
    return made


def styles(methods: list[str], best: str | None) -> dict[str, dict[str, Any]]:
    """How each method is drawn: the best with the accent, the others in grey, told apart by lines and marks; where
    these come again, with other marks for each line, and by turns darker."""
    found: dict[str, dict[str, Any]] = {}
    for number, method in enumerate(name for name in methods if name != best):
        again, line = divmod(number, len(QUIET))
        found[method] = {
            "color": INK if again % 2 else SOFT, "linestyle": QUIET[line], "marker": MARKS[(line + again) % len(MARKS)],
            "zorder": 2, "markersize": 3.5,
        }  # fmt: skip
    if best is not None:
        found[best] = {"color": ACCENT, "linestyle": "-", "marker": "o", "zorder": 3, "markersize": 4, "linewidth": 2}
    return {method: found[method] for method in methods}


def legend(made: Any, axes: Any, names: Sequence[str]) -> None:
    """The names of the first lines of a panel above all panels."""
    lines = axes.get_lines()[: len(names)]
    drawn = made.legend(lines, ["-"] * len(lines), loc="outside upper left", ncols=3, fontsize=8, handlelength=3)
    for text, name in zip(drawn.get_texts(), names, strict=True):  # (matplotlib leaves out labels that begin with _)
        text.set_text(shortened(name, 28))


def svg_of(made: Any, name: str, described: str) -> str:
    """A figure as an element of a page; `name` makes its ids its own, `described` is for those who cannot see it."""
    from xml.sax.saxutils import escape, quoteattr

    file = io.StringIO()
    made.savefig(file, format="svg", metadata={"Creator": None, "Date": None, "Format": None, "Type": None})
    text = file.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<style [^>]*>.*?</style>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'\b(id="|url\(#|href="#)', rf"\g<1>{name}-", text)
    for stand_in, variable in VARIABLES.items():
        text = text.replace(stand_in, variable)
    text = re.sub(r"(font(-family)?: )([^;\"]*?)'[^;\"]*", r"\g<1>\g<3>var(--letters)", text)
    box = re.search(r'viewBox="[^"]*"', text)
    start = (
        f'<svg {box[0] if box else ""} role="img" aria-label={quoteattr(described)}><title>{escape(described)}</title>'
    )
    return start + text[text.index(">") + 1 :].replace("xlink:href", "href").rstrip()
