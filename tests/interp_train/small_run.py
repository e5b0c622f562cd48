"""A small run, of samples that are quick to make; as a program it is one session of it.

    python small_run.py FOLDER resume=1 devices=2 killed_at_step=7 ...

`asked` lets SIGTERM end it after a step, as of the command; `killed_at_step` is the step after which it is killed as
by `kill -9`, `killed_at_write` the thing that lasts (a file brought to the disk or renamed) at which,
`killed_at_validation` the step whose validation does not end.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch
from torch.nn import functional as F
from torch.utils.data import Dataset

SIDE, STEPS = 16, 8
NETWORK = "rrin_events_light"
STEPS_OF_RUN = 12


def sample(number: int) -> dict[str, torch.Tensor]:
    """A texture that moves by whole pixels, and the events of that; a function of the number."""
    generator = torch.Generator().manual_seed(1000 + number)
    texture = F.interpolate(torch.rand(1, 3, 8, 8, generator=generator), size=(3 * SIDE, 3 * SIDE), mode="bilinear")[0]
    across, down = (8 * torch.rand(2, generator=generator)).tolist()
    corners = [(round(down * k / STEPS), round(across * k / STEPS)) for k in range(STEPS + 1)]
    frames = torch.stack([texture[:, y : y + SIDE, x : x + SIDE] for y, x in corners]).clamp(0.02, 1)
    levels = torch.round(torch.log(frames.mean(1)) / 0.15).diff(dim=0)
    off_on = torch.stack([(-levels).clamp(min=0), levels.clamp(min=0)]).to(torch.uint8)
    inner = 1 + torch.randperm(STEPS - 1, generator=generator)[:2]
    return {
        "frames": frames[[0, -1]],
        "off_on": off_on,
        "footprint": torch.tensor(1),
        "contrast": torch.full((2,), 0.15),
        "times": inner.float() / STEPS,
        "truth": frames[inner],
    }


class Made(Dataset):  # type: ignore[type-arg]
    """Samples without end; those in `spoilt` are not finite."""

    def __init__(self, spoilt: range = range(0)):
        self.spoilt = spoilt

    def __getitem__(self, number: int) -> dict[str, torch.Tensor]:
        found = sample(number)
        return found | {"truth": found["truth"] * float("nan")} if number in self.spoilt else found


def clips(count: int = 2, groups: int = 1) -> list[tuple[str, dict[str, torch.Tensor]]]:
    """Clips to validate with."""
    names = [f"group{k}" for k in range(1, groups)] + ["scenes"]
    return [(names[-1 - k % groups], {name: part[None] for name, part in sample(-1 - k).items()}) for k in range(count)]


def session(folder: Path, resume: bool = False, devices: int = 1, spoilt: range = range(0), **changed: Any) -> Any:
    """A session of the run; `changed` are values of the recipe and of `Fit`, and `network`, options of the network."""
    from interp.networks import make
    from interp.train.batches import Feed
    from interp.train.fit import Fit
    from interp.train.frame_fed import FrameFedLearner
    from interp.train.machines import Machines
    from interp.train.recipe import Recipe
    from interp.train.run_folder import RunFolder
    from interp.train.schedule import Schedule

    of_fit = {name: changed.pop(name) for name in ("session_s", "stop", "begun_s") if name in changed}
    workers, groups = changed.pop("workers", 0), changed.pop("groups", 1)
    of_network = changed.pop("network", {})
    few = {"steps": STEPS_OF_RUN, "batch": 4, "save_s": 1e-6, "validations": 2, "threads": 1, "warm_up": 3}
    recipe = Recipe(**(few | changed))
    torch.manual_seed(recipe.seed)
    schedule = Schedule(recipe.warm_up, recipe.rate_end)
    learner = FrameFedLearner(NETWORK, make(NETWORK, **of_network), recipe, schedule)  # type: ignore[arg-type]
    machines = Machines(devices, accelerator="cpu")
    place = RunFolder(folder, {"recipe": recipe.model_dump(mode="json")}, resume, machines.first)
    try:
        feed = Feed(Made(spoilt), clips(groups=groups), recipe.batch, workers)
        return Fit(learner, feed, place, NETWORK, machines, quiet=True, **of_fit).run()
    finally:
        place.close()


def in_a_process(folder: Path, **options: float) -> subprocess.CompletedProcess[str]:
    """A session in a process of its own."""
    arguments = [f"{name}={value}" for name, value in options.items()]
    return subprocess.run([sys.executable, __file__, str(folder), *arguments], capture_output=True, text=True)


def kept(folder: Path) -> dict[str, torch.Tensor]:
    """All numbers that a run goes on from, by name."""
    found = torch.load(folder / "checkpoint.ckpt", weights_only=True)
    optimizer = found["optimizer_states"][0]["state"]
    moments = {f"{k}.{name}": value for k, state in optimizer.items() for name, value in state.items()}
    current = {f"current.{name}": value for name, value in found["current_model_state"].items()}
    return found["state_dict"] | current | moments


def _die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _program() -> None:
    from interp.train.learner import Learner
    from vid2ev.interrupts import heard

    options = {name: json.loads(value) for name, value in (text.split("=") for text in sys.argv[2:])}
    last_step, last_write, last_validation = (
        options.pop(f"killed_at_{name}", 0) for name in ("step", "write", "validation")
    )
    done, asked = {"steps": 0, "writes": 0}, options.pop("asked", 0)

    def counted(function: Any) -> Any:
        def count(*arguments: Any, **named: Any) -> Any:
            done["writes"] += 1
            if done["writes"] == last_write:
                _die()
            return function(*arguments, **named)

        return count

    def stop() -> bool:
        done["steps"] += 1
        if done["steps"] == last_step:
            _die()
        return False

    def concluded(learner: Any, conclude: Any = Learner.conclude_validation) -> None:
        if learner.trainer.global_step == last_validation:
            _die()
        conclude(learner)

    if last_validation:
        Learner.conclude_validation = concluded  # type: ignore[method-assign]
    os.fsync, Path.replace = counted(os.fsync), counted(Path.replace)  # type: ignore[method-assign]
    torch.set_num_threads(1)
    with heard(gently=True) if asked else nullcontext(stop) as check:
        outcome = session(Path(sys.argv[1]), bool(options.pop("resume", 0)), stop=check, **options)
    print(outcome.step, done["writes"])


if __name__ == "__main__":
    _program()
