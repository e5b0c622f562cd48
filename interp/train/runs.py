"""A run from what was asked for: its folder, its parts, a session of training."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from interp.data.pool import Report
from interp.train import told
from interp.train.checkpoints import read_checkpoint
from interp.train.curves import check_curves
from interp.train.fit import Fit, Outcome, Stop
from interp.train.job import NOTHING, Job
from interp.train.machines import Machines
from interp.train.made_of import feed_of, learner_of
from interp.train.run_folder import FINISHED, RunFolder
from interp.train.starts import begin
from vid2ev.cores import usable_cores
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.manifest import as_stated
from vid2ev.sensors.devices import CPU, Device
from vid2ev.terminal import counting

CLIPS = "{percentage:3.0f}% {bar} clip {n_fmt}/{total_fmt}, {elapsed} gone, {remaining} left"


def run(
    job: Job,
    path: Path,
    resume: bool = False,
    machines: Machines | None = None,
    session_s: float | None = None,
    workers: int | None = None,
    quiet: bool = False,
    stop: Stop = lambda: False,
    starts: Mapping[str, Path] = NOTHING,
    clips_on: Device = CPU,
    interrupted: Stop = lambda: False,
) -> Outcome:
    """Train in the folder `path`, or go on there; what is done is left as it is.

    machines    by default all GPUs of this one, or what the recipe says of those without
    session_s   seconds after which to stop, to go on another time
    workers     processes that make samples, for each that trains; None for those cores that training leaves, at least
                1; with 0 this one makes the first clips, too
    stop        asked after each step
    starts      files of weights to begin with, by part, as the job says; to go on the run has its own
    clips_on    the device that clips to train with are made on
    interrupted asked while the first of them are made: whether somebody has asked to end
    Raises UsageError where the folder is taken or was begun otherwise, DataError where training does not get on, and
    KeyboardInterrupt if it is interrupted.
    """
    begun_s = time.monotonic()
    machines = machines or Machines.of("auto", 1, False, job.recipe.processes)
    machines.check_batch(job.recipe.batch)
    learner = learner_of(job)
    if not resume:
        begin(learner, starts)
    folder = RunFolder(path, job.kept([path]), resume, machines.first, starts)
    try:
        if resume and (done := folder.finished()) is not None:
            folder.forget_clips()  # (where it was killed just as it was done)
            with as_stated(folder.path / FINISHED):
                return told.outcome_of(done)
        if resume:
            begin(learner, folder.starts(job.starts))
            check_curves(folder.path)
        step = read_checkpoint(folder.checkpoint)["global_step"] if folder.checkpoint.exists() else 0
        spare = machines.spare(job.recipe.threads) if workers is None else workers
        with ExitStack() as fed:
            try:
                with counting(quiet, CLIPS) as report, _until(interrupted, report) as made:
                    leads, jobs = machines.first, usable_cores() if spare else 1
                    feed = feed_of(job, folder.clips, step, spare, jobs, made, clips_on, leads, [path])
                fed.callback(feed.close)
                machines.check_clips(len(feed.validation))
            except UsageError:
                fed.close()  # (who still makes clips would put them where the folder was)
                if not resume:
                    folder.give_up()
                raise
            outcome = Fit(learner, feed, folder, job.network, machines, session_s, stop, quiet, begun_s).run()
        if outcome.finished:
            folder.check_weights()
            folder.finish(told.as_json(outcome))
        return outcome
    finally:
        folder.close()


@contextmanager
def _until(interrupted: Stop, report: Report) -> Iterator[Report]:
    """What is told of each clip and ends where somebody has asked to; so does what goes wrong then: the processes that
    make clips may have been asked, too."""

    def told_of(*counts: int) -> None:
        report(*counts)
        if interrupted():
            raise KeyboardInterrupt

    try:
        yield told_of
    except DataError as error:
        if interrupted():
            raise KeyboardInterrupt from error
        raise
