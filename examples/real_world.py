"""Simulated events against real ones: the tables and the plot of docs/real_world.md.

    python examples/real_world.py ../shared/data --plot docs/real_world.png

DATA holds recordings of a DAVIS346 (hybrid/NAME.mat, NAME.png: events and one frame; from pz-even/ni-joint on GitHub)
and of a VGA sensor of Prophesee (events/evt3_vga_legs.bag, from ros-event-camera/event_camera_py).

There is one frame B per recording, smeared by its exposure, so the light is rebuilt from it, with a lamp at twice the
mains and a camera that drifts at the velocity v:

    light(x, t) = B(x - v t) exp(-swing / 2 cos(2 pi 100 Hz (t - trough)))

v is that for which ON - OFF fits -theta^-1 grad ln B . v T best (the linear model of events: Gallego et al.,
"Event-based Vision: A Survey", TPAMI 44(1), 2022).  Swing and trough are such that the lit pixels have as many OFF
events as in the recording, half of them by the same instant.  These three are fitted; the rest is not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import numpy as np
from still_pixels import hot_from, rates_by_light

from vid2ev import Dvs, DvsSpec, load_sensor, read_events
from vid2ev.compare.statistics import EDGES_US, Statistics, statistics_of
from vid2ev.stream.events import Events

PRESET, ASKED = "davis346", ("photoreceptor_tau_us=500", "refractory_us=750", "shot_rate_hz=2", "shot_light_factor=1")
VGA = "prophesee-gen31"
STEP_US, BIN_US = 100, 250
MAINS_US, WARM_US = 10_000, 40_000  # period of a lamp at 50 Hz; how long it swings before the recording begins
LIT = 0.4  # pixels of so much light are lit, 1 is the frame's full code
LEVELS = np.array([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 1.01])  # classes of light
WALL_LEVELS = np.array([0.16, 0.24, 0.28, 0.32, 0.36, 0.4, 0.52])
SHUTTLE = (slice(20, None), slice(190, 330))  # of badminton: what moves, and what it has smeared
SEEDS = 10  # simulated cameras that look at the wall
QUIET = 0.05  # of the pixels of a quiet block of 16x16 have an event
GREY = 0.18  # the light of the quiet pixels of the VGA sensor, of which there is no frame


@dataclass(frozen=True)
class Scene:
    """A real recording from its first event on, the light of its frame, and which pixels are looked at."""

    events: Events
    light: np.ndarray
    span_us: int
    kept: np.ndarray


@dataclass(frozen=True)
class Drive:
    """How the light changes: the lamp's swing [nat] and when it is least [us], the velocity of the picture [px/s]."""

    swing: float = 0.0
    trough_us: float = 0.0
    velocity: tuple[float, float] = (0.0, 0.0)

    def light(self, frame: np.ndarray, t_us: int) -> np.ndarray:
        """The frame as it is at an instant."""
        from scipy.ndimage import shift

        if self == Drive():
            return frame
        right, down = (speed * t_us / 1e6 for speed in self.velocity)
        moved = shift(frame, (down, right), order=1, mode="nearest")
        lamp = -self.swing / 2 * math.cos(2 * math.pi * (t_us - self.trough_us) / MAINS_US)
        return moved * np.float32(math.exp(lamp))


def load_scene(folder: Path, name: str, wall_only: bool = False) -> Scene:
    """A recording of the DAVIS346; without what is before the wall of `badminton`, if only that is wanted."""
    import cv2
    from scipy.io import loadmat

    t, x, y, p = loadmat(folder / "hybrid" / f"{name}.mat")["events"].T
    frame = cv2.imdecode(np.fromfile(folder / "hybrid" / f"{name}.png", np.uint8), cv2.IMREAD_GRAYSCALE)
    kept = np.ones(frame.shape, bool)
    if wall_only:
        kept[SHUTTLE] = False
    events = Events(t - t[0], x.astype(np.uint16), y.astype(np.uint16), p.astype(np.uint8))
    return Scene(of(events, kept), frame.astype(np.float32) / 255, int(t[-1] - t[0]), kept)


