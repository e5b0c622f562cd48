#!/usr/bin/env python3
"""The presets v2e-clean and v2e-noisy against v2e's own model, law by law.

    python examples/against_v2e.py                                        the laws, and what is measured here
    python examples/against_v2e.py --v2e CHECKOUT --v2e-python PYTHON     v2e itself beside it

Each scene is made for one law and given in v2e's units, codes I of 0 to 255 that count as they are.  Both simulators
see the same frames at the same instants, and the same lines measure what they send.  The laws are those of v2e (Hu,
Liu, Delbruck, *v2e: From Video Frames to Realistic DVS Events*, CVPR Workshops 2021), as its functions have them at
commit cac6384 of https://github.com/SensorsINI/v2e.  Where vid2ev's is another on purpose, the row gives that, too.
After ± is one standard error: of the statistics, or of what a threshold or a microsecond resolves.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np

from vid2ev import Dvs, Events, load_sensor
from vid2ev.physics.shot import shot_share

FAINT = 1e-9  # as good as none, and few kernels to compile
NOISY = load_sensor("v2e-noisy")
FINE = 0.01  # nat; v2e has no lower threshold
OURS = {  # v2e's names of what is changed in a preset: our name, and our unit
    "pos_thres": ("threshold_on", 1.0),
    "sigma_thres": ("mismatch", 1.0),
    "shot_noise_rate_hz": ("shot_rate_hz", 1.0),
    "refractory_period_s": ("refractory_us", 1e6),
}
V2E_SIDE = """
import json, logging, numpy as np, sys
logging.disable(logging.CRITICAL)
sys.path.insert(0, sys.argv[1])
answers, sys.stdout = sys.stdout, sys.stderr
from v2ecore.emulator import EventEmulator
for line in sys.stdin:
    job = json.loads(line)
    emulator = EventEmulator(seed=1, device="cpu")
    emulator.set_dvs_params(job["preset"])
    vars(emulator).update(job["changes"])
    frames = zip(job["t_us"], np.load(job["folder"] + "/codes.npy"))
    sent = [emulator.generate_events(np.repeat(codes[None], job["rows"], 0), t_us * 1e-6) for t_us, codes in frames]
    np.save(job["folder"] + "/events.npy", np.concatenate([np.zeros((0, 4)), *(e for e in sent if e is not None)]))
    print("done", file=answers, flush=True)
"""


class Scene(NamedTuple):
    """Frames, int64 [N] and float64 [N, columns]: a code for each column, which all rows repeat."""

    t_us: np.ndarray
    codes: np.ndarray
    rows: int = 1


class Measured(NamedTuple):
    """What v2e's law says for a case, what was found, its standard error, and our law's value where that is another."""

    case: str
    unit: str
    expected: float
    value: float
    error: float
    ours: float | None = None


Simulator = Callable[[str, dict[str, float], Scene], Events]


def vid2ev_side(preset: str, changes: dict[str, float], scene: Scene) -> Events:
    """The preset of vid2ev, with changes that have v2e's names."""
    named = [(*OURS.get(name, (name, 1.0)), value) for name, value in changes.items()]
    settings = [f"{name}={value * unit!r}" for name, unit, value in named]
    dvs = Dvs(load_sensor(f"v2e-{preset}", settings), (scene.codes.shape[1], scene.rows), seed=1)
    frames = (np.repeat(codes[None] / 255, scene.rows, 0).astype(np.float32) for codes in scene.codes)
    return Events.concatenate([dvs.step(light, int(t) * 1000) for t, light in zip(scene.t_us, frames, strict=True)])


@contextmanager
def v2e_side(checkout: Path, python: str) -> Iterator[Simulator]:
    """v2e's emulator, in one process for all scenes."""
    command, pipe = [python, "-c", V2E_SIDE, str(checkout)], subprocess.PIPE
    with tempfile.TemporaryDirectory() as folder, subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as v2e:

        def run(preset: str, changes: dict[str, float], scene: Scene) -> Events:
            job = {"preset": preset, "changes": changes, "t_us": scene.t_us.tolist(), "rows": scene.rows}
            np.save(f"{folder}/codes.npy", scene.codes)
            with suppress(BrokenPipeError):
                print(json.dumps({**job, "folder": folder}), file=v2e.stdin, flush=True)
            if not v2e.stdout.readline():
                raise click.ClickException(f"{python} cannot run v2e of {checkout}; what it says is above.")
            t, x, y, p = np.load(f"{folder}/events.npy").astype(np.float64).T
            return Events(np.rint(t * 1e6).astype(np.int64), *(part.astype(np.int64) for part in (x, y, p > 0)))

        yield run


