"""Lines of numbers, parsed and written by compiled code: an event in each, in fields between commas or blanks."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compiling.cache import cached

NOTHING, T, X, Y, P, LABEL = -1, 0, 1, 2, 3, 4  # what a field can be
WIDEST = 48  # bytes of a line that is written
DIGITS = 19  # of the largest int64
TOO_LARGE = (2**63 - 1) // 10  # to have one more
TAB, NEWLINE, RETURN, BLANK = 9, 10, 13, 32
HASH, PERCENT, PLUS, COMMA, MINUS, POINT, ZERO, NINE, SEMICOLON, LARGE_E, SMALL_E = tuple(b"#%+,-.09;Ee")


@cached
def digits(data: np.ndarray, at: int, value: int) -> tuple[int, int, int, int]:
    """A value with the digits at a place added to its end; the place after them, how many there are, and how many of
    them have been dropped because an int64 cannot hold them."""
    begin, lost = at, 0
    while True:
        digit: Any = np.int64(data[at]) - ZERO
        if digit < 0 or digit > 9:
            return value, at, at - begin, lost
        if value < TOO_LARGE:
            value = value * 10 + digit
        else:
            lost += 1
        at += 1


@cached
def number(data: np.ndarray, at: int, power: int) -> tuple[int, int, bool]:
    """The number at a place, times 10**power and rounded; the place after it, and whether there is one that is whole.

    A power of 0 wants whole numbers, others take what is left over after rounding.  Data ends in a line break.
    """
    negative = data[at] == MINUS
    if negative or data[at] == PLUS:
        at += 1
    value: Any = 0
    value, at, count, lost = digits(data, at, value)
    decimals = -lost
    if data[at] == POINT:
        value, at, more, lost = digits(data, at + 1, value)
        count, decimals = count + more, decimals + more - lost
    good = count > 0
    if good and (data[at] == SMALL_E or data[at] == LARGE_E):
        at += 1
        down = data[at] == MINUS
        if down or data[at] == PLUS:
            at += 1
        exponent: Any = 0
        good = ZERO <= data[at] <= NINE
        while ZERO <= data[at] <= NINE:
            exponent = min(exponent * 10 + np.int64(data[at]) - ZERO, 1000)
            at += 1
        decimals += exponent if down else -exponent
    shift: Any = power - decimals
    while shift > 0 and value:
        good = good and value < 1 << 58
        value, shift = value * 10 if good else 0, shift - 1
    if shift <= -DIGITS:  # (less than one, and half of one at most where as many digits follow the point)
        good = good and (power > 0 or value == 0)
        value = np.int64(shift == -DIGITS and value >= 5 * 10 ** (DIGITS - 1))
    elif shift < 0:
        divisor = 10 ** np.int64(-shift)
        whole = value // divisor
        good = good and (power > 0 or whole * divisor == value)
        value = whole + ((value - whole * divisor) * 2 >= divisor)
    return -value if negative else value, at, good


@cached
def after_blanks(data: np.ndarray, at: int) -> int:
    """The next place that is not empty."""
    while data[at] == BLANK or data[at] == TAB or data[at] == RETURN:
        at += 1
    return at


@cached
def parse(
    data: np.ndarray,
    fields: np.ndarray,
    power: int,
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
    label: np.ndarray,
) -> tuple[int, int]:
    """Fill t, x, y, p, label from whole lines, of which field k is what fields[k] says; times are scaled by 10**power.

    Returns how many events there are, and where the line begins that is none, or the length of data.  Lines that are
    empty, or begin with # or %, are passed over.
    """
    at, found, end = 0, 0, len(data)
    while at < end:
        begin, at = at, after_blanks(data, at)
        if data[at] != NEWLINE and data[at] != HASH and data[at] != PERCENT:
            for place, field in enumerate(fields):
                at = after_blanks(data, at)
                if place and (data[at] == COMMA or data[at] == SEMICOLON):
                    at = after_blanks(data, at + 1)
                if field == NOTHING:
                    while data[at] > BLANK and data[at] != COMMA and data[at] != SEMICOLON:
                        at += 1
                    continue
                value, at, good = number(data, at, power if field == T else 0)
                good = good and (data[at] <= BLANK or data[at] == COMMA or data[at] == SEMICOLON)
                if field == T:
                    t[found] = value
                elif field == P:
                    p[found] = value > 0
                elif not 0 <= value <= (0xFF if field == LABEL else 0xFFFF):
                    good = False
                elif field == X:
                    x[found] = value
                elif field == Y:
                    y[found] = value
                else:
                    label[found] = value
                if not good:
                    return found, begin
            found += 1
        while data[at] != NEWLINE:
            at += 1
        at += 1
    return found, end


@cached
def put(text: np.ndarray, at: int, value: Any, least: int) -> int:
    """Write a number that is not negative, with zeros in front to make it `least` digits; returns the place after."""
    count, limit = 1, 10
    while value >= limit and count < DIGITS:
        count, limit = count + 1, limit * 10
    count, rest = max(count, least), np.uint64(value)
    for place in range(at + count - 1, at - 1, -1):
        tenth = rest // np.uint64(10)
        text[place] = ZERO + rest - tenth * np.uint64(10)
        rest = tenth
    return at + count


@cached
def write(
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
    label: np.ndarray,
    separator: int,
    second_us: int,
    text: np.ndarray,
) -> int:
    """Write t, x, y, p (and label, if it has a length) as lines, with times in units of second_us, 1 or 10**6; returns
    their bytes.  `text` has room for `WIDEST` bytes a line."""
    at = 0
    for i in range(len(t)):
        now = t[i]
        if now < 0:
            text[at] = MINUS
            at, now = at + 1, -now
        at = put(text, at, now // second_us, 1)
        if second_us > 1:
            text[at] = POINT
            at = put(text, at + 1, now % second_us, 6)
        text[at] = separator
        at = put(text, at + 1, np.int64(x[i]), 1)
        text[at] = separator
        at = put(text, at + 1, np.int64(y[i]), 1)
        text[at] = separator
        at = put(text, at + 1, np.int64(p[i]), 1)
        if len(label):
            text[at] = separator
            at = put(text, at + 1, np.int64(label[i]), 1)
        text[at] = NEWLINE
        at += 1
    return at