def of(events: Events, kept: np.ndarray) -> Events:
    """The events of the pixels that are kept."""
    return events.select(kept[events.y, events.x])


def velocity(scene: Scene, theta: float) -> tuple[float, float]:
    """How fast the picture moves to the right and down [px/s], by least squares; a swing of all light is left out."""
    import cv2

    level = np.log(cv2.GaussianBlur(scene.light, (0, 0), 0.7) + 0.02)
    slopes = [cv2.Sobel(level, -1, *order, ksize=3) / 8 for order in ((1, 0), (0, 1))]
    model = np.stack([scene.light > 0.3, -slopes[0], -slopes[1]], -1)[6:-6, 6:-6].reshape(-1, 3).astype(float)
    signed = np.zeros(scene.light.shape)
    np.add.at(signed, (scene.events.y, scene.events.x), 2.0 * scene.events.p - 1.0)
    _, right, down = theta * np.linalg.lstsq(model, signed[6:-6, 6:-6].ravel(), rcond=None)[0]
    return float(right * 1e6 / scene.span_us), float(down * 1e6 / scene.span_us)


def simulate(scene: Scene, spec: DvsSpec, drive: Drive, seed: int = 0) -> Events:
    """The events of a camera that has seen the lamp for a while, over the time of the recording."""
    height, width = scene.light.shape
    dvs, parts = Dvs(spec, (width, height), seed=seed), [Events.empty()]
    for t_us in range(-WARM_US, scene.span_us + STEP_US, STEP_US):
        events = dvs.step(drive.light(scene.light, t_us), (t_us + WARM_US) * 1000)
        parts.append(Events(events.t - WARM_US, events.x, events.y, events.p))
    events = Events.concatenate(parts)
    first, last = np.searchsorted(events.t, [0, scene.span_us + 1])
    return of(events.stretch(int(first), int(last)), scene.kept)


def fit_lamp(scene: Scene, spec: DvsSpec) -> tuple[Drive, Events]:
    """The lamp with which the lit pixels have as many OFF events, half of them by the same instant."""
    goal, goal_us = falls(scene, scene.events)
    drift, low, high, trough_us = velocity(scene, spec.threshold_off), 0.0, 1.0, 3500.0
    for _ in range(10):
        drive = Drive((low + high) / 2, trough_us, drift)
        events = simulate(scene, spec, drive)
        count, median_us = falls(scene, events)
        trough_us -= 0.8 * (median_us - goal_us) if count else 0.0
        low, high = (low, drive.swing) if count > goal else (drive.swing, high)
    return drive, events


def falls(scene: Scene, events: Events) -> tuple[int, float]:
    """How many OFF events the lit pixels have, and the instant by which half of them came [us]."""
    t = events.t[(events.p == 0) & (scene.light[events.y, events.x] > LIT)]
    return len(t), float(np.median(t)) if len(t) else 0.0


def numbers(found: Statistics, kept: np.ndarray, cameras: int = 1) -> dict[str, str]:
    """The rows of a column, for people; found of so many cameras, one above the other."""
    counts = found.counts.sum(axis=0)[np.tile(kept, (cameras, 1))]
    alone, gaps = sum(found.isolated), found.intervals.sum(axis=1)
    times = counts.size * found.seconds
    least = hot_from(counts)
    percentiles = ", ".join(f"{found.interval_us(percent):,}" for percent in (5, 50, 95)) if gaps.any() else "-"
    return {
        "events per pixel": f"{found.events / counts.size:.3g}",
        "events per pixel and second": f"{found.events / times:.3g}",
        "ON share": f"{100 * (found.on_share or 0):.1f} %",
        "isolated per pixel and second": f"{alone / times:.3g}",
        "pixels with an event": f"{100 * np.mean(counts > 0):.3g} %",
        "of those, with two or more": f"{100 * np.mean(counts[counts > 0] > 1):.3g} %",
        "hot pixels": f"{100 * np.mean(counts >= least):.2g} %",
        "shortest interval [us]": str(found.shortest_us or "-"),
        "5, 50, 95 % of the intervals below [us]": percentiles,
        "intervals between opposite polarities": f"{100 * gaps[0] / gaps.sum():.3g} %" if gaps.any() else "-",
    }


