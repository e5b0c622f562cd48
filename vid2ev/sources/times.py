"""When frames were taken: exact int64 nanoseconds, strictly increasing.

Stamps are rational numbers (ticks of a time base, decimals of a text file, multiples of 1 / fps); they are rounded
once, to the nearest nanosecond, by integer arithmetic, so that frame 10**6 of a 24000/1001 fps clip is as exact as
frame 1.

`timestamps.txt` holds one line per frame; the last column counts, blank lines and lines that begin with `#` do not.
Columns have blanks or commas between them, and decimals a point.  Where a column names the images, each line has to
name its own.  Below a line `# start_us end_us` (or s, ms, ns) they are the instants at which a frame sensor's shutter
opens and closes, and the first column counts.  The unit is

* what a line `# unit: s` (or ms, us, ns), or just `# us`, or `# start_us end_us` says; without such a line
* seconds, if any of the numbers has a decimal point or an exponent; but in `timestamp.txt`, where HS-ERGB and BS-ERGB
  have microseconds, which are often written so (6667.0), those whose median spacing is 1000 or more are microseconds;
* for whole numbers, by their median spacing: milliseconds below 100 (100 us would be 10 000 fps), nanoseconds from
  1 000 000 (1 s would be 1 fps), and microseconds between.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.requests import is_finite
from vid2ev.terminal import counted
from vid2ev.untrusted import check_file, first_line, read_array, read_lines

NS_PER_UNIT = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
UNIT_LINE = r"\s*#\s*(?:unit\s*[:=]\s*(\w+)|(s|ms|us|ns)|start_(s|ms|us|ns)[\s,]+end_\3)\s*$"
GUESSED = " (by spacing)"  # after the name of a unit that nothing states
OF_ERGB = "timestamp.txt"  # what HS-ERGB and BS-ERGB call it
LEAST_OF_ERGB = 1000  # microseconds from frame to frame; seconds would be a quarter of an hour
DECIMAL_COMMA = re.compile(r"(?:^|[\s;])([+-]?\d{1,50})(?:,(\d{1,50}))?\s*$")  # or whole numbers, in columns
LONGEST_WORD = 100  # digits of a time
T = TypeVar("T")
Number = TypeVar("Number", int, Fraction)
SLOWEST_HZ = 1e-6  # of frames: 12 days from one to the next
LONGEST_NS = 2**62  # 146 years: sums and differences of two times stay in int64


def round_ns(seconds: Fraction) -> int:
    """The nearest nanosecond, halves upwards."""
    return (2 * seconds.numerator * 10**9 + seconds.denominator) // (2 * seconds.denominator)


def parse_fps(fps: float | Fraction) -> Fraction:
    """Frames per second as written: 29.97 is 2997/100, Fraction(30000, 1001) stays.  Raises UsageError."""
    if not is_finite(fps) or not SLOWEST_HZ <= fps <= 10**9:
        raise UsageError(f"fps {fps}: expected a number of frames per second from {SLOWEST_HZ:g} to 1e9")
    return Fraction(str(fps))


class Clock:
    """Gives each frame of a source its time, and counts the stamps that cannot be used.

    fps       if given, frame k is at k / fps and the stamps of the source do not count
    rate      the nominal rate, for frames without a stamp: one period after the frame before
    """

    def __init__(self, fps: Fraction | None = None, rate: Fraction | None = None):
        self.fps, self.rate = fps, rate
        self.frames = self.dropped = self.without_stamp = 0
        self._last_ns: int | None = None
        self._last = Fraction(0)

    def next(self, seconds: Fraction | None) -> int | None:
        """Time [ns] of the next frame, given its stamp; None if that is not after the frame before: drop it."""
        if self.fps is not None:
            seconds = self.frames / self.fps
        elif seconds is None:
            if not self.rate:
                raise DataError(f"frame {self.frames} has no presentation time and the file no frame rate; give --fps")
            self.without_stamp += 1
            seconds = Fraction(0) if self._last_ns is None else self._last + 1 / self.rate
        t_ns = round_ns(seconds)
        if abs(t_ns) > LONGEST_NS:
            raise DataError(f"frame {self.frames} is at {float(seconds):.6g} s, beyond 146 years; give --fps")
        self.frames += 1
        if self._last_ns is not None and t_ns <= self._last_ns:
            self.dropped += 1
            return None
        self._last_ns, self._last = t_ns, seconds
        return t_ns

    def within(
        self, stamped: Iterable[tuple[T, Fraction | None]], since_ns: int | None, until_ns: int | None, start: int = 0
    ) -> Iterator[tuple[T, int]]:
        """The frames from `since_ns` to `until_ns`, both included, None without end, with their times [ns]; from index
        `start` among these.  `stamped` are all frames with their stamps; no more are asked for than it takes."""
        index = 0
        for frame, stamp in stamped:
            t_ns = self.next(stamp)
            if t_ns is None or (since_ns is not None and t_ns < since_ns):
                continue
            if until_ns is not None and t_ns > until_ns:
                return
            if index >= start:
                yield frame, t_ns
            index += 1

    def remarks(self) -> list[str]:
        """What a person should know about the stamps."""
        remarks = []
        if self.dropped:
            remarks.append(f"dropped {self.dropped} of {self.frames} frames whose time is not after the frame before")
        if self.without_stamp:
            remarks.append(
                f"placed at {float(self.rate or 0):g} fps: {counted(self.without_stamp, 'frame')} without a"
                " presentation time; give --fps if that is wrong"
            )
        return remarks


def expected_duration_s(stamps: Sequence[Fraction], fps: Fraction | None, frames: int) -> float:
    """From the first frame to the last [s]."""
    return float((frames - 1) / fps) if fps else float(max(stamps) - stamps[0])


def digest_of(stamps: Sequence[Fraction]) -> str | None:
    """What tells stamps from others; None without any.  The file that they are in may be another than the frames'."""
    return hashlib.sha256(" ".join(map(str, stamps)).encode()).hexdigest() if stamps else None


