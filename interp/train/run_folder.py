"""The folder of a training run: all that it needs to go on, and all that it has to show.

    run.json              what is trained, with what, how; versions and machine, also of others that it went on with
    start*.safetensors    weights that it began with, if it did
    steps.json            how many steps, once that is known, and when that was planned
    checkpoint.ckpt       where training goes on
    weights.safetensors   the running mean of the network at its best validation, for use (`interp.networks`)
    baselines.json        scores of methods that need no training
    training.csv          loss, its parts, learning rate, speed
    validation.csv        scores of the running mean
    pictures/             inputs, prediction, truth
    tensorboard/          the curves and pictures again
    clips/                a cache: what is missing there is made again
    finished.json         how it came out, once it is done

No path stands in it but those of the data that it was given, so it can be carried to wherever these are.
"""

from __future__ import annotations

import json
import math
import operator
import re
import shutil
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

from interp.pretrained import OF_RUN
from interp.train.schedule import MOST_STEPS, Steps
from interp.train.scores import Scores
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing
from vid2ev.recording.held import Held
from vid2ev.recording.manifest import as_stated, difference, machine, versions
from vid2ev.untrusted import json_of, read_text

LIBRARIES = ("torch", "lightning")
FINISHED, WENT_ON, CLIPS = "finished.json", "went_on_with", "clips"
AGAIN = "remove it, and --resume makes it again"
LEFT = re.compile(r"lock|run\.json\.new|start\.(\w+\.)?safetensors(\.new)?")
OF_CLIPS = re.compile(r"[0-9a-f]+-\d+-\d+|validation")  # folders in it, which is removed in the end


class RunFolder:
    """A run's folder, open for one process until it is closed.

    job      what decides the result, for JSON
    starts   files of weights that it begins with, by part
    Raises UsageError where the folder is taken, or was begun with another job.
    """

    def __init__(
        self,
        path: Path,
        job: Mapping[str, Any],
        resume: bool,
        first: bool = True,
        starts: Mapping[str, Path] = MappingProxyType({}),
    ):
        self.path, self.first = path, first
        self._held = Held(path)
        job = json.loads(json.dumps(job))
        if not first:  # (the process that leads has looked, and holds the folder)
            return
        check_place(self.path, job, resume)  # (before anything is written where something else is)
        try:
            with writing(path, "make room or access there, or choose another folder with -o"):
                self._held.take()
                check_place(self.path, job, resume)  # (another may have begun there until now)
                self._begin(job, resume, starts)
        except BaseException:
            self.close()
            raise

    def finished(self) -> dict[str, Any] | None:
        """How it came out; None until it is done."""
        file = self.path / FINISHED
        try:
            return read_json(file) if file.exists() else None
        except DataError as error:
            raise DataError(f"{file} cannot be read; {AGAIN}") from error

    def check_weights(self) -> None:
        """Raise DataError where those of the best validation have been removed or damaged, which nothing makes
        again."""
        from interp.weights import about

        if not self.first:
            return
        if not self.weights.exists():
            raise DataError(f"{self.weights} is gone; put it back and --resume, or start another run with -o")
        try:
            about(self.weights)
        except DataError as error:
            raise DataError(
                f"{self.weights} is damaged; put a copy that is whole in its place and --resume, or start another run"
                " with -o"
            ) from error

    def finish(self, outcome: Mapping[str, Any]) -> None:
        """Training is done: keep how it came out, and nothing that is needed to go on only."""
        if self.first:
            self._keep(FINISHED, outcome)
        self.forget_clips()

    def forget_clips(self) -> None:
        """Remove them."""
        if self.first:
            shutil.rmtree(self.clips, ignore_errors=True)

    def give_up(self) -> None:
        """Nothing was begun: make room for another run."""
        self.forget_clips()
        if self.first:
            (self.path / "run.json").unlink(missing_ok=True)

    def close(self) -> None:
        """Let others at it."""
        self._held.close()

    @property
    def checkpoint(self) -> Path:
        """Where training goes on."""
        return self.path / "checkpoint.ckpt"

    @property
    def weights(self) -> Path:
        """The network, for use."""
        return self.path / OF_RUN

    def starts(self, parts: Iterable[str]) -> dict[str, Path]:
        """The files of weights that it begins with, by part."""
        return {part: self.path / f"{f'start.{part}'.rstrip('.')}.safetensors" for part in parts}

    @property
    def clips(self) -> Path:
        """A cache: what is missing there is made again."""
        return self.path / CLIPS

    @property
    def pictures(self) -> Path:
        """The folder of pictures."""
        return self.path / "pictures"

    def steps(self) -> Steps | None:
        """How many steps, once they are known."""
        file = self.path / "steps.json"
        if not file.exists():
            return None
        found = read_json(file)
        with as_stated(file):
            plans = tuple((operator.index(at), operator.index(steps)) for at, steps in found["plans"])
            every = operator.index(found["validate_every"])
            order = [at for at, _ in plans]
            if not plans or order != sorted(set(order)) or not 0 < every < MOST_STEPS:
                raise ValueError(f"plans {plans}, validation every {every} steps")
            if not all(0 <= at <= steps < MOST_STEPS and steps for at, steps in plans):
                raise ValueError(f"plans {plans}")
        return Steps(plans, every)

    def plan(self, steps: Steps) -> None:
        """Write them down."""
        if self.first:
            self._keep("steps.json", asdict(steps))

    def baselines(self, groups: Collection[str]) -> dict[str, dict[str, Scores]]:
        """Scores of methods without training on groups of clips; empty until they are measured.

        Raises DataError for those of other groups, as another run has them, and for what is no scores."""
        file = self.path / "baselines.json"
        if not file.exists():
            return {}
        try:
            tables = {
                method: {
                    group: Scores(**{name: _number(value) for name, value in of.items()}) for group, of in table.items()
                }
                for method, table in read_json(file).items()
            }
        except (DataError, TypeError, ValueError, AttributeError) as error:
            raise DataError(f"{file} holds no scores that can be read; {AGAIN}") from error
        for table in tables.values():
            if set(table) != set(groups):
                said, expected = (", ".join(dict.fromkeys(names))[:80] or "nothing" for names in (table, groups))
                raise DataError(f"{file} has scores of {said}, expected {expected}: it is of another run; {AGAIN}")
        return tables

    def write_baselines(self, tables: Mapping[str, Any]) -> None:
        """Keep them; null is no number, as of pixels that move where none does."""
        plain = {
            method: {
                group: {score: value if math.isfinite(value) else None for score, value in of.items()}
                for group, of in table.items()
            }
            for method, table in tables.items()
        }
        self._keep("baselines.json", plain)

    def _begin(self, job: Mapping[str, Any], resume: bool, starts: Mapping[str, Path]) -> None:
        """Clear up after a session that was killed; write down what is trained."""
        for left in self.path.rglob("*.new"):
            if self.clips not in left.parents:  # (those of another machine may be being written now)
                left.unlink(missing_ok=True)
        made_with = {"versions": versions(LIBRARIES), "machine": machine()}
        if resume:
            if with_others(self.path):
                said = read_json(self.path / "run.json")
                self._write("run.json", said | {WENT_ON: [*said.get(WENT_ON, []), made_with]})
            return
        for part, copy in self.starts(starts).items():
            with whole_file(copy) as file:
                file.write(starts[part].read_bytes())
        self._write("run.json", {"job": job, **made_with})

    def _keep(self, name: str, content: Mapping[str, Any]) -> None:
        """Write what comes to be known while it trains."""
        with writing(self.path / name, THEN_RESUME):
            self._write(name, content)

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        with whole_file(self.path / name) as file:
            file.write((json.dumps(content, indent=2) + "\n").encode())


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


