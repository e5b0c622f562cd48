"""What people ask for in text: how to slice, and as what to see the slices.

slices            duration:10ms  duration:0.01  count:50000  area:500,32  source
representations   counts  frame[:FULL_SCALE]  voxel[:BINS][,polarity][,normalised]  time-surface[:TAU]  sae
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

from vid2ev.errors import UsageError
from vid2ev.views.slices import Area, Count, Duration, Slicing, Source

if TYPE_CHECKING:
    from vid2ev.views.representation import Kind

NUMBER = r"[0-9]{1,15}/[0-9]{1,15}|(?:[0-9]{1,15}\.?[0-9]{0,15}|\.[0-9]{1,15})(?:[eE][+-]?[0-9]{1,2})?"
LONGEST_US = 10**15  # thirty years: the end of a slice, which may be beyond that of its recording, is within 64 bits
UNITS_US = {"us": 1, "ms": 1000, "s": 10**6, "": 10**6}
SLICINGS = "duration:10ms, count:50000, area:500,32 or source"
REPRESENTATIONS = "counts, frame:2, voxel:5, time-surface:30ms or sae"


def parse_slicing(text: str) -> Slicing:
    """The slicing of a text; raises UsageError."""
    name, _, rest = text.strip().partition(":")
    if name == "duration":
        us = parse_us(rest, f"slices '{text}'")
        if us < 1:
            raise UsageError(f"slices '{text}': times are in whole microseconds; choose at least duration:1us")
        if us > LONGEST_US:
            raise UsageError(f"slices '{text}': longer than anything is recorded; choose at most duration:1e9s")
        return Duration(us)
    if name == "count":
        return Count(_whole(rest, f"slices '{text}'", "a number of events", "count:50000"))
    if name == "area":
        count, _, side = rest.partition(",")
        what, remedy = "a number of events and the side of a square [pixels]", "area:500,32"
        return Area(_whole(count, f"slices '{text}'", what, remedy), _whole(side, f"slices '{text}'", what, remedy))
    if name == "source" and not rest:
        return Source()
    raise UsageError(f"slices '{text}': expected {SLICINGS}")


def parse_us(text: str, within: str) -> Fraction:
    """Microseconds of a length of time above 0 such as 10ms, 0.01 or 1/30 (seconds); raises UsageError."""
    found = re.fullmatch(rf"({NUMBER})\s*(us|ms|s|)", text.strip())
    try:
        us = Fraction(found[1]) * UNITS_US[found[2]] if found else Fraction(0)
    except ZeroDivisionError:
        us = Fraction(0)
    if us <= 0:
        raise UsageError(f"{within}: '{text}' is no length of time above 0; give it as 10ms, 500us or 0.01 (seconds)")
    return us


def parse_representation(text: str, view: str | None = None) -> Kind:
    """What makes the representation of a text for a size (width, height); raises UsageError, which speaks of a `view`
    where it was asked for by such a name."""
    name, _, rest = text.strip().partition(":")
    request, asked = (f"representation '{text}'", "frame")
    if view is not None:
        request, asked = (f"view '{view}'", view.partition(":")[0])
    if name == "counts" and not rest:
        from vid2ev.views.counts import Counts

        return Counts
    if name == "frame":
        from vid2ev.views.frame import Frame

        return partial(Frame, full_scale=_whole(rest or "2", request, "events for full white", f"{asked}:2"))
    if name == "voxel":
        return _voxel(rest, request)
    if name == "time-surface":
        from vid2ev.views.time_surface import TimeSurface

        return partial(TimeSurface, tau_us=float(parse_us(rest or "30ms", request)))
    if name == "sae" and not rest:
        from vid2ev.views.time_surface import ActiveEvents

        return ActiveEvents
    raise UsageError(f"{request}: expected {REPRESENTATIONS}")


def _voxel(rest: str, request: str) -> Kind:
    from vid2ev.views.voxel import MOST_BINS, Voxel

    words = [word.strip() for word in rest.split(",") if word.strip()]
    count = words.pop(0) if words and words[0].isdigit() else "5"
    unknown = set(words) - {"polarity", "normalised"}
    if unknown:
        raise UsageError(f"{request}: '{min(unknown)}' is neither a number of bins nor polarity nor normalised")
    bins = _whole(count, request, f"1 to {MOST_BINS} bins", "voxel:5")
    if bins > MOST_BINS:
        raise UsageError(f"{request}: {bins} bins; choose at most {MOST_BINS}")
    return partial(Voxel, bins=bins, polarity="polarity" in words, normalised="normalised" in words)


def _whole(text: str, request: str, what: str, remedy: str) -> int:
    number = int(text) if re.fullmatch(r"[0-9]{1,15}", text.strip()) else 0
    if number < 1:
        raise UsageError(f"{request}: expected {what}, such as {remedy}")
    return number