def stamps_beside(path: Path, frames: int) -> tuple[list[Fraction], str]:
    """Stamps [s] of `NAME_timestamps.npy` or `NAME_timestamps.txt` beside the file `NAME`, and their unit.

    Raises UsageError if there is neither, DataError if they are not as many as the frames.
    """
    file = times_beside(path)
    if not file.exists():
        raise UsageError(f"{path}: frames without times; give --fps, or put {path.stem}_timestamps.npy beside it")
    stamps, unit = read_timestamp_array(file) if file.suffix == ".npy" else read_timestamps(file)
    if len(stamps) != frames:
        found = counted(len(stamps), "time")
        raise DataError(f"{path}: {found} beside it for {counted(frames, 'frame')}; expected one each, or give --fps")
    return stamps, unit


def times_beside(path: Path) -> Path:
    """Where the times beside a file are, or would be."""
    binary, text = (path.with_name(f"{path.stem}_timestamps{suffix}") for suffix in (".npy", ".txt"))
    return binary if binary.exists() else text


def read_timestamps(path: Path, images: Sequence[str] = ()) -> tuple[list[Fraction], str]:
    """Stamps [s] of a text file and the unit they were read in (rule above).  Raises DataError, for lines that name
    other `images` than those that are there in their place, too."""
    unit, column, rows = None, -1, []
    for number, line in enumerate(read_lines(path, "one time per line"), 1):
        if line.lstrip().startswith("#"):
            said = re.match(UNIT_LINE, line)
            stated = said and (said[1] or said[2] or said[3])
            if stated and stated not in NS_PER_UNIT:
                raise DataError(f"{path}, line {number}: unit '{stated[:40]}', expected s, ms, us or ns")
            unit, column = stated or unit, 0 if said and said[3] else column
        elif line.replace(",", " ").strip():
            rows.append((line, column))
    _check_commas([line for line, column in rows if column], path)
    _check_names([line for line, _ in rows], images, path)
    words, values = [line.replace(",", " ").split()[column] for line, column in rows], []
    for word in words:
        try:
            values.append(_number(word))
        except (ValueError, ZeroDivisionError) as error:
            place = "last" if column else "first"
            raise DataError(
                f"{path}: '{word[:40]}' is no time; expected one in the {place} column of every line"
            ) from error
    if unit is not None:
        return _in_seconds(values, unit, path), unit
    if all(re.fullmatch(r"[+-]?\d+", word) for word in words):
        unit = unit_of_integers([int(value) for value in values])
    elif path.name == OF_ERGB and _spacing(values) >= LEAST_OF_ERGB:
        unit = "us"
    else:
        return _in_seconds(values, "s", path), "s"
    return _in_seconds(values, unit, path), f"{unit}{GUESSED}"