def by_light(scene: Scene, events: Events, levels: np.ndarray) -> list[tuple[str, str]]:
    """OFF events per pixel in classes of light, and the instant by which half of them came."""
    light, off = scene.light, events.select(events.p == 0)
    rows = []
    for low, high in pairwise(levels):
        chosen = (light >= low) & (light < high)
        t = off.t[chosen[off.y, off.x]]
        rows.append((f"{len(t) / chosen.sum():.3f}", f"{np.median(t) / 1000:.2f} ms" if len(t) >= 50 else "-"))
    return rows


def table(title: str, columns: dict[str, dict[str, str]]) -> str:
    """Columns beside each other, in Markdown."""
    rows = [f"| {title} | {' | '.join(columns)} |", f"|---|{'---:|' * len(columns)}"]
    for name in next(iter(columns.values())):
        rows.append(f"| {name} | {' | '.join(column.get(name, '-') for column in columns.values())} |")
    return "\n".join(rows)


def flicker(folder: Path) -> tuple[str, dict[str, Any]]:
    """The toy, lit by a lamp on the mains: real, the preset, the preset with what the recordings ask for."""
    scene = load_scene(folder, "toy")
    size = scene.light.shape[::-1]
    cameras = {"real": scene.events}
    said = []
    for name, changes in ((PRESET, ()), (f"{PRESET}, changed", ASKED)):
        drive, cameras[name] = fit_lamp(scene, load_sensor(PRESET, changes))
        right, down = drive.velocity
        lamp = f"swing {drive.swing:.3f} nat, least at {drive.trough_us / 1000:.2f} ms"
        said.append(f"{name}: {lamp}, drift {right:.0f}, {down:.0f} px/s")
    found = {name: statistics_of([events], size, (0, scene.span_us)) for name, events in cameras.items()}
    first = table("toy", {name: numbers(one, scene.kept) for name, one in found.items()})
    classes = {name: by_light(scene, events, LEVELS) for name, events in cameras.items()}
    labels = [f"{low:.1f} to {min(high, 1):.1f}" for low, high in pairwise(LEVELS)]
    second = table(
        "light: OFF per pixel, half by",
        {
            name: {label: ", ".join(row) for label, row in zip(labels, rows, strict=True)}
            for name, rows in classes.items()
        },
    )
    return "\n\n".join([first, second, *said]), {"scene": scene, "cameras": cameras, "found": found, "classes": classes}


def wall(folder: Path) -> tuple[str, dict[str, Any]]:
    """The wall behind the shuttlecock, which does not move: noise against light."""
    scene = load_scene(folder, "badminton", wall_only=True)
    height, width = scene.light.shape
    found = {"real": (statistics_of([scene.events], (width, height), (0, scene.span_us)), 1)}
    for name, changes in ((PRESET, ()), (f"{PRESET}, changed", ASKED)):
        spec = load_sensor(PRESET, changes)
        found[name] = stacked([simulate(scene, spec, Drive(), seed) for seed in range(SEEDS)], scene), SEEDS
    rates = {
        name: rates_by_light(
            one.counts,
            np.tile(np.where(scene.kept, scene.light, np.nan), (many, 1)),
            one.seconds,
            WALL_LEVELS,
        )
        for name, (one, many) in found.items()
    }
    first = table("wall", {name: numbers(one, scene.kept, many) for name, (one, many) in found.items()})
    second = table(
        "light: events per pixel and second",
        {
            name: {
                f"{low:.2f} to {high:.2f}": f"{row.rate_hz:.2f} +- {row.error_hz:.2f}"
                for (low, high), row in zip(pairwise(WALL_LEVELS), rows, strict=True)
            }
            for name, rows in rates.items()
        },
    )
    facts = {"found": {name: one for name, (one, _) in found.items()}, "rates": rates}
    return "\n\n".join([first, second, *periods(folder, scene)]), facts


