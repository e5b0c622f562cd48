#!/usr/bin/env python3
"""Long clips and large ones: memory stays as it was, and times are exact to the end.

    python examples/soak.py                        24 hours of 32x24 pixels at 1 fps, and 60 frames of 3840x2160
    python examples/soak.py --clip day             one of them
    python examples/soak.py --hours 240 --fps 5    a longer day

Each clip is converted in a process of its own.  Memory in use is looked at with every hundredth of the clip: the most
in its second half may not be more than 24 MB above the most in the fifth before it, when all buffers have grown.
In the file of events, the instant of every frame must be that of k / fps to the microsecond, and each event in the gap
between two frames that the counts of the frames say.  The exit code is 1 if that is not so.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import click
import numpy as np

GROWN_MB = 24  # more than what an allocator keeps for itself, less than a leak of 100 bytes a frame
PROGRAM = "import sys; sys.path.insert(0, sys.argv[1]); import soak; soak.convert_it(*sys.argv[2:])"


def in_use_mb() -> float:
    """Memory of this process that is in use."""
    return int(re.findall(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[0]) / 1024


def convert_it(clip: str, out: str) -> None:
    """Convert, and print what was seen, as JSON."""
    from vid2ev import convert

    samples: list[float] = []

    def report(recipe: Any, done: Any) -> None:
        if done.frames * 100 // recipe.source.frames_expected > len(samples):
            samples.append(in_use_mb())

    began = time.monotonic()
    options = {"threads": 1, "preview": False, "upsample": "none", "formats": ["hdf5"]}
    convert(clip, out, "ideal", report=report, **options)
    print(json.dumps({"seconds": time.monotonic() - began, "samples": samples}))


def times_are_exact(path: Path, fps: Fraction, frames: int) -> int:
    """How many events there are, all in the gaps that they are counted in.  Raises ClickException."""
    import h5py
    import hdf5plugin  # noqa: F401  (registers the filters)

    with h5py.File(path) as file:
        found, counts, t = file["frames/t"][:], file["frames/to_idx"][:].astype(np.int64), file["events/t"][:]
    # (nanoseconds are rounded to the nearest, microseconds are cut, as everywhere)
    k = np.arange(frames, dtype=object)
    wanted = [(2 * int(n) * fps.denominator * 10**9 + fps.numerator) // (2 * fps.numerator) // 1000 for n in k]
    if len(found) != frames or found.tolist() != wanted:
        raise click.ClickException(
            f"{path}: {len(found)} frames up to {found[-1]} us, expected {frames} to {wanted[-1]}"
        )
    edges = np.repeat(found[1:], np.diff(counts)), np.repeat(found[:-1], np.diff(counts))
    if counts[-1] != len(t) or np.any(t > edges[0]) or np.any(t <= edges[1]) or np.any(np.diff(t.astype(np.int64)) < 0):
        raise click.ClickException(f"{path}: events outside of the gaps that they are counted in")
    return len(t)


def frames_in(fps: float, seconds: float) -> int:
    """How many frames there are up to an instant."""
    return int(Fraction(str(seconds)) * Fraction(str(fps))) + 1


def soak(title: str, clip: str, fps: float, seconds: float) -> bool:
    """Convert a clip and print a line of the table; whether memory stayed."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", PROGRAM, str(Path(__file__).parent), clip, f"{folder}/out"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise click.ClickException(done.stderr[-2000:])
        said = json.loads(done.stdout)
        frames = frames_in(fps, seconds)
        events = times_are_exact(Path(folder) / "out" / "events.h5", Fraction(str(fps)), frames)
    samples = said["samples"]
    before, after = max(samples[len(samples) * 3 // 10 : len(samples) // 2]), max(samples[len(samples) // 2 :])
    flat = after - before <= GROWN_MB
    verdict = "exact" if flat else "exact, but memory grew"
    click.echo(
        f"| {title} | {frames:,} | {events:,} | {said['seconds']:.0f} | {before:.0f} | {after:.0f} | {verdict} |",
    )
    return flat


@click.command(help="Convert a long clip and a large one; print memory and whether times are exact.")
@click.option("--clip", "chosen", type=click.Choice(["day", "4k", "all"]), default="all", show_default=True)
@click.option("--hours", default=24.0, show_default=True, help="Of the long clip.")
@click.option("--fps", default=1.0, show_default=True, help="Of the long clip.")
@click.option("--frames", default=60, show_default=True, help="Of the large clip.")
def main(chosen: str, hours: float, fps: float, frames: int) -> None:
    """Convert, then print a table."""
    click.echo(
        "| clip | frames | events | s | MB, 30 to 50 % | MB, 50 to 100 % | times |\n|---|--:|--:|--:|--:|--:|---|"
    )
    flat = True
    if chosen != "4k":
        seconds = hours * 3600
        clip = f"synthetic:sine,size=32x24,fps={fps},duration_s={seconds},frequency_hz=0.01"
        flat &= soak(f"{hours:g} h of 32x24 at {fps:g} fps", clip, fps, seconds)
    if chosen != "day":
        seconds = round((frames - 1) / 60 + 1e-6, 6)  # (not before the last frame)
        clip = f"synthetic:moving-edge,size=3840x2160,fps=60,duration_s={seconds}"
        flat &= soak("3840x2160 at 60 fps", clip, 60, seconds)
    sys.exit(0 if flat else 1)


if __name__ == "__main__":
    main()
