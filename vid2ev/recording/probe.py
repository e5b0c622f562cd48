"""Single pixels over time: what they saw, what they had inside, what they sent.

probe.csv has a line for every frame, sub-frames too, and every event of each pixel, in order of time:

    t_us           microseconds on the clock of the camera, to the nanosecond for frames
    x, y           the pixel
    what           frame, ON or OFF
    light          linear light of the frame
    filtered_nat   what the photoreceptor makes of it, after the logarithm
    signal_nat     the same with leak and photoreceptor noise: what the comparator sees
    level_on_nat, level_off_nat     where the next event of each kind comes

The levels of an event are those after it.  They are told where the thresholds of the pixel, moved by at each event,
lead from the levels of the frame before to those of the next; and are empty where they do not, as something else moved
them or drew them anew: `crossing_noise`, shot noise, a refractory period, a readout that sends late.  The columns from
`light` to `signal_nat` are empty for events.
"""

from __future__ import annotations

import csv
import heapq
from collections.abc import Iterator, Sequence
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.recording.decimals import decimal
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame

COLUMNS = ("t_us", "x", "y", "what", "light", "filtered_nat", "signal_nat", "level_on_nat", "level_off_nat")
HEADER = f"{','.join(COLUMNS)}\n".encode()
POLARITY = ("OFF", "ON")
SAME_NAT = 1e-6  # levels this close are the same: far below every threshold, above what float32 leaves of a sum