def counts(sent: Events, scene: Scene) -> np.ndarray:
    """Events of each pixel, [rows, columns]."""
    found = np.zeros((scene.rows, scene.codes.shape[1]), np.int64)
    np.add.at(found, (sent.y, sent.x), 1)
    return found


def level(code: float) -> float:
    """v2e's lin-log [nat]."""
    return code * math.log(20) / 20 if code <= 20 else math.log(code)


def own_thresholds(floor: float) -> np.ndarray:
    """The mean threshold over that of each of many pixels, spread as `noisy` has it, none below a floor [nat]."""
    return 0.2 / np.maximum(np.random.default_rng(0).normal(0.2, 0.05, 1_000_000), floor)


def log_curve(run: Simulator) -> Iterator[Measured]:
    """From black to a code: as many events as thresholds fit into its level."""
    codes = np.array([5.0, 20.0, 60.0, 255.0])
    scene = Scene(np.arange(101) * 1000, np.linspace(0, 1, 101)[:, None] * codes)
    found = counts(run("clean", {"sigma_thres": FAINT, "pos_thres": FINE}, scene), scene)[0]
    for code, n in zip(codes, found, strict=True):
        yield Measured(f"I = {code:g}", "nat", level(code), (n + 0.5) * FINE, FINE / math.sqrt(12))


def thresholds(run: Simulator) -> Iterator[Measured]:
    """On a ramp of the logarithm, 1 nat/s, the first event of each pixel tells its threshold."""
    for preset, sigma in (("clean", 0.02), ("noisy", 0.05)):
        for way, name in ((1, "ON"), (-1, "OFF")):
            t_us, theta = np.arange(501) * 1000, np.zeros((64, 64))
            scene = Scene(t_us, np.tile(130 * np.exp(way * t_us[:, None] * 1e-6), (1, 64)), 64)
            sent = run("clean", {"sigma_thres": sigma}, scene)
            theta[sent.y[::-1], sent.x[::-1]] = sent.t[::-1] * 1e-6  # the first of a pixel is what stays
            yield Measured(f"{preset}, {name}: mean", "nat", 0.2, theta.mean(), sigma / 64)
            yield Measured(f"{preset}, {name}: spread", "nat", sigma, theta.std(), sigma / 64 / math.sqrt(2))


def bandwidth(run: Simulator) -> Iterator[Measured]:
    """After a step the level relaxes: when its events come tells the time constant."""
    faint = {"sigma_thres": FAINT, "leak_rate_hz": FAINT, "shot_noise_rate_hz": FAINT, "pos_thres": FINE}
    for code in (20.0, 117.5, 255.0):
        scene = Scene(np.arange(801) * 100, np.repeat([[code / 1.5], [code]], [1, 800], axis=0))
        t_s = run("noisy", faint, scene).t * 1e-6
        share = np.arange(1, len(t_s) + 1) * FINE / (level(code) - level(code / 1.5))
        mid, law = (share > 0.1) & (share < 0.7), 30 * (code + 20) / 275
        (slope, _), spread = np.polyfit(t_s[mid], np.log(1 - share[mid]), 1, cov=True)
        error = max(math.sqrt(spread[0, 0]) / (2 * math.pi), 1e-4 * law)
        yield Measured(f"I = {code:g}, frames of 0.1 ms: bandwidth", "Hz", law, -slope / (2 * math.pi), error)
    for dt_ms in (1, 10):
        scene = Scene(np.array([0, 1, 1 + 1000 * dt_ms]), np.array([[20.0], [255.0], [255.0]]))
        share = FINE / math.log(12.75)  # of the step that an event stands for
        found, law = (len(run("noisy", faint, scene)) + 0.5) * share, -math.expm1(-2 * math.pi * 0.03 * dt_ms)
        yield Measured(f"share of a step to I = 255 after one frame of {dt_ms} ms", "", law, found, share / 12**0.5)


def leak(run: Simulator) -> Iterator[Measured]:
    """At rest for 100 s each pixel sends ON events, as far apart as its leak makes them."""
    scene = Scene(np.arange(1001) * 100_000, np.full((1001, 64), 128.0), 64)
    sent, last = run("noisy", {"shot_noise_rate_hz": FAINT}, scene), np.ones((64, 64))
    last[sent.y, sent.x] = sent.t * 1e-6
    rate = counts(sent, scene) / last
    variance, own = (0.1 * math.log(10)) ** 2, own_thresholds(0.02)
    mean, error, spread = rate.mean(), rate.std() / math.sqrt(rate.size), rate.std() / rate.mean()
    yield Measured("mean", "Hz", 0.1 * math.exp(variance / 2), mean, error, NOISY.leak_rate_hz * own.mean())
    law, ours = math.sqrt(math.expm1(variance)), own.std() / own.mean()
    yield Measured("spread over mean", "", law, spread, 2 * error / mean, ours)