def periods(folder: Path, scene: Scene) -> list[str]:
    """What two periods of the lamp say: of the thresholds, for the light is where it was; and of the wall."""
    polarities = load_scene(folder, "badminton").events.p
    on, off = (int(np.count_nonzero(polarities == p)) for p in (1, 0))
    ratio, error = off / on, off / on * math.sqrt(1 / on + 1 / off)
    said = [f"threshold_on / threshold_off = OFF / ON = {ratio:.2f} +- {error:.2f}"]
    events, light = scene.events, scene.light[scene.events.y, scene.events.x]
    part = np.digitize(light, [WALL_LEVELS[2], WALL_LEVELS[4], WALL_LEVELS[5]])
    for name, chosen in (("dark", part == 0), ("middle", part == 1), ("bright", part == 3)):
        for polarity, chosen_p in (("OFF", events.p == 0), ("ON", events.p == 1)):
            turns = np.exp(2j * np.pi * events.t[chosen & chosen_p] / MAINS_US)
            mean, instant = turns.mean(), np.angle(turns.mean()) / (2 * np.pi) * MAINS_US % MAINS_US
            strength = f"{abs(mean):.2f} +- {1 / math.sqrt(len(turns)):.2f}"
            said.append(f"{name} wall, {polarity}: strength at 100 Hz {strength}, most at {instant / 1000:.1f} ms")
    return said


def stacked(cameras: list[Events], scene: Scene) -> Statistics:
    """The statistics of several cameras, one above the other."""
    height, width = scene.light.shape
    parts = [Events(e.t, e.x, (e.y + k * height).astype(np.uint16), e.p) for k, e in enumerate(cameras)]
    events = Events.concatenate(parts)
    return statistics_of(
        [events.select(np.argsort(events.t, kind="stable"))], (width, height * len(cameras)), (0, scene.span_us)
    )


def quiet_vga(folder: Path) -> tuple[str, dict[str, Any]]:
    """The quiet pixels of the VGA recording against those of a sensor that sees an even grey."""
    real = Events.concatenate(read_events(folder / "events" / "evt3_vga_legs.bag"))
    real = Events(real.t - real.t[0], real.x, real.y, real.p)
    span_us = int(real.t[-1])
    active = statistics_of([real], (640, 480)).counts.sum(axis=0) > 0
    quiet = active.reshape(30, 16, 40, 16).mean(axis=(1, 3)) <= QUIET
    kept = quiet.repeat(16, 0).repeat(16, 1)
    still = Scene(real, np.full((480, 640), GREY, np.float32), span_us, kept)
    cameras = {"real": of(real, kept), VGA: simulate(still, load_sensor(VGA), Drive())}
    found = {name: statistics_of([events], (640, 480), (0, span_us)) for name, events in cameras.items()}
    columns = {name: numbers(one, kept) | hot_and_other(one, kept) for name, one in found.items()}
    return f"{table('quiet VGA', columns)}\n\n{100 * kept.mean():.0f} % of the pixels are quiet", {"found": found}


def hot_and_other(found: Statistics, kept: np.ndarray) -> dict[str, str]:
    """Rate and polarity of the hot pixels and of the others."""
    counts = found.counts.sum(axis=0)
    least = hot_from(counts[kept])
    rows = {}
    for name, chosen in (("hot pixels", kept & (counts >= least)), ("the others", kept & (counts < least))):
        off, on = (int(count[chosen].sum()) for count in found.counts)
        rate = (off + on) / max(chosen.sum() * found.seconds, 1e-9)
        rows[f"{name}: events per second, ON share"] = f"{rate:.3g}, {100 * on / max(off + on, 1):.0f} %"
    return rows


