#!/usr/bin/env python3
"""Draw how one pixel turns frames into events: light, response, levels, crossings and their times.

    python examples/figure_crossings.py                       to crossings.png
    python examples/figure_crossings.py --set refractory_us=0 --set threshold_on=0.1

Top: the light of a few frames, a straight line between them.  Middle: its logarithm, and the response of the pixel's
two poles, which lags behind; an event comes where the response leaves the band between the two levels, and the band
moves by a threshold.  A crossing in the refractory period of the last event moves the band and sends nothing.
Bottom: the times of the events; those that a straight line between the frames' responses would give (`timing=linear`,
as ESIM does); and those of the fixed-rate mode, rounded to event frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import click
import numpy as np
from matplotlib.figure import Figure

from vid2ev import Dvs, DvsSpec, Events, Frame, load_sensor
from vid2ev.physics.log_curve import curve_of, log_level
from vid2ev.pictures.colours import GROUND, OFF, ON
from vid2ev.sensors.course import Course as PixelCourse
from vid2ev.sensors.course import course_of as course_of_pixel

FRAMES_MS = np.arange(8) * 5.0
LIGHT = np.array([0.2, 0.2, 0.62, 0.95, 0.9, 0.35, 0.17, 0.17])
PIXEL = [
    *("threshold_on=0.2", "threshold_off=0.2", "refractory_us=1200"),
    *("timing=response", "filter=before", "photoreceptor_tau_us=1500", "follower_tau_us=500"),
]
EVENT_FRAMES_HZ = 500
STEP_MS = 0.02  # of the curves
NO_REFRACTORY_US = 0.0001  # no nanosecond, as 0; unlike that it needs no other kernel
INK, FAINT, CURVE, BAND = "#d8dce4", "#8a92a0", "#ffffff", "#2b303c"


class Course(NamedTuple):
    """A pixel over time: what it has inside [ms, nat], and what it sends, or would without a refractory period."""

    t_ms: np.ndarray
    log_light: np.ndarray
    filtered: np.ndarray
    level_on: np.ndarray
    level_off: np.ndarray
    at_frames: np.ndarray  # `filtered` at the instants of the frames
    sent: Events
    crossings: Events
    linear: Events
    fixed: Events


def course_of(settings: Sequence[str] = ()) -> Course:
    """Run the pixel four times over the frames, and once in small steps along the line between them."""
    spec = load_sensor("ideal", [*PIXEL, *settings])
    t_ms = np.arange(FRAMES_MS[0], FRAMES_MS[-1] + STEP_MS / 2, STEP_MS)
    light = np.interp(t_ms, FRAMES_MS, LIGHT)
    inside = inside_of(spec, t_ms, light)
    curve = curve_of(spec.log_curve, spec.dark_level)
    return Course(
        t_ms,
        np.array([log_level(value, curve) for value in light]),
        *(inside.filtered, inside.level_on, inside.level_off),
        inside_of(spec, FRAMES_MS, LIGHT).filtered,
        sent=events(spec),
        crossings=events(spec.model_copy(update={"refractory_us": NO_REFRACTORY_US})),
        linear=events(spec.model_copy(update={"timing": "linear"})),
        fixed=events(spec.model_copy(update={"frame_rate_hz": float(EVENT_FRAMES_HZ)})),
    )


def frames(t_ms: np.ndarray, light: np.ndarray) -> list[Frame]:
    """Frames of a single pixel."""
    return [
        Frame(np.array([[value]], np.float32), round(1e6 * instant)) for instant, value in zip(t_ms, light, strict=True)
    ]


def events(spec: DvsSpec) -> Events:
    """What the pixel sends at the light of the frames."""
    return Events.concatenate(list(Dvs(spec, (1, 1)).run(frames(FRAMES_MS, LIGHT))))


def inside_of(spec: DvsSpec, t_ms: np.ndarray, light: np.ndarray) -> PixelCourse:
    """What the pixel has inside after each frame."""
    return course_of_pixel(Dvs(spec, (1, 1)), frames(t_ms, light))


def drawn(course: Course, refractory_ms: float) -> Figure:
    """Three plots over one axis of time."""
    figure = Figure(figsize=(10, 7.4), layout="constrained", facecolor=GROUND)
    light, levels, times = figure.subplots(3, 1, sharex=True, height_ratios=[1, 2.9, 0.9])
    for axis in (light, levels, times):
        axis.set_facecolor(GROUND)
        axis.tick_params(colors=FAINT, labelcolor=INK)
        axis.spines[:].set_visible(False)
        for instant in FRAMES_MS:
            axis.axvline(instant, color=FAINT, linewidth=0.6, alpha=0.5)
    draw_light(light)
    draw_levels(levels, course, refractory_ms)
    draw_times(times, course)
    times.set_xlabel("time [ms]; vertical lines: the frames", color=INK)
    return figure


def draw_light(axis: Any) -> None:
    """The light of the frames, and the line between them."""
    axis.plot(FRAMES_MS, LIGHT, "o-", color=INK, markersize=5, linewidth=1.2)
    axis.set(ylim=(0, 1.1), yticks=[0, 0.5, 1])
    axis.set_ylabel("light\n(1 is white)", color=INK)


def draw_levels(axis: Any, course: Course, refractory_ms: float) -> None:
    """The response between its levels, and where it crosses them."""
    t_ms = course.t_ms
    axis.fill_between(t_ms, course.level_off, course.level_on, color=BAND, linewidth=0, label="between the levels")
    axis.plot(t_ms, course.log_light, color=FAINT, linewidth=1.2, linestyle=(0, (4, 2)), label="log of the light")
    axis.plot(FRAMES_MS, course.at_frames, color=FAINT, linewidth=1, label="line between frames (ESIM)")
    axis.plot(t_ms, course.filtered, color=CURVE, linewidth=1.8, label="response")
    for polarity, colour, name in ((1, ON, "ON"), (0, OFF, "OFF")):
        crossed = 1e-3 * course.crossings.t[course.crossings.p == polarity]
        came = 1e-3 * course.sent.t[course.sent.p == polarity]
        silent, marker = crossed[~np.isin(crossed, came)], "^" if polarity else "v"
        axis.plot(came, at(course, came), marker, color=colour, markersize=9, label=f"{name} event")
        axis.plot(
            silent, at(course, silent), marker, markeredgecolor=colour, color="none", markersize=9,
            label=f"{name} crossing, silent",
        )  # fmt: skip
    bottom = min(course.level_off.min(), course.log_light.min()) - 0.12
    for instant in 1e-3 * course.sent.t:
        axis.plot([instant, instant + refractory_ms], [bottom] * 2, color=FAINT, linewidth=5, solid_capstyle="butt")
    axis.text(0, bottom, "refractory periods", color=INK, va="center", fontsize=9)
    axis.set_ylabel("log of the light [nat]", color=INK)
    axis.legend(loc="upper left", labelcolor=INK, frameon=False, fontsize=9)


def draw_times(axis: Any, course: Course) -> None:
    """The times of the events, by three ways of finding them."""
    period_ms = 1e3 / EVENT_FRAMES_HZ
    rows = [
        ("exact", course.sent),
        ("linear (ESIM)", course.linear),
        (f"fixed rate, {period_ms:g} ms", course.fixed),
    ]
    for row, (_, sent) in enumerate(rows):
        for polarity, colour in ((1, ON), (0, OFF)):
            axis.vlines(1e-3 * sent.t[sent.p == polarity], row - 0.36, row + 0.36, color=colour, linewidth=2.2)
    axis.plot(np.arange(0, FRAMES_MS[-1] + 1e-9, period_ms), np.full(int(FRAMES_MS[-1] / period_ms) + 1, 2.44), "|",
              color=FAINT, markersize=4)  # fmt: skip
    axis.set(ylim=(2.6, -0.6), yticks=range(len(rows)), yticklabels=[name for name, _ in rows])


def at(course: Course, t_ms: np.ndarray) -> np.ndarray:
    """The response at instants."""
    return np.interp(t_ms, course.t_ms, course.filtered)


@click.command(help="Draw how one pixel turns frames into events.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change the pixel; may be repeated.")
@click.option("-o", "--output", default="crossings.png", show_default=True)
def main(settings: tuple[str, ...], output: str) -> None:
    """Run, draw, and say how far the two ways of timing are apart."""
    course = course_of(settings)
    spec = load_sensor("ideal", [*PIXEL, *settings])
    drawn(course, 1e-3 * spec.refractory_us).savefig(output, dpi=110)
    exact = course.crossings
    click.echo(f"{output}: {len(course.sent.t)} events, {len(exact.t) - len(course.sent.t)} silent crossings")
    straight = events(spec.model_copy(update={"timing": "linear", "refractory_us": NO_REFRACTORY_US}))
    if np.array_equal(exact.p, straight.p):
        apart_us = np.abs(exact.t - straight.t)
        click.echo(f"a line between the frames is off by {np.median(apart_us):.0f} us, at most {apart_us.max()} us")


if __name__ == "__main__":
    main()
