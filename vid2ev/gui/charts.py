"""What is plotted, as options of ECharts: the course of a pixel, the cost of accuracy, intervals between events."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compare.statistics import EDGES_US, Statistics
from vid2ev.gui.theme import ACCENT, MUTED, OFF, ON
from vid2ev.sensors.course import Course

LEAST = 1e-4  # less than this distance is drawn as this
LONG_US = 10**7  # an interval, to which the axis goes whatever there is
TEXT = {"color": MUTED, "fontSize": 11}
FAINT = {"lineStyle": {"color": "#8a92a033"}}


def course_chart(course: Course | None) -> dict[str, Any]:
    """A pixel's light above, and below it its filtered signal between its two levels, with the events on it."""
    if course is None:
        return {"series": []}
    t_ms = 1e-6 * (course.t_ns - course.t_ns[0])
    line = {"type": "line", "symbol": "none", "animation": False}
    below = {"xAxisIndex": 1, "yAxisIndex": 1}
    step = line | below | {"step": "end", "lineStyle": {"width": 1, "type": "dashed"}}
    series = [
        line | {"name": "light", "data": _pairs(t_ms, course.light), "color": MUTED},
        step | {"name": "ON level", "data": _stepped(course, course.level_on), "color": ON},
        step | {"name": "OFF level", "data": _stepped(course, course.level_off), "color": OFF},
        line
        | below
        | {
            "name": "filtered",
            "data": _pairs(t_ms, course.filtered),
            "color": MUTED,
            "lineStyle": {"width": 1, "type": "dotted"},
        },
        line | below | {"name": "signal", "data": _pairs(t_ms, course.signal), "color": ACCENT},
    ]
    sent_ms = 1e-3 * course.events.t - 1e-6 * course.t_ns[0]
    heights = np.interp(sent_ms, t_ms, course.signal)
    for polarity, name, colour, turn in ((1, "ON", ON, 0), (0, "OFF", OFF, 180)):
        here = course.events.p == polarity
        series.append(
            below | {"type": "scatter", "name": name, "data": _pairs(sent_ms[here], heights[here]), "color": colour,
                     "symbol": "triangle", "symbolRotate": turn, "symbolSize": 9, "animation": False}
        )  # fmt: skip
    return {
        "grid": [
            {"left": 64, "right": 16, "top": 32, "height": 62},
            {"left": 64, "right": 16, "top": 118, "bottom": 42},
        ],
        "legend": {
            "data": ["light", "filtered", "signal", "ON level", "OFF level"],
            "top": 0,
            "right": 0,
            "textStyle": TEXT,
            "itemWidth": 26,
            "itemHeight": 8,
        },
        "tooltip": {"trigger": "axis"},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
        "xAxis": [
            _axis("", gridIndex=0, axisLabel={"show": False}, max=float(t_ms[-1])),
            _axis("time [ms]", gridIndex=1, max=float(t_ms[-1]), axisLabel=TEXT | {"showMaxLabel": False}),
        ],
        "yAxis": [_axis("light", True, gridIndex=0, splitNumber=2), _axis("log light [nat]", True, gridIndex=1)],
        "series": series,
    }


def _stepped(course: Course, level: np.ndarray) -> list[list[float]]:
    """A level, which is known after each frame: what is another then is so from the last event before it."""
    sent_ns = 1000 * course.events.t
    frame = np.minimum(np.searchsorted(course.t_ns, sent_ns), len(course.t_ns) - 1)
    last = np.flatnonzero(np.diff(frame, append=len(course.t_ns)))
    t_ns = np.concatenate([course.t_ns, sent_ns[last]])
    order = np.argsort(t_ns, kind="stable")
    return _pairs(1e-6 * (t_ns[order] - course.t_ns[0]), np.concatenate([level, level[frame[last]]])[order])


