"""NumPy's own: one .npz with an array for each column.

    t          int64   [us], on the clock of the source
    x, y       uint16  column and row, 0 is left and top
    p          uint8   1 brighter (ON), 0 darker (OFF)
    label      uint8, on request   why the event was sent
    size       int64 [2]   width, height in pixels
    start_us   int64       the instant from which formats with relative times count

Nothing is compressed, so that it is as quick as the disk, and nothing is dated: the same events give the same bytes.

Read are the files of others, too, if they have those arrays by a name that is in use (`NAMES`), or one array
`events` (or the only one), [N, 4] with the columns t, x, y, p or structured with such fields; also as plain .npy.
Times that are fractions are seconds.  Source: https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, read_as
from vid2ev.formats.columns import check_order, labels, pixels, whole_us
from vid2ev.formats.event_file import Format, Recording, promised
from vid2ev.formats.npy_arrays import MOST_OF_A_PART, PART, Array, array_header, open_array, open_columns
from vid2ev.formats.sequential import Sequential, reading
from vid2ev.stream.events import Events

NAMES = {
    "t": ("t", "ts", "timestamp", "timestamps", "time", "times"),
    "x": ("x", "xs"),
    "y": ("y", "ys"),
    "p": ("p", "ps", "pol", "pols", "polarity", "polarities"),
    "label": ("label", "labels"),
}
COLUMNS, TABLES = "txyp", ("events", "arr_0")
OF_A_TABLE = tuple(f"column {name}" for name in COLUMNS)  # names of those that are stored by themselves
ZIP_MAGIC, NPY_MAGIC = b"PK\x03\x04", b"\x93NUMPY"
TIME = (1980, 1, 1, 0, 0, 0)  # of every member: the earliest that a zip file can say


class NpzEvents(Sequential):
    """The events in arrays of NumPy.  Raises DataError for a file that has none, or is damaged."""

    def __init__(self, path: Path):
        super().__init__(path)
        with self._opened() as arrays:
            columns = _columns(arrays)
            if columns is None:
                raise DataError(f"{path} has no arrays t, x, y, p, nor one of events; it has {', '.join(arrays)}")
            self.labelled = "label" in columns
            array, key = columns["t"]
            self._named = not isinstance(key, tuple) and array is not arrays.get(OF_A_TABLE[0])
            self._types = {name: str(array.dtype) for name, (array, _) in columns.items()}
            size, start = (_small(arrays.get(name), count) for name, count in (("size", 2), ("start_us", 1)))
            self.size = (size[0], size[1]) if size and min(size) > 0 else None
            self.start_us, self.says_start = start[0] if start else 0, bool(start)

    def describe(self) -> dict[str, Any]:
        """The types of the arrays."""
        return {"types": self._types}

    def _decoded(self) -> Iterator[Events]:
        with self._opened() as arrays:
            columns = _columns(arrays) or {}
            files = {id(array): array for array, _ in columns.values()}
            count = min(len(array) for array in files.values())
            if any(len(array) != count for array in files.values()):
                raise DataError(f"{self.path} is damaged: its arrays t, x, y, p differ in length; get another copy")
            outside, step = 0, _at_a_time(files.values())
            for at in range(0, count, step):
                parts = {key: array.read(min(step, count - at)) for key, array in files.items()}
                column = {name: _take(parts[id(array)], key) for name, (array, key) in columns.items()}
                if not at and not self._named:
                    check_order(self.path, **{name: column[name] for name in COLUMNS})
                events, left = self._inside(self._events(column))
                outside += left
                yield events
        self._leave_out(outside, f"{self._outside} are")

    @cached_property
    def _scale(self) -> int:
        """Microseconds in the unit of times that are no integers, of all of them: the first may be whole seconds."""
        with self._opened() as arrays:
            array, key = (_columns(arrays) or {})["t"]
            step = _at_a_time([array])
            for at in range(0, len(array), step):
                t = _take(array.read(min(step, len(array) - at)), key)
                if not np.array_equal(t, np.rint(t)):
                    said = "times are fractions; they are taken for seconds"
                    self.warnings += [said] if said not in self.warnings else []
                    return 1_000_000
        return 1

    def _events(self, column: dict[str, np.ndarray]) -> Events:
        t = column["t"]
        if t.dtype.kind == "f":
            t = np.rint(t.astype(np.float64) * self._scale)
        label = labels(self.path, column["label"]) if self.labelled else None
        return Events(
            whole_us(self.path, t), *pixels(self.path, *(column[name] for name in "xyp"), named=self._named), label
        )

    @contextmanager
    def _opened(self) -> Iterator[dict[str, Array]]:
        """The arrays of the file, open, by name; every way in which it is damaged becomes a DataError."""
        # zipfile, zlib and numpy have a dozen errors of their own
        with read_as(self.path, "arrays of NumPy", (Exception,)), ExitStack() as stack:
            yield _arrays(stack, self.path)


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it."""
    columns: dict[str, type] = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.uint8}
    columns |= {"label": np.uint8} if recording.labelled else {}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as whole:
        for name, dtype in columns.items():
            with whole.open(zipfile.ZipInfo(f"{name}.npy", TIME), "w", force_zip64=True) as member:
                member.write(array_header((recording.count,), dtype))
                for _, events in promised(recording):
                    member.write(np.ascontiguousarray(getattr(events, name), dtype).data.cast("B"))
        for name, values in (("size", np.array(recording.size)), ("start_us", np.array(recording.start_us))):
            content = array_header(values.shape, np.int64) + values.astype("<i8").tobytes()
            whole.writestr(zipfile.ZipInfo(f"{name}.npy", TIME), content)


