#!/usr/bin/env python3
"""kill -9, over and over: whatever is killed leaves the old state or the new, and goes on to the same bytes.

    python examples/kills.py                          five kills of each command
    python examples/kills.py --kills 200              as in vid2ev/README.md
    python examples/kills.py --command convert --kills 1000 --seed 3

Each command does a small job, again and again, in processes that are killed: half of them after a time that is drawn,
half at a thing that lasts (a file brought to the disk, renamed or removed), of which one is drawn.  Now and then the
disk is full instead, from a number of bytes on that is drawn: that must end with one sentence.  After each kill
the output must be absent, or the one that was there before, or whole; for train and eval, which keep what is done in
their folder, what is there of the result must be whole.  Half a line or a few bytes are then put at the end of files
that grow, as a machine that stops leaves them.  What goes on is killed again, or ends, and then every byte must be that
of an undisturbed run (of training: weights, and all that it goes on from).  The exit code is 1 if one is not.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

HERE = Path(__file__).resolve().parent
FULL = 3  # the exit code of what a full disk ended with a sentence
TORN = b'{"group": 7, "ro'
MADE = ("manifest.json", "frames.json")  # what a whole output has
LASTING = ((os, "fsync"), (shutil, "rmtree"), *((Path, name) for name in ("rename", "replace", "unlink")))
OF_TRAINING = ("weights", "steps.json")  # curves and pictures of a validation that is killed are not made up for


def child(work: Callable[[], object], killed_at: int = 0, counts: Path | None = None, room: int = 0) -> int:
    """Work in a process of its own, which is killed at the n-th thing that lasts; how many there were goes to a file.

    room   bytes that a file may have, as on a disk that is full beyond them; 0: as many as there are
    """
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        return pid
    steps = [0]

    def counted(function: Any) -> Any:
        def count(*arguments: Any, **options: Any) -> Any:
            steps[0] += 1
            if steps[0] == killed_at:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*arguments, **options)

        return count

    code = 1
    try:
        if room:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
        for owner, name in LASTING:
            setattr(owner, name, counted(getattr(owner, name)))
        work()
        code = 0
        if counts:
            with open(counts, "w") as file:
                file.write(f"{steps[0]}")
    except BaseException as error:
        from vid2ev.errors import DataError

        sentence = isinstance(error, DataError) and "\n" not in str(error)
        code = FULL if room and sentence else 1
        if code == 1:
            traceback.print_exc()
    finally:
        os._exit(code)


class Kills:
    """Kills of one command in a folder."""

    def __init__(self, name: str, folder: Path, chance: random.Random):
        from hostile.jobs import JOBS, contents

        self.name, self.job, self.folder, self.chance = name, JOBS[name], folder, chance
        self.out, self.contents = folder / "out", contents
        self.counts: Counter[str] = Counter()
        self.job.prepare(folder)
        self.job.make(folder, self.out, False)  # (once for what is compiled, and then for the time it takes)
        shutil.rmtree(self.out)
        began = time.monotonic()
        pid = child(lambda: self.job.make(folder, self.out, False), counts=folder / "steps")
        assert os.waitpid(pid, 0)[1] == 0
        self.seconds = time.monotonic() - began
        self.steps = int((folder / "steps").read_text())
        self.whole = self.seen()
        self.largest = max(path.stat().st_size for path in self.out.rglob("*") if path.is_file())
        shutil.rmtree(self.out)
        self.old: dict[str, bytes] | None = None
        if self.job.old:
            self.job.old(folder, self.out)
            self.old = self.seen()
            shutil.move(self.out, folder / "old")

    def seen(self) -> dict[str, bytes]:
        """What is in the output, that lasts."""
        found = self.contents(self.out)
        if self.name != "train":
            return found
        import torch

        kept = torch.load(self.out / "checkpoint.ckpt", weights_only=True)
        numbers = {key: kept[key] for key in ("global_step", "state_dict", "optimizer_states", "current_model_state")}
        kept_files = {key: value for key, value in found.items() if key.startswith(OF_TRAINING)}
        return kept_files | {"checkpoint": repr(_plain(numbers)).encode()}

    def run(self, kills: int) -> None:
        """Kill so many times, and compare each time that it ends."""
        with_old, begun = False, False
        while self.counts["kills"] < kills or begun:
            if not begun:
                with_old = self.old is not None and self.chance.random() < 0.3
                if with_old:
                    shutil.copytree(self.folder / "old", self.out)
            more = self.counts["kills"] < kills
            way = self.chance.choice(("clock", "clock", "step", "step", "full")) if more else ""
            at = self.chance.randrange(1, self.steps + 1) if way == "step" else 0
            room = self.chance.randrange(1, self.largest) if way == "full" else 0
            pid = child(partial(self.job.make, self.folder, self.out, begun), at, room=room)
            if way == "clock":
                time.sleep(self.chance.uniform(0, 1.1 * self.seconds))
                os.kill(pid, signal.SIGKILL)
            status = os.waitpid(pid, 0)[1]
            full = os.WIFEXITED(status) and os.WEXITSTATUS(status) == FULL
            if os.WIFSIGNALED(status) or full:
                self.counts["full disks" if full else "kills"] += 1
                self._look(with_old)
                self._tear()
                begun = True
                continue
            if status or self.seen() != self.whole:
                self.counts["wrong"] += 1
                self._say("ended with an error" if status else "other bytes", self.seen() if not status else {})
            self.counts["ended"] += 1
            begun = False
            self._clear()

    def _look(self, with_old: bool) -> None:
        """What is there after a kill."""
        if self.name in ("train", "eval") or not self.out.exists():
            absent = with_old and not self.out.exists()
        else:
            found = self.seen()
            absent = found not in (self.whole, self.old if with_old else self.whole)
        if absent:
            self.counts["wrong"] += 1
            self._say("after a kill, neither the old output nor the new is there", {})

    def _say(self, what: str, found: dict[str, bytes]) -> None:
        names = sorted(key for key in self.whole | found if self.whole.get(key) != found.get(key))
        click.echo(f"{self.name}, kill {self.counts['kills']}: {what} {names[:4]}", err=True)

    def _tear(self) -> None:
        """Put half a line at the end of a file that grows; not of one that was brought to the disk with all beside."""
        places = [self.out, self.folder / "out.partial"]
        found = [file for place in places for name in self.job.growing for file in place.rglob(name)]
        growing = [file for file in found if not any((at / name).exists() for at in file.parents for name in MADE)]
        done = any((self.out / name).exists() for name in (*MADE, "report.md"))
        if growing and not done and self.chance.random() < 0.5:
            with open(self.chance.choice(sorted(growing)), "ab") as file:
                file.write(TORN[: self.chance.randrange(1, len(TORN))])
            self.counts["torn"] += 1

    def _clear(self) -> None:
        for path in self.folder.iterdir():
            if path.name.startswith("out"):
                shutil.rmtree(path)


def _plain(node: Any) -> Any:
    """Tensors as their bytes, so that all can be compared."""
    if isinstance(node, dict):
        return {key: _plain(value) for key, value in node.items()}
    if isinstance(node, list | tuple):
        return [_plain(value) for value in node]
    return node.numpy().tobytes() if hasattr(node, "numpy") else node


@click.command(help="Kill commands, and compare what they end with.")
@click.option("--command", "names", multiple=True, help="One of them; may be given again.  [default: all]")
@click.option("--kills", default=5, show_default=True, help="How many of each.")
@click.option("--seed", default=0, show_default=True, help="Of where they are killed.")
def main(names: tuple[str, ...], kills: int, seed: int) -> None:
    """Kill, then print a table."""
    sys.path[:0] = [str(HERE), str(HERE.parent)]
    from hostile.jobs import JOBS, ready

    if unknown := set(names) - set(JOBS):
        raise click.UsageError(f"unknown: {', '.join(sorted(unknown))}; expected some of {', '.join(JOBS)}")
    ready()
    wrong = 0
    click.echo("| command | kills | full disks | torn files | ended | wrong | s |\n|---|--:|--:|--:|--:|--:|--:|")
    for name in names or JOBS:
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            one = Kills(name, Path(folder), random.Random(f"{seed} {name}"))
            one.run(kills)
        counts = one.counts
        wrong += counts["wrong"]
        told = " | ".join(str(counts[key]) for key in ("kills", "full disks", "torn", "ended", "wrong"))
        click.echo(f"| {name} | {told} | {time.monotonic() - began:.0f} |")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