def _check_commas(lines: Sequence[str], path: Path) -> None:
    """Raise DataError for lines that end in numbers with a decimal comma.

    Each could be two columns, too; but not if some lines have it and some have not, and these are no times if the last
    column does not rise, or begins with zeros beside a number that stays, where decimals would rise.
    """
    found = [said.groups() for line in lines if (said := DECIMAL_COMMA.search(line))]
    parted = [(whole, part) for whole, part in found if part]
    if not parted or len(found) < len(lines) or not _rise(Fraction(f"{whole}.{part or 0}") for whole, part in found):
        return
    padded = any(re.match(r"0\d", part) for _, part in parted) and any(a[0] == b[0] for a, b in pairwise(parted))
    if padded or len(parted) < len(found) or not _rise(Fraction(part) for _, part in parted):
        whole, part = parted[-1]
        raise DataError(
            f"{path}: '{whole},{part}' seems to have a decimal comma, and commas stand between columns here; write"
            f" {whole}.{part}, or if these are columns, blanks between them"
        )


def _check_names(lines: Sequence[str], images: Sequence[str], path: Path) -> None:
    """Raise DataError for a line that names another image than its own: its time would be given to the wrong one."""
    if len(lines) != len(images):
        return
    known = set(images)
    for line, image in zip(lines, images, strict=True):
        named = known.intersection(Path(word).name for word in line.replace(",", " ").split())
        if named and image not in named:
            raise DataError(
                f"{path}: names {min(named)} where the images, in natural order, have {image}; put its lines into that"
                " order, or number the images in the order of the lines"
            )


def _rise(values: Iterable[Fraction]) -> bool:
    return all(a < b for a, b in pairwise(values))


def _number(word: str) -> Fraction:
    """A number as it is written.  Raises ValueError for what is none, or has more digits than there is memory for."""
    exponent = re.search(r"e([-+]?[\d_]+)$", word, re.IGNORECASE)
    if len(word) > LONGEST_WORD or (exponent and abs(int(exponent[1])) > LONGEST_WORD):
        raise ValueError("a number of too many digits")
    return Fraction(word)


def read_timestamp_array(path: Path) -> tuple[list[Fraction], str]:
    """Stamps [s] of a one-dimensional .npy: floating point is seconds, whole numbers by their spacing (rule above)."""
    check_file(path)
    try:
        with open(path, "rb") as file:
            stamps = read_array(file, path)
    except DataError:
        raise
    except Exception as error:  # (numpy has a dozen of its own for damaged headers)
        said = first_line(error)
        raise DataError(f"{path}: cannot be read as a .npy array ({said}); write it with numpy.save") from error
    return stamps_of_array(stamps, path)


def stamps_of_array(stamps: np.ndarray, path: Path, unit: str | None = None) -> tuple[list[Fraction], str]:
    """Stamps [s] of an array in `unit`; without one, floating point is seconds, whole numbers by the rule above."""
    if stamps.ndim != 1 or stamps.dtype.kind not in "iuf" or not np.all(np.isfinite(stamps)):
        raise DataError(f"{path}: {stamps.dtype} of shape {stamps.shape}, expected one finite time per frame")
    values = stamps.tolist()
    guessed = unit is None and stamps.dtype.kind != "f"
    unit = unit or (unit_of_integers(values) if guessed else "s")
    # (also of those of more than 64 bits, which are none of Python's)
    exact = [Fraction(*value.as_integer_ratio()) for value in values]
    return _in_seconds(exact, unit, path), f"{unit}{GUESSED * guessed}"


def remarks_on_unit(unit: str | None, file: Path) -> list[str]:
    """A warning for a unit that was found by the rule for whole numbers, and how to state it in a file of times."""
    if unit is None or not unit.endswith(GUESSED):
        return []
    name = unit.removesuffix(GUESSED)
    remedies = {
        ".npz": f"end the name of the times in {file.name} with _s, _ms, _us or _ns",
        ".npy": f"write {file.name} as seconds in floating point",
    }
    remedy = remedies.get(file.suffix.lower(), f"begin {file.name} with `# unit: s`, ms, us or ns")
    return [f"times without a unit are taken for {name}, by their spacing; if that is wrong, {remedy}"]


def unit_of_integers(values: Sequence[int]) -> str:
    """The unit of whole numbers without one, by their median spacing (rule above)."""
    median = _spacing(values)
    return "ms" if median < 100 else "us" if median < 10**6 else "ns"


def _spacing(values: Sequence[Number]) -> Number | int:
    """The median from each to the next; 0 of fewer than two."""
    spacings = sorted(b - a for a, b in pairwise(values))
    return spacings[len(spacings) // 2] if spacings else 0


def _in_seconds(values: Iterable[Fraction], unit: str, path: Path) -> list[Fraction]:
    seconds = [value * NS_PER_UNIT[unit] / 10**9 for value in values]
    if any(abs(second) * 10**9 > LONGEST_NS for second in seconds):
        raise DataError(f"{path}: a time beyond 146 years in {unit}; subtract the start, or state the unit")
    return seconds