def _recognises(head: bytes, path: Path) -> bool:
    if not head.startswith((ZIP_MAGIC, NPY_MAGIC)):
        return False
    try:
        with ExitStack() as stack:
            return _columns(_arrays(stack, path)) is not None
    except Exception:  # (as above; then it is not ours)
        return False


def _arrays(stack: ExitStack, path: Path) -> dict[str, Array]:
    """The arrays of a .npz or .npy file; of a table that is stored column by column these."""
    file = stack.enter_context(reading(path))
    if file.read(len(NPY_MAGIC)) == NPY_MAGIC:
        return _table(TABLES[0], lambda: stack.enter_context(reading(path)))
    whole = stack.enter_context(zipfile.ZipFile(file))
    found = {info.filename.removesuffix(".npy"): info for info in whole.infolist() if info.filename.endswith(".npy")}

    def opened(name: str) -> Any:
        return stack.enter_context(whole.open(found[name]))

    wanted = {"size", "start_us", *(name for names in NAMES.values() for name in names)}
    tables = [_table(name, partial(opened, name)) for name in TABLES if name in found]
    arrays = {name: open_array(opened(name)) for name in found if name in wanted}
    return {name: array for each in (*tables, arrays) for name, array in each.items()}


def _table(name: str, opened: Callable[[], Any]) -> dict[str, Array]:
    """The array of this name, or its columns."""
    columns = open_columns(opened, len(COLUMNS))
    return dict(zip(OF_A_TABLE, columns, strict=True)) if columns else {name: open_array(opened())}


def _columns(arrays: dict[str, Array]) -> dict[str, tuple[Array, Any]] | None:
    """Where t, x, y, p and perhaps label are: an array, and the field or column in it."""
    found: dict[str, tuple[Array, Any]] = {}
    table = next((arrays[name] for name in TABLES if name in arrays), None)
    for ours, names in NAMES.items():
        fields: tuple[str, ...] = (table.dtype.names or ()) if table is not None else ()
        if name := next((name for name in names if name in arrays and len(arrays[name].shape) == 1), None):
            found[ours] = (arrays[name], None)
        elif table is not None and (field := next((name for name in names if name in fields), None)):
            found[ours] = (table, field)
    if not found and OF_A_TABLE[0] in arrays:
        found = {name: (arrays[column], None) for name, column in zip(COLUMNS, OF_A_TABLE, strict=True)}
    if table is not None and not found and len(table.shape) == 2 and table.shape[1] == 4 and not table.dtype.names:
        found = {name: (table, (slice(None), column)) for column, name in enumerate(COLUMNS)}
    kinds = [(array.dtype[key] if isinstance(key, str) else array.dtype).kind for array, key in found.values()]
    return found if set("txyp") <= set(found) and all(kind in "iufb" for kind in kinds) else None


def _at_a_time(arrays: Iterable[Array]) -> int:
    """How many rows of arrays are read together."""
    return min(PART, *(max(MOST_OF_A_PART // array.row_bytes, 1) for array in arrays))


def _take(part: np.ndarray, key: Any) -> np.ndarray:
    return part if key is None else part[key]


def _small(array: Array | None, count: int) -> list[int] | None:
    """The whole numbers in an array of `count`; None if it is not such an array."""
    if array is None or array.dtype.kind not in "iu" or int(np.prod(array.shape)) != count:
        return None
    values = [int(value) for value in array.read_all().ravel()]
    return values if all(abs(value) < 1 << 62 for value in values) else None


FORMAT = Format(
    "npz",
    "NumPy arrays",
    ".npz",
    recognises=_recognises,
    open=NpzEvents,
    write=write_events,
    largest=(1 << 16, 1 << 16),
    keeps=frozenset({"labels", "size", "start"}),
)
