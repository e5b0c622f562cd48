"""Columns of numbers, of whatever type a file has them, as those of events: none becomes another number unseen."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vid2ev.errors import DataError

FEWEST, BACK = 16, 8  # events of a table that say something of its order; of so many steps of its times one goes back


def whole_us(path: Path, t: np.ndarray, from_us: int = 0) -> np.ndarray:
    """Times that are stored in microseconds after from_us, as int64.

    Raises DataError for fractions, what is no number, and times of more than 64 bits."""
    if t.dtype.kind == "f" and not (np.array_equal(t, np.rint(t)) and np.isfinite(t).all()):
        raise DataError(f"{path} has times that are no whole microseconds; write them as such")
    if len(t) and (from_us + t.min().item() < -(1 << 63) or from_us + t.max().item() >= 1 << 63):
        raise DataError(f"{path} has times of more than 64 bits; get another copy")
    return t.astype(np.int64) + from_us


def labels(path: Path, label: np.ndarray) -> np.ndarray:
    """Labels, uint8.  Raises DataError for others than such numbers."""
    with np.errstate(invalid="ignore"):  # (NaN is none)
        if label.dtype != np.uint8 and not np.array_equal(label, label.astype(np.uint8)):
            raise DataError(f"{path} has labels that are no whole numbers within 0 ... 255; get another copy")
    return label.astype(np.uint8)


def pixels(
    path: Path, x: np.ndarray, y: np.ndarray, p: np.ndarray, *, named: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns and rows uint16, polarities uint8: 1 is ON, of what is above 0.

    named   whether the file says which is which; a table that does not may be in another order
    Raises DataError for fractions, what is no number, and columns and rows that no sensor has.
    """
    other_order = "" if named else "save it with the columns t, x, y, p, in this order, which they are taken for"
    if any(values.dtype.kind == "f" and not np.array_equal(values, np.rint(values)) for values in (x, y, p)):
        raise DataError(
            f"{path} has columns, rows or polarities that are no whole numbers; {other_order or 'round them first'}"
        )
    wide = [values for values in (x, y) if len(values) and values.dtype not in (np.uint8, np.uint16)]
    if any(values.min() < 0 or values.max().item() > 0xFFFF for values in wide):  # (float16 has no such number)
        raise DataError(
            f"{path} has columns or rows that are not within 0 ... 65535; {other_order or 'get another copy'}"
        )
    return x.astype(np.uint16), y.astype(np.uint16), (p > 0).astype(np.uint8)


def check_order(path: Path, t: np.ndarray, **others: np.ndarray) -> None:
    """Raise DataError where the times of a table that names no columns are in another of them: those taken for times go
    back again and again, and another column never does."""
    if len(t) < FEWEST or np.count_nonzero(t[1:] < t[:-1]) * BACK < len(t):
        return
    for name, values in others.items():
        if values[-1] > values[0] + 1 and np.all(values[1:] >= values[:-1]):
            raise DataError(
                f"{path} seems to have its times where {name} is expected: this column never goes back, and that of t"
                " does; save it with the columns t, x, y, p, in this order"
            )


def saved_as_arrays(path: Path, reader: str) -> str:
    """How events of a file that calls its columns otherwise become such that can be read."""
    return (
        f"read them with {reader}, and save events with numpy.savez('{path.stem}.npz', t=t, x=x, y=y, p=p), t in whole"
        " microseconds"
    )