def shot(run: Simulator) -> Iterator[Measured]:
    """At rest for 5 s nearly all that `noisy` sends is shot noise."""
    codes, own = np.array([0.0, 64.0, 128.0, 255.0]), own_thresholds(0.01).mean()
    scene = Scene(np.arange(501) * 10_000, np.tile(np.repeat(codes, 16), (501, 1)), 256)
    rates = counts(run("noisy", {}, scene), scene).reshape(256, 4, 16).transpose(1, 0, 2) / 5
    for code, rate in zip(codes, rates, strict=True):
        law = 5 * (1 - 0.75 * (code + 20) / 275) * own
        ours = NOISY.shot_rate_hz * shot_share(code / 255, NOISY.shot_light_factor)
        yield Measured(f"I = {code:g}", "Hz", law, rate.mean(), rate.std() / math.sqrt(rate.size), ours)


def refractory(run: Simulator) -> Iterator[Measured]:
    """20 crossings, one each 0.1 ms, and a refractory period of 0.45 ms."""
    t_us = np.concatenate([np.arange(0, 2050, 50), np.arange(2500, 30_000, 500)])
    changes = {"sigma_thres": FAINT, "pos_thres": 0.1, "refractory_period_s": 0.00045}
    sent = run("clean", changes, Scene(t_us, 30 * np.exp(np.minimum(t_us, 2050)[:, None] * 1e-3)))
    yield Measured("of 20 crossings in 2 ms, sent", "", 4, len(sent), 0.1)
    yield Measured("the last at", "ms", 1.6, sent.t[-1] * 1e-3, 0.001)


def signal(run: Simulator) -> Iterator[Measured]:
    """Eight pixels that brighten by 0.3 to 2.5 nat/s, in frames of 33 ms."""
    t_us, rise = np.arange(31) * 1_000_000 // 30, 2.5 * np.arange(1, 9) / 8
    sent = run("clean", {"sigma_thres": FAINT}, Scene(t_us, 20.5 * np.exp(t_us[:, None] * 1e-6 * rise)))
    sent = sent.select(np.lexsort((sent.t, sent.x)))
    number = np.arange(len(sent)) - np.searchsorted(sent.x, sent.x) + 1
    late_ms = sent.t * 1e-3 - number * 200 / rise[sent.x]
    yield Measured("events", "", float((rise // 0.2).sum()), len(sent), 0.1)
    yield Measured("error of their times, rms", "ms", 0, math.sqrt((late_ms**2).mean()), 0.001)


LAWS = {
    "level: `I ln(20)/20` up to I = 20, `ln I` above": log_curve,
    "thresholds: normal, frozen": thresholds,
    "low-pass: one pole, `f = cutoff_hz (I + 20)/275`": bandwidth,
    "leak: `leak_rate_hz`, lognormal from pixel to pixel": leak,
    "shot noise: `shot_noise_rate_hz (1 - 0.75 (I + 20)/275)`, times mean over own threshold": shot,
    "refractory period: crossings within it are ignored": refractory,
    "signal: an event at each crossing": signal,
}


def shown(value: float, error: float) -> str:
    """A value with as many digits as its error asks for."""
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{digits}f} ± {error:.{digits}f}"


@click.command(help="Compare the presets v2e-clean and v2e-noisy with v2e's laws, and with v2e itself.")
@click.option("--v2e", "checkout", type=click.Path(exists=True, file_okay=False, path_type=Path), help="Its checkout.")
@click.option(
    "--v2e-python", "python", default=sys.executable, help="Interpreter that imports it.  [default: this one]"
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")
def main(checkout: Path | None, python: str, as_json: bool) -> None:
    """Measure, then print."""
    rows = [(law, row) for law, measure in LAWS.items() for row in measure(vid2ev_side)]
    beside: list = [None] * len(rows)
    if checkout:
        with v2e_side(checkout, python) as run:
            beside = [row[3:5] for measure in LAWS.values() for row in measure(run)]
    if as_json:
        found = [{"law": law, **row._asdict(), "v2e": v2e} for (law, row), v2e in zip(rows, beside, strict=True)]
        return click.echo(json.dumps(found, indent=1))
    click.echo("| law | case | v2e's law | vid2ev's | vid2ev | v2e |\n|---|---|---:|---:|---:|---:|")
    for k, ((law, row), v2e) in enumerate(zip(rows, beside, strict=True)):
        own = "same" if row.ours is None else f"{row.ours:.4g}"
        cells = [f"{row.expected:.4g} {row.unit}".strip(), own, shown(row.value, row.error), shown(*v2e) if v2e else ""]
        click.echo(f"| {'' if k and rows[k - 1][0] == law else law} | {row.case} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
