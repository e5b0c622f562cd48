"""The folder of a training run: all that it needs to go on, and all that it has to show.

    run.json              what is trained, with what, how; versions, machine
    steps.json            how many steps, once that is known
    checkpoint.ckpt       where training goes on
    weights.safetensors   the running mean of the network, for use (`interp.networks`)
    baselines.json        scores of methods that need no training
    training.csv          loss, its parts, learning rate, speed
    validation.csv        scores of the running mean
    pictures/             inputs, prediction, truth
    tensorboard/          the curves and pictures again
    clips/                a cache: what is missing there is made again

No path stands in it, so it can be carried anywhere.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.disk import lock, whole_file, writing
from vid2ev.recording.manifest import difference, machine, versions

LIBRARIES = ("torch", "lightning")


class RunFolder:
    """A run's folder, open for one process until it is closed.

    job   what decides the result, for JSON
    Raises UsageError where the folder is taken, or was begun with another job.
    """

    def __init__(self, path: Path, job: Mapping[str, Any], resume: bool, first: bool = True):
        self.path, self.first = path, first
        job = json.loads(json.dumps(job))
        if not first:  # (the process that leads has looked, and holds the folder)
            return
        self._check(job, resume)
        with writing(path, "make room or access there, or choose another folder with -o"):
            path.mkdir(parents=True, exist_ok=True)
            self._lock: int | None = lock(path)
            if not resume:
                self._write("run.json", {"job": job, "versions": versions(LIBRARIES), "machine": machine()})

    def forget_clips(self) -> None:
        """Remove them when training is done."""
        if self.first:
            shutil.rmtree(self.clips, ignore_errors=True)

    def close(self) -> None:
        """Let others at it."""
        if self.first and self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @property
    def checkpoint(self) -> Path:
        """Where training goes on."""
        return self.path / "checkpoint.ckpt"

    @property
    def weights(self) -> Path:
        """The network, for use."""
        return self.path / "weights.safetensors"

    @property
    def clips(self) -> Path:
        """A cache: what is missing there is made again."""
        return self.path / "clips"

    @property
    def pictures(self) -> Path:
        """The folder of pictures."""
        return self.path / "pictures"

    def fixed(self) -> tuple[int, int] | None:
        """(steps, level) of the schedule, once they are known."""
        file = self.path / "steps.json"
        if not file.exists():
            return None
        found = read_json(file)
        return int(found["steps"]), int(found["level"])

    def fix(self, steps: int, level: int) -> None:
        """Write them down, once and for all."""
        if self.first:
            self._write("steps.json", {"steps": steps, "level": level})

    def baselines(self) -> dict[str, dict[str, dict[str, float]]]:
        """Scores of methods without training: method, group of clips, score; empty until they are measured."""
        file = self.path / "baselines.json"
        return read_json(file) if file.exists() else {}

    def write_baselines(self, tables: Mapping[str, Any]) -> None:
        """Keep them."""
        self._write("baselines.json", tables)

    def _check(self, job: Mapping[str, Any], resume: bool) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise UsageError(f"{self.path} is a file; choose a folder with -o")
        begun = (self.path / "run.json").exists()
        if not resume:
            if begun:
                raise UsageError(f"{self.path} holds a run; --resume goes on with it, -o chooses another folder")
            if self.path.is_dir() and any(child.name != "lock" for child in self.path.iterdir()):
                raise UsageError(f"{self.path} holds files that are no run; choose another folder with -o")
            return
        changed = difference(begun_job(self.path), job)
        if changed:
            raise UsageError(
                f"{self.path} was begun with {changed}; --resume needs what it was begun with, -o starts another run"
            )

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        with whole_file(self.path / name) as file:
            file.write((json.dumps(content, indent=2) + "\n").encode())


def begun_job(path: Path) -> dict[str, Any]:
    """The job of a run that was begun; raises UsageError if there is none."""
    if not (path / "run.json").exists():
        raise UsageError(f"{path} holds no run to go on with; leave --resume out, or name the run's folder with -o")
    return read_json(path / "run.json")["job"]


def read_json(path: Path) -> dict[str, Any]:
    """A file of a run; raises DataError where it cannot be read."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"{path} cannot be read as JSON ({error}); copy the run again, or start another") from error
    return found
