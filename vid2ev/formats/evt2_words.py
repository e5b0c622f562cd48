"""EVT 2 and 2.1 words, decoded and encoded; the words themselves are explained in `evt2`."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.formats.evt_state import Left, State

HIGH, TRIGGER, OTHERS, CONTINUED = 0x8, 0xA, 0xE, 0xF
BEAT = 64  # steps of EVT_TIME_HIGH, of 64 us each, after which there is one even in silence

_HIGH, _LOOPS = int(State.HIGH), int(State.LOOPS)
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
    high, loops = state[_HIGH], state[_LOOPS]
    base = start_us + ((loops + 1) << 34 | high << 6)
    found = 0
    for i in range(len(words)):
        word = np.int64(words[i])
        kind = word >> 28
        if kind <= 1:
            column, row = word >> 11 & 0x7FF, word & 0x7FF
            if high < 0:
                left[_EARLY] += 1
            elif column >= width or row >= height:
                left[_OUTSIDE] += 1
            else:
                t[found], x[found], y[found], p[found] = base + (word >> 22 & 0x3F), column, row, kind
                found += 1
        elif kind == HIGH:
            value = word & 0xFFFFFFF
            if high - value >= 1 << 27:
                loops += 1
            high = value
            base = start_us + ((loops + 1) << 34 | high << 6)
        elif kind == TRIGGER:
            left[_TRIGGERS] += 1
        elif kind != CONTINUED:
            left[_OTHERS] += 1
    state[_HIGH], state[_LOOPS] = high, loops
    return len(words), found


@cached
def decode_vectors(
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
    """The same for words of EVT 2.1, with the half that has the kind in the upper 32 bits."""
    high, loops = state[_HIGH], state[_LOOPS]
    base = start_us + ((loops + 1) << 34 | high << 6)
    found, used, room = 0, 0, len(t) - 32
    while used < len(words) and found <= room:
        word, valid = np.int64(words[used] >> np.uint64(32)), np.int64(words[used] & np.uint64(0xFFFFFFFF))
        kind = word >> 28
        used += 1
        if kind <= 1:
            column, row = word >> 11 & 0x7FF, word & 0x7FF
            for bit in range(32):
                if valid >> bit & 1:
                    if high < 0:
                        left[_EARLY] += 1
                    elif column + bit >= width or row >= height:
                        left[_OUTSIDE] += 1
                    else:
                        t[found], x[found], y[found], p[found] = base + (word >> 22 & 0x3F), column + bit, row, kind
                        found += 1
        elif kind == HIGH:
            value = word & 0xFFFFFFF
            if high - value >= 1 << 27:
                loops += 1
            high = value
            base = start_us + ((loops + 1) << 34 | high << 6)
        elif kind == TRIGGER:
            left[_TRIGGERS] += 1
        elif kind != CONTINUED:
            left[_OTHERS] += 1
    state[_HIGH], state[_LOOPS] = high, loops
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
    high, i, n, count, room = state[_HIGH], first, len(t), 0, len(words) - 2
    while i <= n:
        now = t[i] if i < n else until_us
        while high < now >> 6 and count < room:
            high = min((high // BEAT + 1) * BEAT, now >> 6)
            words[count] = HIGH << 28 | (high & 0xFFFFFFF)
            count += 1
        if count >= room:
            break
        if i < n:
            words[count] = np.int64(p[i]) << 28 | (now & 0x3F) << 22 | np.int64(x[i]) << 11 | np.int64(y[i])
            count += 1
        i += 1
    state[_HIGH] = high
    return i, count
