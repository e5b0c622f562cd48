"""Times: exact, strictly increasing, in the unit that was meant."""

from __future__ import annotations

import re
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.times import Clock, parse_fps, read_timestamp_array, read_timestamps, round_ns

fractions = st.fractions(min_value=-(10**6), max_value=10**6, max_denominator=10**7)


@given(fractions)
def test_rounding_is_to_the_nearest_nanosecond(seconds: Fraction) -> None:
    assert abs(round_ns(seconds) - seconds * 10**9) <= Fraction(1, 2)


def test_no_drift_after_a_day_of_film() -> None:
    period = Fraction(1001, 24000)
    assert round_ns(2_000_000 * period) == 83_416_666_666_667  # 83 416 2/3 s
    assert round_ns(24000 * 100 * period) == 1001 * 100 * 10**9


def test_fps_is_taken_as_written() -> None:
    assert parse_fps(29.97) == Fraction(2997, 100)
    assert parse_fps(Fraction(30000, 1001)) == Fraction(30000, 1001)
    assert parse_fps(np.float64(25.0)) == 25


@pytest.mark.parametrize("fps", [0, -30.0, float("nan"), float("inf"), 1e10, 1e-300])
def test_impossible_fps_is_refused(fps: float) -> None:
    with pytest.raises(UsageError, match="fps"):
        parse_fps(fps)


@given(st.lists(st.one_of(st.none(), fractions), max_size=40))
def test_the_clock_only_goes_forward(stamps: list[Fraction | None]) -> None:
    clock = Clock(rate=Fraction(25))
    times = [t for t in map(clock.next, stamps) if t is not None]
    assert all(a < b for a, b in pairwise(times))
    assert len(times) + clock.dropped == len(stamps) == clock.frames
    assert clock.without_stamp == stamps.count(None)


@given(st.lists(fractions, unique=True, min_size=1, max_size=40))
def test_a_source_in_order_keeps_every_frame(stamps: list[Fraction]) -> None:
    stamps = sorted(stamps)
    clock = Clock()
    times = [clock.next(stamp) for stamp in stamps]
    rounded = [round_ns(stamp) for stamp in stamps]
    assert [t for t in times if t is not None] == sorted(set(rounded))
    assert (clock.remarks() == []) == (len(set(rounded)) == len(rounded))


def test_a_frame_without_a_time_comes_one_period_after_the_one_before() -> None:
    clock = Clock(rate=Fraction(30000, 1001))
    stamps = [Fraction(1), None, None, Fraction(2)]
    assert [clock.next(stamp) for stamp in stamps] == [10**9, 1033366667, 1066733333, 2 * 10**9]
    assert any("2 frames without" in remark for remark in clock.remarks())


def test_no_time_and_no_rate_is_refused() -> None:
    with pytest.raises(DataError, match="fps"):
        Clock().next(None)


@pytest.mark.parametrize("second", [2**33, -(2**33), 2**60])
def test_times_that_nothing_can_go_on_from_are_refused(second: int) -> None:
    clock = Clock()
    assert clock.next(Fraction(-(10**9))) == -(10**18)
    with pytest.raises(DataError, match=r"frame 1 is at .* s, beyond 146 years; give --fps"):
        clock.next(Fraction(second))


def test_fps_overrules_stamps() -> None:
    clock = Clock(fps=Fraction(3))
    assert [clock.next(stamp) for stamp in (Fraction(9), None, Fraction(1))] == [0, 333333333, 666666667]
    assert clock.remarks() == []


