"""A report as one page of HTML that loads nothing: style, plots and pictures are in it."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from html import escape
from pathlib import Path

from interp.evaluate.report.blocks import Block, Document, Items, Line, Picture, Plot, Table, Text

STYLE = Path(__file__).with_name("page.css")
NOTHING_ELSE = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"  # browsers are told so, too


def page(said: Document) -> str:
    """The page of a report, HTML5."""
    sections = [(f"s{number}", section) for number, section in enumerate(said.sections) if section.blocks]
    links = "".join(f'<li><a href="#{name}">{escape(section.title)}</a></li>' for name, section in sections)
    body = "".join(
        f'<section id="{name}"><h2>{escape(section.title)}</h2>\n{_blocks(section.blocks)}</section>\n'
        for name, section in sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{NOTHING_ELSE}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(said.title)}</title>\n<style>\n{STYLE.read_text(encoding='utf-8')}</style>\n</head>\n"
        f"<body>\n<main>\n<h1>{escape(said.title)}</h1>\n{_blocks(said.opening)}"
        f"<nav><ul>{links}</ul></nav>\n{body}</main>\n</body>\n</html>\n"
    )


def _blocks(blocks: tuple[Block, ...]) -> str:
    return "".join(f"{part}\n" for part in _written(blocks))


def _written(blocks: tuple[Block, ...]) -> Iterator[str]:
    for block in blocks:
        match block:
            case Text(text, warning):
                yield f'<p class="warning">{escape(text)}</p>' if warning else f"<p>{escape(text)}</p>"
            case Items(items):
                yield f"<ul>{''.join(f'<li>{escape(item)}</li>' for item in items)}</ul>"
            case Table(folded=True, title=title):
                yield f"<details><summary>Table: {escape(title)}</summary>{_table(block)}</details>"
            case Table(title=title):
                yield (f"<h3>{escape(title)}</h3>\n" if title else "") + _table(block)
            case Plot(svg, caption):
                yield f'<figure><div class="wide">{svg}</div><figcaption>{escape(caption)}</figcaption></figure>'
            case Picture(png, caption):
                data = base64.b64encode(png).decode()
                yield (
                    f'<figure><div class="wide"><img alt="{escape(caption)}" src="data:image/png;base64,{data}"></div>'
                    f"<figcaption>{escape(caption)}</figcaption></figure>"
                )


def _table(table: Table) -> str:
    head = "".join(f'<th scope="col"{_kind(k < table.words)}>{escape(name)}</th>' for k, name in enumerate(table.head))
    headed = f"<thead><tr>{head}</tr></thead>" if any(table.head) else ""
    lines = "\n".join(_line(line, table.words) for line in table.lines)
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    return f'<div class="wide"><table>{headed}<tbody>\n{lines}\n</tbody></table></div>{note}'


def _line(line: Line, words: int) -> str:
    cells = "".join(
        f"<td{_kind(k < words, cell.best)}>{escape(cell.text)}</td>" for k, cell in enumerate(line.cells, start=1)
    )
    kind = ' class="published"' if line.published else ""
    return f'<tr{kind}><th scope="row">{escape(line.name)}</th>{cells}</tr>'


def _kind(words: bool, best: bool = False) -> str:
    names = ["words"] * words + ["best"] * best
    return f' class="{" ".join(names)}"' if names else ""