def draw(lamp: dict[str, Any], noise: dict[str, Any], vga: dict[str, Any], picture: Path) -> None:
    """Six panels."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 7.2), layout="constrained")
    axes = figure.subplots(2, 3)
    draw_time(axes[0, 0], lamp)
    draw_classes(axes[0, 1:], lamp)
    intervals(axes[1, 0], lamp["found"], "toy: intervals")
    draw_rates(axes[1, 1], noise)
    intervals(axes[1, 2], vga["found"], "quiet VGA: intervals")
    figure.savefig(picture, dpi=80, metadata={"Software": None})


COLOURS = {"real": "black", PRESET: "#d95f02", f"{PRESET}, changed": "#1b78b4", VGA: "#d95f02"}


def draw_time(axes: Any, lamp: dict[str, Any]) -> None:
    scene = lamp["scene"]
    edges = np.arange(0, scene.span_us + 1, BIN_US)
    for name, events in lamp["cameras"].items():
        for p, sign in ((1, 1), (0, -1)):
            rate = np.histogram(events.t[events.p == p], edges)[0] / scene.kept.sum() / BIN_US * 1e6
            axes.stairs(sign * rate, edges / 1000, color=COLOURS[name], label=name if p else None)
    axes.axhline(0, color="grey", linewidth=0.5)
    axes.set_title("toy: ON (up) and OFF (down) per pixel and second", loc="left", fontsize=10)
    axes.set_xlabel("time [ms]")
    axes.legend(frameon=False, fontsize=9)


def draw_classes(panels: Any, lamp: dict[str, Any]) -> None:
    middle = (LEVELS[1:] + LEVELS[:-1]) / 2
    titles = ("toy: OFF events per pixel against light", "toy: half of the OFF events by [ms]")
    for panel, k, title in zip(panels, (0, 1), titles, strict=True):
        for name, rows in lamp["classes"].items():
            values = [math.nan if row[k] == "-" else float(row[k].split()[0]) for row in rows]
            panel.plot(middle, values, "o-", color=COLOURS[name], markersize=4)
        panel.set_title(title, loc="left", fontsize=10)
        panel.set_xlabel("light in the frame, 1 is full code")
        panel.set_ylim(bottom=0)


def intervals(axes: Any, found: dict[str, Statistics], title: str) -> None:
    edges = EDGES_US[EDGES_US >= 100]
    width = np.diff(np.log10(edges))
    for name, one in found.items():
        many = one.intervals.sum(axis=0)[-len(width) :]
        axes.stairs(many / max(many.sum(), 1) / width, edges, color=COLOURS[name], label=name)
    axes.set_xscale("log")
    axes.set_xlim(200, 3e4 if PRESET in found else 3e6)
    axes.set_title(f"{title}, share per decade", loc="left", fontsize=10)
    axes.set_xlabel("interval [us]")
    axes.legend(frameon=False, fontsize=9)


def draw_rates(axes: Any, noise: dict[str, Any]) -> None:
    for name, rows in noise["rates"].items():
        light, rate, error = zip(*((row.light, row.rate_hz, row.error_hz) for row in rows), strict=True)
        axes.errorbar(light, rate, error, fmt="o-", color=COLOURS[name], markersize=4)
    axes.set_title("wall: events per pixel and second against light", loc="left", fontsize=10)
    axes.set_xlabel("light in the frame, 1 is full code")
    axes.set_ylim(bottom=0)


@click.command()
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path), default="../shared/data")
@click.option("--plot", type=click.Path(path_type=Path), help="PNG file to draw into.")
def main(data: Path, plot: Path | None) -> None:
    """Print how alike real and simulated recordings are, and draw it."""
    parts = [flicker(data), wall(data), quiet_vga(data)]
    scene = load_scene(data, "keyboard")
    found = statistics_of([scene.events], scene.light.shape[::-1], (0, scene.span_us))
    alone = table("keyboard", {"real": numbers(found, scene.kept)})
    click.echo("\n\n".join([*(text for text, _ in parts), alone]))
    if plot is not None:
        draw(*(facts for _, facts in parts), plot)


if __name__ == "__main__":
    main()
