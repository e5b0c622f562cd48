"""A report as Markdown: tables, no plots."""

from __future__ import annotations

import re
from collections.abc import Iterator

from interp.evaluate.report.blocks import Block, Document, Items, Line, Table, Text

MARKUP = re.compile(r"([\\`*|]|(?<!\w)_|_(?!\w)|\](?=\())")


def markdown(said: Document) -> str:
    """The text of a report."""
    parts = [f"# {escaped(said.title)}", *_blocks(said.opening)]
    for section in said.sections:
        written = list(_blocks(section.blocks))
        parts += [f"## {escaped(section.title)}", *written] if written else []
    return "\n\n".join(parts) + "\n"


def aligned(table: Table) -> str:
    """A table as text that can be read as it is: Markdown with its columns below each other."""
    lines = [[*map(escaped, table.head)], *map(_line, table.lines)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(table.head))]
    sides = ["-" * width if k < table.words else f"{'-' * (width - 1)}:" for k, width in enumerate(widths)]
    padded = [
        [text.ljust(width) if k < table.words else text.rjust(width) for k, (text, width) in enumerate(each)]
        for each in (zip(line, widths, strict=True) for line in (lines[0], sides, *lines[1:]))
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in padded)


def escaped(text: str) -> str:
    """Text that means itself: no markup, no HTML, one line."""
    line = " ".join(text.split()).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return MARKUP.sub(r"\\\1", line)


def _blocks(blocks: tuple[Block, ...]) -> Iterator[str]:
    for block in blocks:
        match block:
            case Text(text, warning):
                yield f"> **{escaped(text)}**" if warning else escaped(text)
            case Items(items):
                yield "\n".join(f"* {escaped(item)}" for item in items)
            case Table():
                yield from _table(block)
            case _:
                pass  # plots and pictures are in the page


def _table(table: Table) -> Iterator[str]:
    if table.title:
        yield f"### {escaped(table.title)}"
    sides = ["---" if k < table.words else "--:" for k in range(len(table.head))]
    lines = [map(escaped, table.head), sides, *map(_line, table.lines)]
    yield "\n".join(f"| {' | '.join(line)} |" for line in lines)
    if table.note:
        yield escaped(table.note)


def _line(line: Line) -> list[str]:
    texts = [
        escaped(line.name),
        *(f"**{escaped(cell.text)}**" if cell.best else escaped(cell.text) for cell in line.cells),
    ]
    return [f"*{text}*" if text else "" for text in texts] if line.published else texts