class Probe:
    """Writes the lines of some pixels (x, y) of a sensor that is `width` pixels wide.

    thresholds   [nat] of its pixels, ON and OFF, each [height, width]; None if they are not known
    """

    def __init__(
        self,
        pixels: Sequence[tuple[int, int]],
        width: int,
        thresholds: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        self.pixels = tuple(pixels)
        self._width = width
        self.places = np.array([y * width + x for x, y in pixels], np.int64)
        on, off = (plane.reshape(-1)[self.places] for plane in thresholds) if thresholds else (None, None)
        self._moves = None if on is None or off is None else np.stack([-off, on], axis=1).astype(np.float64)

    def lines(
        self,
        frame: Frame,
        events: Events,
        inside: Sequence[np.ndarray],
        before: Sequence[np.ndarray] | None = None,
    ) -> bytes:
        """The events since the frame before, and a frame with what the pixels have inside after it: filtered, signal,
        level_on and level_off [nat].  `before` is the same after the frame before."""
        lines = self.event_lines(events, self._moved(events, before, inside) if before else None)
        t_us = decimal(frame.t_ns, 3)
        for k, (x, y) in enumerate(self.pixels):
            state = ",".join(f"{column[k]:.7g}" for column in inside)
            lines.append(f"{t_us},{x},{y},frame,{frame.light[y, x]:.7g},{state}\n")
        return "".join(lines).encode()

    def event_lines(self, events: Events, levels: dict[int, str] | None = None) -> list[str]:
        """The lines of events, those of other pixels left out, with the levels of those that have them."""
        found, said = np.flatnonzero(np.isin(self._places_of(events), self.places)), levels or {}
        return [
            f"{events.t[k]},{events.x[k]},{events.y[k]},{POLARITY[events.p[k]]},,,,{said.get(int(k), ',')}\n"
            for k in found
        ]

    def _places_of(self, events: Events) -> np.ndarray:
        return events.y.astype(np.int64) * self._width + events.x

    def _moved(self, events: Events, before: Sequence[np.ndarray], after: Sequence[np.ndarray]) -> dict[int, str]:
        """The levels after events, of pixels whose events alone moved the levels from one frame to the next."""
        levels: dict[int, str] = {}
        if self._moves is None:
            return levels
        places = self._places_of(events)
        for k, place in enumerate(self.places):
            mine = np.flatnonzero(places == place)
            way = np.cumsum(self._moves[k][events.p[mine]])
            on, off = before[2][k] + way, before[3][k] + way
            if mine.size and max(abs(on[-1] - after[2][k]), abs(off[-1] - after[3][k])) < SAME_NAT:
                levels |= {int(j): f"{a:.7g},{b:.7g}" for j, a, b in zip(mine, on, off, strict=True)}
        return levels


def merged(tables: Sequence[Path], pixels: Sequence[tuple[int, int]]) -> Iterator[bytes]:
    """The table of all pixels, from those of some of them each, over the same frames."""
    yield HEADER
    places = {pixel: k for k, pixel in enumerate(pixels)}
    for _, line in heapq.merge(*(_placed(table, places) for table in tables), key=itemgetter(0)):
        yield line


def one_after_the_other(tables: Sequence[Path]) -> Iterator[bytes]:
    """The table of all frames, from those of some of them each, of the same pixels."""
    yield HEADER
    for table in tables:
        with open(table, "rb") as file:
            yield from islice(file, 1, None)


def _placed(table: Path, places: dict[tuple[int, int], int]) -> Iterator[tuple[tuple[int, ...], bytes]]:
    """The lines of a table, each with what they are ordered by: the frames so far, whether it is of a frame, then the
    place of its pixel, or of an event (t, y, x)."""
    frames, before = -1, b""
    with open(table, "rb") as file:
        for line in islice(file, 1, None):
            t_us, x, y, what, _ = line.split(b",", 4)
            if what == b"frame":
                frames, before = frames + (t_us != before), t_us
                yield (frames, 1, places[int(x), int(y)]), line
            else:
                yield (frames + 1, 0, int(t_us), int(y), int(x)), line


def plot(table: Path, picture: Path) -> None:
    """Draw a probe.csv: for each pixel its light, and its signal between the levels with the events on it."""
    from matplotlib.figure import Figure

    pixels = read_probe(table)
    figure = Figure(figsize=(12, 4 * len(pixels)), layout="constrained")
    axes = figure.subplots(2 * len(pixels), 1, sharex=True, squeeze=False, height_ratios=[1, 2] * len(pixels))[:, 0]
    for (name, columns), light, inside in zip(pixels.items(), axes[::2], axes[1::2], strict=True):
        _draw(columns, light, inside)
        light.set_title(f"pixel {name[0]}, {name[1]}", loc="left")
    axes[-1].set_xlabel("time [s]")
    figure.savefig(picture, dpi=100, metadata={"Software": None})


def read_probe(table: Path) -> dict[tuple[int, int], dict[str, np.ndarray]]:
    """The columns of each pixel of a probe.csv: those of frames, the times [us] of its ON and OFF events, and as `band`
    what all its lines say of the levels, [lines, 3] of time [us], OFF and ON level (not a number where empty)."""
    found: dict[tuple[int, int], dict[str, list[Any]]] = {}
    with open(table, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            names = ("t_us", *COLUMNS[4:], "band")
            columns = found.setdefault((int(row["x"]), int(row["y"])), {name: [] for name in names})
            band = (row["t_us"], row["level_off_nat"] or "nan", row["level_on_nat"] or "nan")
            columns["band"].append([float(word) for word in band])
            if row["what"] != "frame":
                columns.setdefault(row["what"], []).append(float(row["t_us"]))
                continue
            for name in ("t_us", *COLUMNS[4:]):
                columns[name].append(float(row[name]))
    empty = {name: np.empty(0) for name in POLARITY}
    return {
        pixel: empty | {name: np.array(values) for name, values in columns.items()} for pixel, columns in found.items()
    }


def stepped(band: np.ndarray) -> np.ndarray:
    """A band whose gaps are filled: levels that no event tells go from those before to those of the next frame in
    equal steps, one at each event."""
    known = np.flatnonzero(~np.isnan(band[:, 1]))
    filled = band[: known[-1] + 1].copy() if len(known) else band[:0]  # (what a sensor sends late has no next frame)
    gaps = np.flatnonzero(np.isnan(filled[:, 1]))
    place = np.searchsorted(known, gaps)
    start, end = known[place - 1], known[place]
    share = (gaps - start) / (end - start - 1)
    filled[gaps, 1:] = filled[start, 1:] + share[:, None] * (filled[end, 1:] - filled[start, 1:])
    return filled


def _draw(columns: dict[str, np.ndarray], light: Any, inside: Any) -> None:
    t_s = columns["t_us"] / 1e6
    light.plot(t_s, columns["light"], color="#444444", linewidth=1)
    light.set_ylabel("light")
    band_us, low, high = stepped(columns["band"]).T
    inside.fill_between(band_us / 1e6, low, high, step="post", color="#dddddd", linewidth=0, label="between the levels")
    inside.plot(t_s, columns["filtered_nat"], color="#999999", linewidth=1, label="filtered")
    inside.plot(t_s, columns["signal_nat"], color="black", linewidth=1, label="signal")
    for name, colour, marker in (("ON", "#e08a00", "^"), ("OFF", "#2070d0", "v")):
        events_s = columns[name] / 1e6
        heights = np.interp(events_s, t_s, columns["signal_nat"]) if len(t_s) else events_s
        inside.plot(events_s, heights, marker, color=colour, markersize=5, linestyle="none", label=name)
    inside.set_ylabel("nat")
    inside.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=5, fontsize="small", frameon=False)