def cost_chart(found: dict[str, Any]) -> dict[str, Any]:
    """Error against time: the settings, those worth their time joined by a line, the recommended one filled."""
    rows = [row for row in (*found["settings"], found["reference"]) if row.get("distance") is not None]
    ahead = sorted([row["time"], max(row["distance"], LEAST)] for row in rows if row["front"])
    points = [
        {
            "value": [row["time"], max(row["distance"], LEAST)],
            "name": row["name"],
            "label": {"show": row["front"], "position": "top", "formatter": "{b}", **TEXT},
            "itemStyle": {
                "color": ACCENT if row["name"] == found["recommended"] else MUTED,
                "opacity": 1 if row["front"] else 0.45,
            },
            "symbolSize": 13 if row["name"] == found["recommended"] else 8,
        }
        for row in rows
    ]
    return {
        "grid": {"left": 64, "right": 90, "top": 16, "bottom": 44},
        "tooltip": {"trigger": "item", "formatter": "{b}<br>{c}"},
        "xAxis": _axis("time, in multiples of the clip's", type="log"),
        "yAxis": _axis("distance (vR)", True, type="log"),
        "series": [
            {"type": "line", "data": ahead, "step": "end", "showSymbol": False, "color": MUTED,
             "lineStyle": {"width": 1}, "silent": True, "animation": False},
            {"type": "scatter", "data": points, "animation": False},
        ],
    }  # fmt: skip


def interval_chart(named: dict[str, Statistics]) -> dict[str, Any]:
    """The shares of the intervals between events of a pixel, for each of some recordings."""
    series, most_us = [], LONG_US
    for (name, found), colour in zip(named.items(), (ACCENT, ON), strict=False):
        counts = found.intervals.sum(axis=0).astype(float)
        most_us = max(most_us, int(EDGES_US[1:][counts > 0].max(initial=0)))
        share = counts / max(counts.sum(), 1.0)
        data = _pairs(np.maximum(EDGES_US[:-1], 1), share)
        series.append({"type": "line", "name": name, "data": data, "step": "end", "showSymbol": False, "color": colour,
                       "animation": False})  # fmt: skip
    return {
        "grid": {"left": 64, "right": 16, "top": 28, "bottom": 44},
        "legend": {"top": 0, "right": 0, "textStyle": TEXT, "icon": "roundRect", "itemWidth": 14, "itemHeight": 8},
        "tooltip": {"trigger": "axis"},
        "xAxis": _axis("interval between two events of a pixel [us]", type="log", min=1, max=most_us),
        "yAxis": _axis("share", True),
        "series": series,
    }


def statistics_rows(named: dict[str, Statistics]) -> list[list[str]]:
    """A table: a row for each number, a column for each recording."""
    rows = [["", *named]]
    of = [found.as_dict() for found in named.values()]
    rows.append(["pixels", *("x".join(map(str, found.size)) for found in named.values())])
    rows.append(["seconds", *(f"{found.seconds:.3g}" for found in named.values())])
    for label, key, unit in (
        ("events", "events", ""),
        ("events per pixel and second", "rate_hz", ""),
        ("ON", "on_share", "%"),
        ("pixels with events", "active_share", "%"),
        ("isolated events per pixel and second", "isolated_hz", ""),
        ("shortest interval [us]", "interval_shortest_us", ""),
    ):
        rows.append([label, *(_shown(each[key], unit) for each in of)])
    rows.append(["half of the intervals below about [us]", *(_about(found.about_us(50)) for found in named.values())])
    return rows


def _shown(value: Any, unit: str) -> str:
    if value is None:
        return "–"
    if unit == "%":
        return f"{100 * value:.3g} %"
    return f"{value:,}" if isinstance(value, int) else f"{value:.3g}"


def _about(value: float | None) -> str:
    """Two digits: more are not known of what was counted in bins a third wide."""
    if value is None:
        return "–"
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if rounded >= 10 else f"{rounded:g}"


def _pairs(x: np.ndarray, y: np.ndarray) -> list[list[float]]:
    return [[float(f"{a:.6g}"), float(f"{b:.6g}")] for a, b in zip(x, y, strict=True)]


def _axis(name: str, upright: bool = False, **rest: Any) -> dict[str, Any]:
    place = {"nameLocation": "middle", "nameGap": 46 if upright else 28, "nameTextStyle": TEXT}
    lines = {"splitLine": FAINT if upright else {"show": False}, "axisLine": {"show": not upright, **FAINT}}
    looks = {"type": "value", "name": name, "axisLabel": TEXT, "axisTick": {"show": False}, "scale": True}
    return place | lines | looks | rest