def check_place(path: Path, job: Mapping[str, Any], resume: bool) -> None:
    """Raise UsageError where the folder of a run is taken, or was begun with another job; nothing is written."""
    if path.exists() and not path.is_dir():
        raise UsageError(f"{path} is a file; choose a folder with -o")
    begun = (path / "run.json").exists()
    if not resume:
        if begun:
            raise UsageError(f"{path} holds a run; --resume goes on with it, -o chooses another folder")
        if path.is_dir() and not all(map(_is_ours, path.iterdir())):
            raise UsageError(f"{path} holds files that are no run; choose another folder with -o")
        return
    changed = difference(begun_job(path), json.loads(json.dumps(job)))
    if changed:
        raise UsageError(
            f"{path} was begun with {changed}; --resume needs what it was begun with, -o starts another run"
        )


def _is_ours(child: Path) -> bool:
    """Whether it is what a run leaves that is killed before it has begun, or clips, which another machine may be making
    already; neither is a reason not to begin."""
    if child.name == CLIPS:
        return child.is_dir() and all(OF_CLIPS.fullmatch(each.name) for each in child.iterdir())
    return LEFT.fullmatch(child.name) is not None


def begun_job(path: Path) -> dict[str, Any]:
    """The job of a run that was begun; raises UsageError if there is none."""
    if not (path / "run.json").exists():
        raise UsageError(f"{path} holds no run to go on with; leave --resume out, or name the run's folder with -o")
    job = read_json(path / "run.json").get("job")
    if not isinstance(job, dict):
        raise DataError(f"{path / 'run.json'} does not say what is trained; copy the run again, or start another")
    return job


def with_others(path: Path) -> str:
    """Which version of a library a run was last trained with that is another one now; empty if all are the same, and of
    a run that is done."""
    if (path / FINISHED).exists():
        return ""
    said = read_json(path / "run.json")
    with as_stated(path / "run.json"):
        last = [said, *said.get(WENT_ON, [])][-1]
        return difference(dict(last["versions"]), versions(LIBRARIES))


def read_json(path: Path) -> dict[str, Any]:
    """A file of a run; raises DataError where it cannot be read."""
    try:
        found = json_of(read_text(path))
    except (OSError, ValueError) as error:
        said = str(error)[:200].replace("\n", " ")
        raise DataError(f"{path} cannot be read as JSON ({said}); copy the run again, or start another") from error
    if not isinstance(found, dict):
        raise DataError(f"{path} holds no names with values; copy the run again, or start another")
    return found
