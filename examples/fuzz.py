#!/usr/bin/env python3
"""Hostile files: changes valid files at random and reads them, over and over, for everything that reads files.

    python examples/fuzz.py                                every reader, 1000 changed files each
    python examples/fuzz.py --count 100000 --jobs 2        as in vid2ev/README.md; hours
    python examples/fuzz.py --reader meshes --keep /tmp/k  one; what offends is kept

Whatever a file holds, reading it ends, in a few seconds and within the memory that VID2EV_LARGEST_MB allows, in a valid
result or in one sentence.  Each reader runs in a process of its own; one that dies is started again behind the file
that killed it.  The last column counts what was neither read nor refused; the exit code is 1 if there is any.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click

HERE = Path(__file__).resolve().parent
GOOD = ("read", "refused")
HUNG = (-signal.SIGALRM, -signal.SIGPROF)


def run(name: str, folder: Path, first: int, count: int) -> Counter[str]:
    """How attempts at a reader ended."""
    tally: Counter[str] = Counter()
    environment = os.environ | {"PYTHONPATH": f"{HERE}{os.pathsep}{HERE.parent}", "OMP_NUM_THREADS": "1"}
    begin, stop = first, first + count
    while begin < stop:
        command = [sys.executable, "-m", "hostile.attempts", name, str(folder.parent), str(begin), str(stop - begin)]
        (folder / "tally.json").unlink(missing_ok=True)
        (folder / "current").unlink(missing_ok=True)
        with open(folder / "said", "w+b") as said:
            done = subprocess.run(command, env=environment, stdout=said, stderr=said)
            said.seek(max(said.seek(0, 2) - 6000, 0))
            end = said.read().decode(errors="replace")
        found = json.loads((folder / "tally.json").read_text()) if (folder / "tally.json").exists() else {}
        tally.update(found.get("tally", {}))
        if done.returncode == 0:
            break
        if not (folder / "current").exists():
            tally["seeds"] += 1
            _keep(folder, begin, 0, end)
            break
        number, at = (int(word) for word in (folder / "current").read_text().split())
        tally["read"] += max(number - int(found.get("next", begin)), 0)  # (or refused; they were not written down)
        tally["hung" if done.returncode in HUNG else "crashed"] += 1
        _keep(folder, number, at, f"ended with {done.returncode}\n{end}")
        begin = number + 1
    return tally


def _keep(folder: Path, number: int, at: int, trace: str) -> None:
    """Put aside the file that ended a process: the last one that was written."""
    place = folder / "offending"
    place.mkdir(exist_ok=True)
    found = [path for path in (folder / "seeds").rglob("*") if path.is_file()]
    latest = max(found, key=lambda path: path.stat().st_mtime_ns, default=None)
    name = f"{number}-killed-{latest.name if latest else 'nothing'}"
    if latest:
        shutil.copy(latest, place / name)
    (place / f"{name}.txt").write_text(trace)


@click.command(help="Read changed files, and count how that ends.")
@click.option("--reader", "names", multiple=True, help="One of the readers; may be given again.  [default: all]")
@click.option("--count", default=1000, show_default=True, help="How many changed files for each reader.")
@click.option("--first", default=0, show_default=True, help="The number of the first one.")
@click.option("--jobs", default=1, show_default=True, help="How many readers at a time.")
@click.option("--keep", type=click.Path(path_type=Path), help="Folder for offending files.  [default: none]")
@click.option("--list", "listed", is_flag=True, help="Print the names of the readers.")
def main(names: tuple[str, ...], count: int, first: int, jobs: int, keep: Path | None, listed: bool) -> None:
    """Run, then print a table."""
    sys.path[:0] = [str(HERE), str(HERE.parent)]
    from hostile.readers import READERS

    if listed:
        click.echo("\n".join(READERS))
        return
    if unknown := set(names) - set(READERS):
        raise click.UsageError(f"unknown: {', '.join(sorted(unknown))}; expected some of {', '.join(READERS)}")
    shared = Path("/dev/shm")
    bad = 0
    with (
        tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as work,
        ThreadPoolExecutor(jobs) as pool,
    ):

        def one(name: str) -> tuple[str, Counter[str], float]:
            folder = Path(work) / name
            folder.mkdir()
            began = time.monotonic()
            tally = run(name, folder, first, count)
            if keep and (folder / "offending").exists():
                shutil.copytree(folder / "offending", keep / name, dirs_exist_ok=True)
            shutil.rmtree(folder)
            return name, tally, time.monotonic() - began

        click.echo("| reader | files | read | refused | s | neither |\n|---|---:|---:|---:|---:|---|")
        for name, tally, seconds in pool.map(one, names or READERS):
            others = {kind: n for kind, n in tally.items() if kind not in GOOD}
            bad += sum(others.values())
            total = sum(tally.values()) - tally["greedy"]
            neither = ", ".join(f"{n} {kind}" for kind, n in others.items()) or "0"
            click.echo(f"| {name} | {total} | {tally['read']} | {tally['refused']} | {seconds:.0f} | {neither} |")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
