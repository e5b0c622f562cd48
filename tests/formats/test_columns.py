"""Numbers of other types than events have: the same numbers, or a sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from vid2ev import DataError
from vid2ev.formats import describe_events, open_events

Columns = dict[str, Any]


def as_npz(path: Path, columns: Columns) -> Path:
    np.savez(path / "events.npz", **columns)
    return path / "events.npz"


def as_dsec(path: Path, columns: Columns) -> Path:
    with h5py.File(path / "events.h5", "w") as file:
        for name, values in columns.items():
            file[f"events/{name}"] = values
    return path / "events.h5"


def as_table(path: Path, columns: Columns) -> Path:
    with h5py.File(path / "table.h5", "w") as file:
        file["events"] = np.stack([columns[name].astype(columns["t"].dtype) for name in "txyp"], axis=1)
    return path / "table.h5"


def columns_of(kind: str, **others: Any) -> Columns:
    sound = {"t": [10, 20, 30], "x": [1, 2, 3], "y": [4, 5, 6], "p": [1, 0, 1]} | others
    return {name: np.array(values, kind if name not in others else None) for name, values in sound.items()}


stored = pytest.mark.parametrize("write", [as_npz, as_dsec])


@pytest.mark.parametrize("kind", ["int8", "uint16", "int32", "int64", "float16", "float32", "float64"])
@stored
def test_whole_numbers_of_any_type_are_those_that_they_are(
    write: Callable[[Path, Columns], Path], kind: str, tmp_path: Path
) -> None:
    events = next(open_events(write(tmp_path, columns_of(kind))).events())
    assert events.t.tolist() == [10, 20, 30] and events.x.tolist() == [1, 2, 3] and events.y.tolist() == [4, 5, 6]
    assert events.p.tolist() == [1, 0, 1]


@pytest.mark.parametrize("count", [0, 1, 3])
@pytest.mark.parametrize("kind", ["<i8", ">f4", [(name, "<i4") for name in "txyp"]], ids=str)
def test_a_table_may_have_any_number_of_events(kind: Any, count: int, tmp_path: Path) -> None:
    table = np.ones((count, 4) if isinstance(kind, str) else count, kind)
    np.save(tmp_path / "events.npy", table)
    np.savez(tmp_path / "events.npz", events=table)
    for path in tmp_path.iterdir():
        assert describe_events(path)["events"] == count


@pytest.mark.parametrize(
    ("others", "said"),
    [
        ({"x": [1, 70000, 3]}, "columns or rows that are not within 0 ... 65535"),
        ({"y": [1, -1, 3]}, "columns or rows that are not within 0 ... 65535"),
        ({"x": [1.5, 2.0, 3.0]}, "no whole numbers; round them first"),
        ({"y": [1.0, np.nan, 3.0]}, "no whole numbers; round them first"),
        ({"p": [1.0, np.nan, 0.0]}, "no whole numbers; round them first"),
        ({"t": [10.0, np.nan, 30.0]}, "times that are no"),
        ({"t": [10.0, 20.0, np.inf]}, "times that are no"),
    ],
)
@stored
def test_what_no_event_has_is_refused(
    write: Callable[[Path, Columns], Path], others: Columns, said: str, tmp_path: Path
) -> None:
    path = write(tmp_path, columns_of("int64", **others))
    with pytest.raises(DataError, match=said):
        [*open_events(path).events()]


@pytest.mark.parametrize("values", [[300, 0, 0], [-1, 0, 0], [0.5, 0, 0], [np.nan, 0, 0]])
@stored
def test_labels_that_no_event_has_are_refused(
    write: Callable[[Path, Columns], Path], values: list[float], tmp_path: Path
) -> None:
    path = write(tmp_path, columns_of("int64", label=values))
    with pytest.raises(DataError, match=r"labels that are no whole numbers within 0 ... 255"):
        [*open_events(path).events()]


@pytest.mark.parametrize("kind", ["uint8", "int64", "float32"])
@stored
def test_labels_of_any_type_are_those_that_they_are(
    write: Callable[[Path, Columns], Path], kind: str, tmp_path: Path
) -> None:
    events = next(open_events(write(tmp_path, columns_of("int64", label=np.array([0, 3, 255], kind)))).events())
    assert events.label is not None and events.label.tolist() == [0, 3, 255] and events.label.dtype == np.uint8


@pytest.mark.parametrize(
    ("t", "sound"),
    [
        (np.array([-(2**63), 0, 2**63 - 1]), True),
        (np.array([0, 1, 2**63 + 1], np.uint64), False),
        (np.array([0, 1, 2.0**63]), False),
    ],
)
@stored
def test_times_are_those_that_they_are_or_refused(
    write: Callable[[Path, Columns], Path], t: np.ndarray, sound: bool, tmp_path: Path
) -> None:
    path = write(tmp_path, columns_of("int64", t=t))
    if sound:
        found = describe_events(path)
        assert [found["first_us"], found["last_us"], found["times_going_back"]] == [*t[[0, -1]].tolist(), 0]
        return
    with pytest.raises(DataError, match="times of more than 64 bits"):
        [*open_events(path).events()]


@pytest.mark.parametrize("start_us", [np.int64(2**63 - 20), np.uint64(2**63 + 5), np.int64(-(2**63))])
@pytest.mark.parametrize("counted", [as_dsec, as_table])
def test_times_are_counted_from_no_instant_that_makes_others_of_them(
    counted: Callable[[Path, Columns], Path], start_us: Any, tmp_path: Path
) -> None:
    path = counted(tmp_path, columns_of("int64", t=np.array([-1, 0, 20]) if start_us < 0 else np.array([0, 1, 20])))
    with h5py.File(path, "r+") as file:
        if counted is as_dsec:
            file["t_offset"] = start_us
        else:
            file.attrs["start_us"] = start_us
    with pytest.raises(DataError, match="times of more than 64 bits"):
        [*open_events(path).events()]


def test_seconds_are_not_cut_to_microseconds(tmp_path: Path) -> None:
    path = as_dsec(tmp_path, columns_of("int64", t=[0.0, 0.5, 1.25]))
    with pytest.raises(DataError, match="times that are no whole microseconds; write them as such"):
        [*open_events(path).events()]


def test_columns_of_texts_are_refused(tmp_path: Path) -> None:
    path = as_dsec(tmp_path, columns_of("int64") | {"p": np.array([b"on", b"off", b"on"])})
    with pytest.raises(DataError, match=r"of types int64, int64, int64, .S3; expected numbers"):
        open_events(path)


@pytest.mark.parametrize("kind", ["int16", "int32", "int64"])
def test_a_table_has_no_negative_pixels_and_off_may_be_minus_one(kind: str, tmp_path: Path) -> None:
    sound = as_table(tmp_path, columns_of(kind) | {"p": np.array([1, -1, 1], kind)})
    assert next(open_events(sound).events()).p.tolist() == [1, 0, 1]
    wrong = as_table(tmp_path, columns_of(kind) | {"x": np.array([1, -1, 3], kind)})
    with pytest.raises(DataError, match=r"columns or rows that are not within 0 ... 65535"):
        [*open_events(wrong).events()]
