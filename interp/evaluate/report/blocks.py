"""What a report is made of, whatever it is written as."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of a table; `best` is the best of its kind."""

    text: str
    best: bool = False


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a table; `published` ones are quoted, of other data."""

    name: str
    cells: tuple[Cell, ...]
    published: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """`head` names the column of names and those of cells.  `folded` tables have a plot that says the same.

    `words` is how many columns hold words, from the left, and not numbers.
    """

    head: tuple[str, ...]
    lines: tuple[Line, ...]
    title: str = ""
    note: str = ""
    folded: bool = False
    words: int = 1


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph; `warning` if nothing may be read without it."""

    text: str
    warning: bool = False


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    items: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Plot:
    """A drawing, SVG to be put into a page; texts go without."""

    svg: str
    caption: str


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG file; texts go without."""

    png: bytes
    caption: str


Block = Table | Text | Items | Plot | Picture


@dataclass(frozen=True, slots=True)
class Section:
    """What is said under one heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Document:
    """A report: what comes first, and the sections."""

    title: str
    opening: tuple[Block, ...]
    sections: tuple[Section, ...]
