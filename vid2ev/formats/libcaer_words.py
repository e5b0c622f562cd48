"""Words of `libcaer_cmp`, in which the ROS drivers of iniVation's cameras pack events.

    word   [12:16] type, [0:12] value
    0, 1   the upper and the lower 12 bits of the time since the packet's time_base, in us
    2      column
    3      [0:11] row, [11] p: an event
    4      [0:11] row, [11] p: of the vector that follows
    5      8 bits: events at that row and the 7 below it where a bit is set; the row moves on by 8

Times begin anew with each packet, columns and rows do not.  Other words are passed over.
Source: https://github.com/ros-event-camera/event_camera_codecs
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached

TIME_HIGH, TIME_LOW, COLUMN, ROW, BASE, VECTOR_8 = range(6)


@cached
def decode(
    words: np.ndarray, base_us: int, place: np.ndarray, t: np.ndarray, x: np.ndarray, y: np.ndarray, p: np.ndarray
) -> int:
    """Fill t, x, y, p from the words of a packet, and say how many events there are, 8 per word at most.

    `place` is carried from packet to packet: column, and row and polarity of the next vector, int64.
    """
    column, row, on = place[0], place[1], place[2]
    high_us, low_us, count = np.int64(0), np.int64(0), 0
    for word in words:
        kind, value = word >> 12, np.int64(word & 0xFFF)
        if kind == ROW:
            t[count], x[count], y[count], p[count] = base_us + high_us + low_us, column, value & 0x7FF, value >> 11
            count += 1
        elif kind == COLUMN:
            column = value & 0x7FF
        elif kind == TIME_LOW:
            low_us = value
        elif kind == TIME_HIGH:
            high_us = value << 12
        elif kind == BASE:
            row, on = value & 0x7FF, value >> 11
        elif kind == VECTOR_8:
            for bit in range(8):
                if value >> bit & 1:
                    t[count], x[count], y[count], p[count] = base_us + high_us + low_us, column, row + bit, on
                    count += 1
            row += 8
    place[0], place[1], place[2] = column, row & 0xFFFF, on
    return count
