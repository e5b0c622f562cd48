#!/usr/bin/env python3
"""How fast the event camera is: nanoseconds per pixel and frame, and per event.

    python examples/benchmark.py                                      `pan`, three sizes, one and two threads
    python examples/benchmark.py --clip traffic.mp4 --size 1280x720   `video` as well
    python examples/benchmark.py --frames STACK.npy --preset ideal --threads 2 --json
                                                                      one measurement of uint8 [N, H, W]

Timed is `Dvs.steps`: uint8 frames in memory in, eight at a time as `convert` gives them, arrays of events out,
which are counted and dropped; with `--at-once 1` it is `Dvs.step`. Frames are 1 ms apart; the first settles
the sensor, and with what goes with it, three at least, warms up. Thresholds are 0.2 nat. Each measurement is
a process of its own, and they are interleaved (A B C A B C), so that a slow minute of the machine hits all
alike; the table has the medians. A measurement during which other programs took more than 0.08 of a core is
left out if a quiet one of its kind remains; if none does, the row has a star.

    pan    scikit-image's photographs in a mosaic that moves by (0.5, 0.1) pixels a frame: dense
    video  frames of a clip, with ten linear blends from each to the next: sparse
    still  the first frame all the time: the cost of looking at every pixel.  What `pan` and `video` take
           beyond it, divided by their events, is the cost of an event.

Beside each measurement a float32 plane of that size is copied: times of two machines compare in copies.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
import numpy as np

FRAME_NS = 1_000_000
WARM_UP_FRAMES = 4
AT_ONCE = 8
QUIET_CORES = 0.08
TWO_POLES = ("timing=response", "photoreceptor_tau_us=300", "follower_tau_us=100")
PRESETS = {  # name -> the sensor and what is changed in it
    "ideal": ("ideal", ()),
    "two-pole": ("ideal", TWO_POLES),
    "paper": ("paper", ()),
    "v2e-clean": ("v2e-clean", ()),
    "v2e-noisy": ("v2e-noisy", ()),
    "davis346": ("davis346", ()),
}
THRESHOLDS = ("threshold_on=0.2", "threshold_off=0.2")
# Bundled with scikit-image, so that every machine has the same.
PHOTOGRAPHS = ("astronaut", "coffee", "chelsea", "camera", "brick", "grass", "gravel")
TILE = 400  # pixels a side
SIZES = ("346x260", "640x480", "1280x720")

Row = dict[str, Any]


# ---- frames


def mosaic(height: int, width: int) -> np.ndarray:
    """Photographs side by side, each row of tiles one photograph further on; float32 0 to 255."""
    import cv2

    try:
        import skimage.color
        import skimage.data
    except ImportError as error:
        raise click.UsageError("The mosaic needs scikit-image; run `pip install scikit-image`.") from error
    tiles = []
    for name in PHOTOGRAPHS:
        photograph = getattr(skimage.data, name)()
        if photograph.ndim == 3:
            photograph = skimage.color.rgb2gray(photograph) * 255
        tiles.append(cv2.resize(np.asarray(photograph, np.float32), (TILE, TILE), interpolation=cv2.INTER_AREA))
    rows, columns = -(-height // TILE), -(-width // TILE)
    strips = [
        np.hstack([tiles[(row * (columns + 1) + column) % len(tiles)] for column in range(columns)])
        for row in range(rows)
    ]
    return np.vstack(strips)[:height, :width]


def pan(count: int, width: int, height: int) -> np.ndarray:
    """A view moving over the mosaic, 0.5 pixels a frame to the right, 0.1 down; uint8 [N, height, width]."""
    import cv2

    texture = mosaic(height + int(0.1 * count) + 4, width + int(0.5 * count) + 4)
    frames = np.empty((count, height, width), np.uint8)
    for i in range(count):
        shift = np.array([[1, 0, -0.5 * i - 1], [0, 1, -0.1 * i - 1]], np.float32)
        moved = cv2.warpAffine(texture, shift, (width, height), flags=cv2.INTER_LINEAR)
        frames[i] = np.clip(np.rint(moved), 0, 255)
    return frames


def video(count: int, width: int, height: int, clip: Path, blends: int = 10, start: int = 60) -> np.ndarray:
    """Frames of a clip from number `start` on, `blends` linear steps each; uint8 [N, height, width]."""
    import cv2

    from vid2ev.untrusted import plain_name

    with plain_name(clip) as name:
        capture, source = cv2.VideoCapture(name), []
    for index in range(start + count // blends + 2):
        ok, image = capture.read()
        if not ok:
            raise click.UsageError(
                f"{clip}: {index} frames, expected {start + count // blends + 2}; give a longer clip."
            )
        if index >= start:
            gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
            method = cv2.INTER_AREA if width < gray.shape[1] else cv2.INTER_LINEAR
            source.append(cv2.resize(gray, (width, height), interpolation=method).astype(np.float32))
    frames = np.empty((count, height, width), np.uint8)
    for i in range(count):
        k, part = divmod(i, blends)
        frames[i] = np.rint(source[k] * (1 - part / blends) + source[k + 1] * (part / blends))
    return frames


# ---- one measurement


def measure(
    stack: Path, preset: str, settings: Iterable[str], threads: int, still: bool, seconds: float, at_once: int = AT_ONCE
) -> Row:
    """Time a sensor on a stack of frames for `seconds` or, as only whole passes compare, up to three times that."""
    frames = np.load(stack)
    _, height, width = frames.shape
    if still:
        frames[...] = frames[0].copy()
    began = time.perf_counter()
    from vid2ev.sensors.dvs import Dvs
    from vid2ev.sensors.presets import load_sensor

    name, changes = PRESETS[preset]
    spec = load_sensor(name, [*THRESHOLDS, *changes, *settings])

    def sensor() -> Dvs:
        return Dvs(spec, (width, height), threads=threads, transfer="linear")

    base_mib = peak_mib()
    time_pass(sensor(), frames[: WARM_UP_FRAMES + at_once], at_once, seconds)  # compiles, or loads what was compiled
    first_s = time.perf_counter() - began
    times: list[float] = []
    events = 0
    others, began = others_core_seconds(), time.perf_counter()
    while time.perf_counter() - began < seconds or not times:
        more, found = time_pass(sensor(), frames, at_once, 3 * seconds)
        times, events = times + more, events + found
    foreign_cores = (others_core_seconds() - others) / (time.perf_counter() - began)
    total, pixels = sum(times), len(times) * width * height
    return {
        "preset": preset,
        "threads": threads,
        "size": f"{width}x{height}",
        "clip": stack.stem.split("_")[0],
        "still": still,
        "at_once": at_once,
        "frames_timed": len(times),
        "fps": len(times) / total,
        "mpix_s": pixels / total / 1e6,
        "mev_s": events / total / 1e6,
        "events": events,
        "ev_px_frame": events / pixels,
        "ns_px": total / pixels * 1e9,
        "copy_ns_px": plane_copy_ns(width * height),
        "first_s": first_s,
        "rss_mib": peak_mib(),
        "rss_delta_mib": peak_mib() - base_mib,
        "foreign_cores": round(max(0.0, foreign_cores), 3),
    }


def time_pass(dvs: Any, frames: np.ndarray, at_once: int, seconds: float) -> tuple[list[float], int]:
    """Seconds of each frame after the warm-up, and the events of those frames; cut short after `seconds`."""
    times, total = [], 0
    began = time.perf_counter()
    for first in range(0, len(frames), at_once):
        some = frames[first : first + at_once]
        t_ns = [FRAME_NS * (1 + first + k) for k in range(len(some))]
        before = time.perf_counter()
        sent = dvs.steps(some, t_ns) if at_once > 1 else [dvs.step(some[0], t_ns[0])]
        after = time.perf_counter()
        if first >= WARM_UP_FRAMES:
            times += [(after - before) / len(some)] * len(some)
            total += sum(map(len, sent))
        del sent
        if after - began > seconds and len(times) >= 5:
            break
    return times, total


def plane_copy_ns(pixels: int) -> float:
    """Nanoseconds per pixel of copying a float32 plane, the best of many: the machine at its own pace."""
    source, target = np.ones(pixels, np.float32), np.zeros(pixels, np.float32)
    best = float("inf")
    for _ in range(100):
        before = time.perf_counter()
        np.copyto(target, source)
        best = min(best, time.perf_counter() - before)
    return best / pixels * 1e9


def peak_mib() -> float:
    """The most memory that this process has held [MiB]; 0 on Windows, which does not tell."""
    if sys.platform == "win32":
        return 0.0
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


def others_core_seconds() -> float:
    """Core-seconds that other programs have taken so far; 0 where there is no /proc/stat."""
    try:
        ticks = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    except OSError:
        return 0.0
    idle, waiting = ticks[3], ticks[4]
    return (sum(ticks) - idle - waiting) / os.sysconf("SC_CLK_TCK") - time.process_time()


# ---- many measurements


def in_own_process(job: Row, settings: Iterable[str], seconds: float) -> Row:
    """`measure` in a new interpreter; the compiled code of each preset is kept in a folder beside the stack."""
    command = [sys.executable, __file__, "--json", "--frames", str(job["stack"]), "--preset", job["preset"]]
    command += ["--threads", str(job["threads"]), "--at-once", str(job["at_once"]), "--seconds", str(seconds)]
    command += ["--still"] * job["still"]
    command += [word for setting in settings for word in ("--set", setting)]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(job["stack"].parent / job["preset"])}
    run = subprocess.run(command, capture_output=True, text=True, env=environment)
    if run.returncode:
        raise click.ClickException(f"{job['preset']} on {job['stack'].stem}: {run.stderr.strip()[-300:]}")
    return json.loads(run.stdout)


def first_events(jobs: list[Row], settings: tuple[str, ...]) -> list[Row]:
    """Seconds from the import to the first events, with nothing compiled and with everything compiled."""
    found = []
    for preset in dict.fromkeys(job["preset"] for job in jobs):
        job = jobs[0] | {"preset": preset, "still": False}
        compiled_s, cached_s = (in_own_process(job, settings, 0)["first_s"] for _ in range(2))
        found.append({"preset": preset, "compiled_s": compiled_s, "cached_s": cached_s})
    return found


def in_rounds(jobs: list[Row], rounds: int, settings: tuple[str, ...], seconds: float) -> list[Row]:
    """Measure all jobs in turn, `rounds` times."""
    rows = []
    with click.progressbar(length=rounds * len(jobs), file=sys.stderr) as bar:
        for number, job in itertools.product(range(rounds), jobs):
            rows.append(in_own_process(job, settings, seconds) | {"round": number})
            bar.update(1)
    return rows


def summarise(rows: list[Row]) -> list[Row]:
    """Medians over the rounds, also of what takes two measurements: cost of an event, gain by threads."""
    by_job: dict[tuple, dict[int, Row]] = {}
    for row in rows:
        by_job.setdefault(job_of(row), {})[row["round"]] = row
    fewest = min(row["threads"] for row in rows)
    for row in rows:
        still = by_job[job_of(row | {"still": True})][row["round"]]
        fewer = by_job[job_of(row | {"threads": fewest})][row["round"]]
        events = row["ev_px_frame"] - still["ev_px_frame"]
        row["ns_event"] = (row["ns_px"] - still["ns_px"]) / events if events > 0.001 else None
        row["gain"] = fewer["ns_px"] / row["ns_px"]
        row["copies"] = row["ns_px"] / row["copy_ns_px"]
    medians = []
    for rounds in by_job.values():
        quiet = [row for row in rounds.values() if row["foreign_cores"] < QUIET_CORES]
        kept = quiet or list(rounds.values())
        median = {
            key: statistics.median(values) for key in COLUMNS if None not in (values := [row[key] for row in kept])
        }
        medians.append(kept[0] | median | {"rounds": len(kept), "noisy": not quiet})
    return medians


def job_of(row: Row) -> tuple:
    """What was measured."""
    return tuple(row[key] for key in ("size", "clip", "preset", "still", "threads"))


COLUMNS = {
    "ns_px": ("ns / pixel", ".2f"),
    "copies": ("x plane copy", ".1f"),
    "ns_event": ("ns / event", ".0f"),
    "mpix_s": ("Mpix/s", ".0f"),
    "mev_s": ("Mev/s", ".1f"),
    "ev_px_frame": ("events / pixel / frame", ".4f"),
    "gain": ("gain by threads", ".2f"),
    "copy_ns_px": ("plane copy, ns / pixel", ".3f"),
    "rss_mib": ("peak RSS, MiB", ".0f"),
    "rss_delta_mib": ("of it the sensor's", ".0f"),
}


def markdown(medians: list[Row], first: list[Row]) -> str:
    """Two tables: the medians, and the seconds to the first events."""
    titles = ["size", "frames", "preset", "threads", *(title for title, _ in COLUMNS.values()), "rounds"]
    lines = [titles, ["---"] * len(titles)]
    for row in medians:
        numbers = ["-" if row[key] is None else format(row[key], form) for key, (_, form) in COLUMNS.items()]
        frames = f"{row['clip']}, still" if row["still"] else row["clip"]
        rounds = f"{row['rounds']}{'*' * row['noisy']}"
        lines.append([row["size"], frames, row["preset"], str(row["threads"]), *numbers, rounds])
    lines += [[], ["preset", "first events, compiled anew [s]", "from the cache [s]"], ["---"] * 3]
    lines += [[row["preset"], f"{row['compiled_s']:.1f}", f"{row['cached_s']:.2f}"] for row in first]
    return "\n".join(f"| {' | '.join(line)} |" if line else "" for line in lines)


def write_stacks(folder: Path, sizes: Iterable[str], count: int, clip: Path | None) -> list[Path]:
    """`pan_WxH.npy`, and `video_WxH.npy` if there is a clip, for each size."""
    stacks = []
    for size in sizes:
        if not re.fullmatch(r"[1-9]\d*x[1-9]\d*", size):
            raise click.UsageError(f"Size '{size}' is not WIDTHxHEIGHT; write for example 640x480.")
        width, height = (int(word) for word in size.split("x"))
        stacks.append(folder / f"pan_{size}.npy")
        np.save(stacks[-1], pan(count, width, height))
        if clip is not None:
            stacks.append(folder / f"video_{size}.npy")
            np.save(stacks[-1], video(count, width, height, clip))
    return stacks


@click.command(help=__doc__.split("\n\n")[0] if __doc__ else None)
@click.option("--preset", "presets", multiple=True, type=click.Choice(list(PRESETS)), help="Default: all.")
@click.option("--size", "sizes", multiple=True, default=SIZES, show_default=True, help="WIDTHxHEIGHT.")
@click.option("--threads", "threads", multiple=True, type=click.IntRange(1), default=(1, 2), show_default=True)
@click.option("--at-once", type=click.IntRange(1), default=AT_ONCE, show_default=True, help="Frames given together.")
@click.option("--clip", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="Clip for `video`.")
@click.option("--count", type=click.IntRange(10), default=200, show_default=True, help="Frames of a stack.")
@click.option("--rounds", type=click.IntRange(1), default=3, show_default=True)
@click.option("--seconds", type=float, default=1.0, show_default=True, help="Length of one measurement.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change the sensors.")
@click.option("--frames", type=click.Path(exists=True, dir_okay=False, path_type=Path), help="Measure this .npy once.")
@click.option("--still", is_flag=True, help="With --frames: its first frame all the time.")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of tables.")
def main(presets, sizes, threads, at_once, clip, count, rounds, seconds, settings, frames, still, as_json) -> None:
    if frames is not None:
        row = measure(frames, presets[0] if presets else "ideal", settings, threads[0], still, seconds, at_once)
        click.echo(json.dumps(row) if as_json else "\n".join(f"{key:14} {value}" for key, value in row.items()))
        return
    with tempfile.TemporaryDirectory() as folder:
        stacks = write_stacks(Path(folder), sizes, count, clip)
        combinations = itertools.product(stacks, presets or PRESETS, (True, False), threads)
        names = ("stack", "preset", "still", "threads")
        jobs = [dict(zip(names, job, strict=True)) | {"at_once": at_once} for job in combinations]
        first = first_events(jobs, settings)
        medians = summarise(in_rounds(jobs, rounds, settings, seconds))
    found = {"speed": medians, "first_events": first}
    click.echo(json.dumps(found, indent=1) if as_json else markdown(medians, first))


if __name__ == "__main__":
    main()