@pytest.mark.parametrize(("text", "unit", "seconds"), [
    ("0.0\n0.033333333\n0.066666667\n", "s", ["0", "0.033333333", "0.066666667"]),
    ("0\n33\n67\n100\n", "ms (by spacing)", ["0", "0.033", "0.067", "0.1"]),
    ("0\n1042\n2083\n", "us (by spacing)", ["0", "0.001042", "0.002083"]),
    ("0\n99\n", "ms (by spacing)", ["0", "0.099"]),
    ("0\n100\n", "us (by spacing)", ["0", "0.0001"]),
    ("0\n999999\n", "us (by spacing)", ["0", "0.999999"]),
    ("0\n1000000\n", "ns (by spacing)", ["0", "0.001"]),
    ("1600000000000000\n1600000000033333\n", "us (by spacing)", ["1600000000", "1600000000.033333"]),
    ("0\n33333333\n66666667\n", "ns (by spacing)", ["0", "0.033333333", "0.066666667"]),
    ("# unit: ms\n0.0\n33.25\n", "ms", ["0", "0.03325"]),
    ("#Unit of nothing\n# unit: ns\n5\n7\n", "ns", ["0.000000005", "0.000000007"]),
    ("frame_0 0\n\nframe_1 1e-2\n", "s", ["0", "0.01"]),
    ("0, 10\n1, 20\n", "ms (by spacing)", ["0.01", "0.02"]),
    ("# us\n0\n2000000\n", "us", ["0", "2"]),
    ("7\n", "ms (by spacing)", ["0.007"]),
])  # fmt: skip
def test_the_unit_of_a_timestamp_file(tmp_path: Path, text: str, unit: str, seconds: list[str]) -> None:
    file = tmp_path / "timestamps.txt"
    file.write_text(text)
    assert read_timestamps(file) == ([Fraction(second) for second in seconds], unit)


@pytest.mark.parametrize(
    "text", ["0\nsoon\n", "0\n1/0\n", "0\nnan\n", "# unit: h\n0\n1\n", "1e300\n2e300\n", "0\n,\n,\nx\n"]
)
def test_a_bad_timestamp_file_is_refused_by_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "timestamps.txt"
    file.write_text(text)
    with pytest.raises(DataError, match=r"timestamps\.txt"):
        read_timestamps(file)


@pytest.mark.parametrize("word", ["1e999", "1e1_000", "1e-9_99", "1E+3_0_0"])
def test_numbers_of_more_digits_than_any_time_are_not_worked_out(tmp_path: Path, word: str) -> None:
    """What reads them takes as long, and as much memory, as they say."""
    file = tmp_path / "timestamps.txt"
    file.write_text(f"0\n{word}\n")
    with pytest.raises(DataError, match=f"'{re.escape(word)}' is no time"):
        read_timestamps(file)


@pytest.mark.parametrize(
    "text",
    [
        "0,0\n0,01\n0,02\n",
        "0\n0,5\n1\n1,5\n",
        "# unit: s\n0,9\n1,0\n1,1\n",
        "0,5\n1,5\n2,5\n",
        "a.png;0,000\nb.png;0,033\nc.png;0,067\n",
        "-0,033\n0,000\n0,033\n",
    ],
)
def test_a_decimal_comma_is_refused_by_name(tmp_path: Path, text: str) -> None:
    (tmp_path / "timestamps.txt").write_text(text)
    with pytest.raises(DataError, match=r"timestamps\.txt: '.*,.*' seems to have a decimal comma.*; write -?\d+\.\d"):
        read_timestamps(tmp_path / "timestamps.txt")


@pytest.mark.parametrize(
    ("text", "last"),
    [
        ("0,0\n1,40\n2,80\n", 80),  # number and time
        ("7,0\n7,40\n7,80\n", 80),  # camera and time
        ("0001,00000\n0002,00040\n0003,00080\n", 80),
        ("0,0,1000\n0,40,1040\n", 1040),
        ("9,1000\n8,1040\n", 1040),
    ],
)
def test_columns_of_whole_numbers_have_no_decimal_comma(tmp_path: Path, text: str, last: int) -> None:
    (tmp_path / "timestamps.txt").write_text(text)
    assert read_timestamps(tmp_path / "timestamps.txt")[0][-1] == Fraction(last, 1000)


def test_a_binary_timestamp_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "timestamps.txt"
    file.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(DataError, match="text"):
        read_timestamps(file)


def test_timestamps_in_an_array(tmp_path: Path) -> None:
    file = tmp_path / "t.npy"
    np.save(file, np.array([0, 33333, 66667], np.int64))
    assert read_timestamp_array(file) == ([Fraction(k, 10**6) for k in (0, 33333, 66667)], "us (by spacing)")
    for kind in (np.float16, np.float64, np.longdouble, ">f4"):
        np.save(file, np.array([0.0, 0.5], kind))
        assert read_timestamp_array(file) == ([Fraction(0), Fraction(1, 2)], "s")
    for bad in (np.zeros((2, 2)), np.array([0.0, np.nan]), np.array(["a", "b"])):
        np.save(file, bad)
        with pytest.raises(DataError):
            read_timestamp_array(file)
