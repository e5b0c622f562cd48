"""A panel: the controls of a record, drawn in rows - name, slider, value with unit, reset.

What is entered goes to the board that the panel belongs to; what that refuses is said under the control, and the value
before it stays.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any, Protocol

from nicegui import ui

from vid2ev.errors import Vid2evError
from vid2ev.gui.controls import Control, reach


class Board(Protocol):
    """Where the values of a panel are; those that were refused are `waiting`."""

    waiting: dict[str, Any]

    def value(self, key: str) -> Any:
        """The value in use."""

    def base(self, key: str) -> Any:
        """What a reset brings back."""

    def origin(self, key: str) -> str:
        """Where that comes from, "" if nothing is known."""

    def seen(self, key: str) -> Iterable[Any]:
        """Values that are in use anywhere, for the reach of a slider."""

    def put(self, key: str, value: Any) -> None:
        """Use a value.  Raises Vid2evError, in a sentence, for one that cannot be."""


class Panel:
    """The controls of a board, drawn where it is made; `name` is what its elements are known by."""

    def __init__(self, name: str, controls: Sequence[Control], board: Board, *, grouped: bool = False):
        self.board = board
        self.rows: list[Row] = []
        for group, members in groupby(controls, lambda control: control.group):
            several = [*members]
            if grouped and len(several) > 1:
                ui.label(group).classes("v-group")
            self.rows += [Row(name, control, board) for control in several]

    def show(self) -> None:
        """Show the values in use."""
        for row in self.rows:
            row.show()

    def reset(self) -> None:
        """Bring all values back."""
        for row in self.rows:
            row.reset()


class Row:
    """One control."""

    def __init__(self, name: str, control: Control, board: Board):
        self.control, self.board = control, board
        self._showing = False
        with ui.element("div").classes("v-row").props(f'data-key="{name}.{control.key}"'):
            label = ui.label(control.label).classes("v-name")
            self._slider: ui.slider | None = None
            span = reach(control, [*board.seen(control.key), board.value(control.key)])
            if span:
                low, high, step = span
                self._slider = ui.slider(min=low, max=high, step=step, on_change=self._slid)
                self._slider.props(f'dense aria-label="{self._called}"')
                self._slider.classes("v-slider")
            with ui.element("div").classes("v-value" if span else "v-value v-wide"):
                self._fields = self._drawn()
                for k, field in enumerate(self._fields):
                    place = f", {k + 1} of {len(self._fields)}" if len(self._fields) > 1 else ""
                    field.props(f'aria-label="{self._called}{place}"')
            self._back = ui.button(icon="undo", on_click=self.reset).classes("v-reset")
            self._back.props(f'flat dense round size=xs title="reset" aria-label="reset {control.label}"')
            self._error = ui.label().classes("v-error").props("role=status")
        label.props["title"] = self._help()
        self.show()

    @property
    def _called(self) -> str:
        """What one who hears the page is told."""
        return self.control.label + (f" [{self.control.unit}]" if self.control.unit else "")

    def show(self) -> None:
        """Show the value in use; what was entered and refused stays, with its reason."""
        if self.control.key in self.board.waiting:
            return
        value = self.board.value(self.control.key)
        shown = self.control.shown(value)
        parts = shown if self.control.kind == "vector" and shown is not None else [shown] * len(self._fields)
        self._showing = True
        for field, part in zip(self._fields, parts, strict=True):
            field.value = part
        if self._slider is not None and isinstance(value, int | float):
            self._slider.value = value
        self._showing = False
        self._say(None)

    def reset(self) -> None:
        """Bring the value back."""
        self.board.waiting.pop(self.control.key, None)
        self._put(self.board.base(self.control.key))
        self.show()

    def _drawn(self) -> list[Any]:
        control, unit = self.control, f'suffix="{self.control.unit}"' if self.control.unit else ""
        if control.kind == "switch":
            return [ui.switch(on_change=self._entered).props("dense")]
        if control.kind == "choice":
            chosen = ui.select([*control.choices], on_change=self._entered, clearable=control.optional)
            return [chosen.props("dense options-dense borderless")]
        if control.kind in ("number", "whole", "vector"):
            count = max(control.places, 1)
            hint = f'placeholder="{"auto" if control.optional else ""}"'
            return [
                ui.number(on_change=self._entered).props(
                    f"dense borderless {unit if k == count - 1 else ''} {hint} step=any"
                )
                for k in range(count)
            ]
        value = self.board.value(control.key)
        if (
            isinstance(value, tuple) and value and isinstance(value[0], dict)
        ):  # (tables, such as a trajectory's motions)
            text = ui.textarea(on_change=self._entered).classes("v-text")
            return [text.props("dense borderless spellcheck=false debounce=400")]
        return [ui.input(on_change=self._entered).props(f'dense borderless placeholder="none" {unit}')]

    def _slid(self, event: Any) -> None:
        if not self._showing:
            value = event.value if self.control.kind == "number" else round(event.value)
            self._put(float(f"{value:.6g}") if self.control.kind == "number" else value)
            self._showing = True
            self._fields[0].value = self.board.value(self.control.key)
            self._showing = False

    def _entered(self, _: Any = None) -> None:
        if self._showing:
            return
        shown = [field.value for field in self._fields]
        try:
            if self.control.kind == "vector":
                if all(part is None for part in shown) and self.control.optional:
                    value = None
                elif any(part is None for part in shown):
                    raise ValueError(f"{self.control.key} takes {len(shown)} numbers; fill in the others")
                else:
                    value = tuple(self._number(part) for part in shown)
            else:
                value = self.control.parsed(shown[0])
        except (ValueError, Vid2evError) as error:
            self._say(str(error))
            return
        self._put(value)
        if self._slider is not None and isinstance(value, int | float) and not self._error.text:
            self._showing = True
            self._slider.value = value
            self._showing = False

    def _number(self, part: float) -> float | int:
        whole = isinstance(self.board.base(self.control.key), tuple) and isinstance(
            self.board.base(self.control.key)[0], int
        )
        return int(part) if (whole or self.control.key == "size") and float(part).is_integer() else float(part)

    def _put(self, value: Any) -> None:
        if value == self.board.value(self.control.key):
            self.board.waiting.pop(self.control.key, None)
            self._say(None)
            return
        try:
            self.board.put(self.control.key, value)
        except (Vid2evError, ValueError) as error:
            self._say(str(error))
        else:
            self._say(None)

    def _say(self, error: str | None) -> None:
        """What is wrong, and whether there is something to reset."""
        self._error.text = error or ""
        self._error.set_visibility(bool(error))
        changed = self.board.value(self.control.key) != self.board.base(self.control.key)
        self._back.classes(remove="v-idle") if changed or error else self._back.classes("v-idle")

    def _help(self) -> str:
        control = self.control
        parts = [control.key, control.meaning, control.limits, self.board.origin(control.key)]
        return " · ".join(part for part in parts if part)
