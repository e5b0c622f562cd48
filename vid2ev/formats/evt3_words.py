"""EVT 3 words, decoded and encoded; the words themselves are explained in `evt3`."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.formats.evt_state import Left, State

ROW, COLUMN, BASE, VECTOR_12, VECTOR_8, LOW, HIGH = 0x0, 0x2, 0x3, 0x4, 0x5, 0x6, 0x8
EXPOSURE_ROW, CONTINUED_4, TRIGGER, CONTINUED_12 = 0x1, 0x7, 0xA, 0xF
NOWHERE = 1 << 12
GROUP = 32  # pixels that one VECT_BASE_X with VECT_12, VECT_12, VECT_8 describes
WORTH = 5  # events from which that is shorter than a word each

_HIGH, _LOOPS, _LOW, _ROW, _COLUMN, _ON, _WIDTH = (int(name) for name in State)
_EARLY, _OUTSIDE, _TRIGGERS, _OTHERS = (int(name) for name in Left)


@cached
def decode(
    state: np.ndarray,
    left: np.ndarray,
    start_us: int,
    words: np.ndarray,
    width: int,
    height: int,
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
) -> tuple[int, int]:
    """Fill t, x, y, p from words; returns the numbers of words used and events found."""
    high, loops, low = state[_HIGH], state[_LOOPS], state[_LOW]
    row, column, on = state[_ROW], state[_COLUMN], state[_ON]
    now = start_us + (((loops + 1) << 24) | (high << 12) | max(low, 0))
    found, used, room = 0, 0, len(t) - 12
    while used < len(words) and found <= room:
        word = np.int64(words[used])
        kind, value = word >> 12, word & 0xFFF
        used += 1
        if kind == COLUMN:
            at = value & 0x7FF
            if high < 0 or row < 0:
                left[_EARLY] += 1
            elif at >= width or row >= height:
                left[_OUTSIDE] += 1
            else:
                t[found], x[found], y[found], p[found] = now, at, row, value >> 11
                found += 1
        elif kind == LOW:
            low = value
            now = start_us + (((loops + 1) << 24) | (high << 12) | low)
        elif kind == ROW:
            row = value & 0x7FF
        elif kind in (VECTOR_12, VECTOR_8):
            length = 12 if kind == VECTOR_12 else 8
            for bit in range(length):
                if (value >> bit) & 1:
                    at = column + bit
                    if high < 0 or row < 0 or column < 0:
                        left[_EARLY] += 1
                    elif at >= width or row >= height:
                        left[_OUTSIDE] += 1
                    else:
                        t[found], x[found], y[found], p[found] = now, at, row, on
                        found += 1
            column = min(column + length, NOWHERE) if column >= 0 else column
        elif kind == BASE:
            column, on = value & 0x7FF, value >> 11
        elif kind == HIGH:
            if high - value >= 1 << 11:
                loops += 1
            if value != high:
                high, low = value, 0
                now = start_us + (((loops + 1) << 24) | (high << 12))
        elif kind == EXPOSURE_ROW:
            row = NOWHERE
        elif kind == TRIGGER:
            left[_TRIGGERS] += 1
        elif kind != CONTINUED_4 and kind != CONTINUED_12:
            left[_OTHERS] += 1
    state[_HIGH], state[_LOOPS], state[_LOW] = high, loops, low
    state[_ROW], state[_COLUMN], state[_ON] = row, column, on
    return used, found


@cached
def encode(
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
    first: int,
    until_us: int,
    state: np.ndarray,
    words: np.ndarray,
) -> tuple[int, int]:
    """Say events `first` and on in words, then time up to until_us.

    Returns the next event and the number of words; the next event is one more than there are when all is said.
    """
    high, low, row = state[_HIGH], state[_LOW], state[_ROW]
    i, n, count, room = first, len(t), 0, len(words) - 8
    while i <= n:
        now = t[i] if i < n else until_us
        while high < now >> 12 and count < room:
            high, low = high + 1, -1
            words[count] = HIGH << 12 | (high & 0xFFF)
            count += 1
        if count >= room:
            break
        if i == n:
            i += 1
            break
        if now & 0xFFF != low:
            low = now & 0xFFF
            words[count] = LOW << 12 | low
            count += 1
        if y[i] != row:
            row = np.int64(y[i])
            words[count] = ROW << 12 | row
            count += 1
        base = np.int64(x[i]) // GROUP * GROUP
        end, valid = i + 1, np.int64(1) << (x[i] - base)
        # Only of pixels in a row, so that the order of events is kept; cameras' groups do not reach over the edge.
        if i + WORTH <= n and t[i + WORTH - 1] == now and y[i + WORTH - 1] == row and base + GROUP <= state[_WIDTH]:
            while end < n and t[end] == now and y[end] == row and p[end] == p[i] and x[end - 1] < x[end] < base + GROUP:
                valid |= np.int64(1) << (x[end] - base)
                end += 1
        if end - i >= WORTH:
            words[count] = BASE << 12 | np.int64(p[i]) << 11 | base
            words[count + 1] = VECTOR_12 << 12 | (valid & 0xFFF)
            words[count + 2] = VECTOR_12 << 12 | (valid >> 12 & 0xFFF)
            words[count + 3] = VECTOR_8 << 12 | valid >> 24
            count, i = count + 4, end
        else:
            words[count] = COLUMN << 12 | np.int64(p[i]) << 11 | np.int64(x[i])
            count, i = count + 1, i + 1
    state[_HIGH], state[_LOW], state[_ROW] = high, low, row
    return i, count
