"""A session of training, from the checkpoint, if there is one, to the end, or as far as it goes."""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field

import torch
from lightning.pytorch import Trainer
from lightning.pytorch.loggers import TensorBoardLogger

from interp.train.batches import Feed
from interp.train.checkpoints import Saves, WholeFiles, read_checkpoint
from interp.train.curves import Curves
from interp.train.heard import HeardAsBefore
from interp.train.keeping import Keeping
from interp.train.learner import Learner, means
from interp.train.machines import Machines
from interp.train.progress import Bar
from interp.train.run_folder import RunFolder
from interp.train.running_mean import RunningMean
from interp.train.schedule import Schedule, Steps
from interp.train.scores import Scores
from interp.train.session import Limits, Session, validate_every
from vid2ev.errors import DataError, Vid2evError
from vid2ev.recording.manifest import as_stated

LOG_EVERY = 10  # steps
Stop = Callable[[], bool]
NEVER = 1 << 62  # batches until validation, while the steps are not known


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a session ended.

    step, steps   where training stands, and how many steps it has; None where that is not known yet
    skipped       steps without a finite gradient
    best          the step whose weights are kept: those of the best validation
    scores        of methods on groups of clips, those of these weights as "network"; empty before the end
    """

    step: int
    steps: int | None
    skipped: int
    best: int
    scores: dict[str, dict[str, Scores]]

    @property
    def finished(self) -> bool:
        """Whether training is done."""
        return self.step == self.steps


@dataclass(slots=True)
class Fit:
    """A session of training.

    name        of the network, for its weights
    session_s   seconds after which to stop, to go on another time; None for no end
    stop        asked after each step: whether to stop
    begun_s     when the session began, by the monotonic clock; now unless given
    """

    learner: Learner
    feed: Feed
    folder: RunFolder
    name: str
    machines: Machines
    session_s: float | None = None
    stop: Stop = lambda: False
    quiet: bool = False
    begun_s: float = field(default_factory=time.monotonic)

    def run(self) -> Outcome:
        """Train.  Raises DataError where training does not get on, or a file does not hold what it should."""
        with unmentioned(), self._threads():
            step = self._stands_at()
            steps = self._given()
            self._take_up(steps)
            trainer = self._trainer(step, steps)
            self._measure(trainer, step)
            with made_by_workers():
                trainer.fit(self.learner, self.feed, ckpt_path=self.folder.checkpoint if step else None)
            return self._outcome(trainer)

    def _stands_at(self) -> int:
        """The step that it goes on from.  Raises DataError for a checkpoint of another network, or damaged."""
        path = self.folder.checkpoint
        if not path.exists():
            return 0
        found = read_checkpoint(path)
        with as_stated(path):
            said, own = (
                {name: tuple(each.shape) for name, each in one.items()}
                for one in (found["state_dict"], self.learner.state_dict())
            )
            self.learner.on_load_checkpoint(found)
        if said != own:
            raise DataError(f"{path} is of another network; copy the run again, or start another with -o")
        return int(found["global_step"])

    @contextmanager
    def _threads(self) -> Iterator[None]:
        """Without a GPU, of so many threads as the recipe says, which decide the last bits."""
        before = torch.get_num_threads()
        if self.machines.accelerator == "cpu":
            torch.set_num_threads(self.learner.recipe.threads)
        try:
            yield
        finally:
            torch.set_num_threads(before)

    def _given(self) -> Steps | None:
        recipe = self.learner.recipe
        if recipe.steps is None:
            return self.folder.steps()
        return Steps(((0, recipe.steps),), validate_every(recipe.steps, recipe.validations))

    def _take_up(self, steps: Steps | None) -> None:
        recipe = self.learner.recipe
        self.learner.schedule = Schedule(recipe.warm_up, recipe.rate_end, steps.plans if steps else ())

    def _planned(self, steps: Steps) -> None:
        self.folder.plan(steps)
        self._take_up(steps)

    def _trainer(self, step: int, steps: Steps | None) -> Trainer:
        recipe = self.learner.recipe
        limits = Limits(None if recipe.steps else recipe.time_s, recipe.validations, self.session_s, self.stop)
        session = Session(limits, steps, self._planned, self._validation_s, self.begun_s)
        path = self.folder.path
        board = TensorBoardLogger(path, name="tensorboard", version="", purge_step=step or None)
        return Trainer(
            accelerator=self.machines.accelerator,
            devices=self.machines.devices,
            num_nodes=self.machines.nodes,
            precision=self._precision(),  # type: ignore[arg-type]
            max_steps=steps.last if steps else -1,
            max_epochs=-1,
            val_check_interval=steps.validate_every if steps else NEVER,
            check_val_every_n_epoch=None,
            num_sanity_val_steps=0,
            log_every_n_steps=LOG_EVERY,
            logger=[Curves(path, step), board],
            callbacks=[
                HeardAsBefore(),
                session,
                Bar(recipe.batch, self.quiet),
                Keeping(self.folder, self.name),
                RunningMean(recipe.mean),
                Saves(self.folder.checkpoint, recipe.save_s),
            ],
            plugins=[WholeFiles()],
            use_distributed_sampler=False,
            enable_progress_bar=False,
            enable_model_summary=False,
            default_root_dir=path,
        )

    def _precision(self) -> str:
        asked = self.learner.recipe.precision
        if asked == "auto":
            on_gpu = self.machines.accelerator != "cpu"
            bf16 = on_gpu and torch.cuda.is_bf16_supported(including_emulation=False)
            asked = "32" if not on_gpu else "bf16" if bf16 else "16"
        return {"32": "32-true", "bf16": "bf16-mixed", "16": "16-mixed"}[asked]

    def _measure(self, trainer: Trainer, step: int) -> None:
        """The scores of what needs no training, once, and of the network before it has learnt anything."""
        if self.folder.first and not self._baselines():
            found = [
                (group, name, self.learner.scored(clip, images))
                for group, clip in self.feed.validation
                for name, images in self.learner.baselines(clip).items()
            ]
            names = dict.fromkeys(name for _, name, _ in found)
            tables = {name: means([(group, each) for group, of, each in found if of == name]) for name in names}
            self.folder.write_baselines(
                {name: {g: asdict(s) for g, s in table.items()} for name, table in tables.items()}
            )
        if not step:
            trainer.validate(self.learner, self.feed, verbose=False)

    def _validation_s(self) -> float:
        return self.learner.validation_s

    def _outcome(self, trainer: Trainer) -> Outcome:
        step, steps, skipped = trainer.global_step, self.learner.schedule.steps, self.learner.skipped
        if step != steps:
            return Outcome(step, steps, skipped, self.learner.best[0], {})
        if self.learner.validated_at != step:
            self.learner.load_state_dict(read_checkpoint(self.folder.checkpoint)["state_dict"])  # (the running mean)
            trainer.validate(self.learner, self.feed, verbose=False)
        best, kept = self.learner.best
        found: dict[str, dict[str, Scores]] = {group: {"network": one} for group, one in kept.items()}
        for name, table in self._baselines().items():
            for group, one in table.items():
                found[group][name] = one
        return Outcome(step, steps, skipped, best, found)

    def _baselines(self) -> dict[str, dict[str, Scores]]:
        return self.folder.baselines([group for group, _ in self.feed.validation])


@contextmanager
def made_by_workers() -> Iterator[None]:
    """What a process that makes samples says stays one sentence, without the traceback that torch puts before it; one
    that is killed, for want of memory as a rule, becomes one."""
    try:
        yield
    except Vid2evError as error:
        kind = type(error)
        _, named, said = str(error).rpartition(f" {kind.__module__}.{kind.__qualname__}: ")
        if not named:  # (of this process)
            raise
        raise kind(said.strip()) from error
    except RuntimeError as error:
        if not str(error).startswith("DataLoader worker"):
            raise
        raise DataError(
            f"a process that makes samples ended ({error}); go on with --resume and fewer --workers"
        ) from error


@contextmanager
def unmentioned() -> Iterator[None]:
    """Without what Lightning and torch tell people who write training loops."""
    from lightning.fabric.utilities.warnings import PossibleUserWarning

    loggers = [logging.getLogger(f"lightning.{part}") for part in ("pytorch", "fabric")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PossibleUserWarning)
            warnings.filterwarnings("ignore", r".*isinstance\(treespec, LeafSpec\)", FutureWarning)
            warnings.filterwarnings("ignore", r"This DataLoader will create \d+ worker processes", UserWarning)
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
