"""What the tests of `vid2ev.cluster` have workers do; a module of its own, so that workers can import it."""

from __future__ import annotations

import os
import signal
import time
from functools import partial
from pathlib import Path
from typing import Any

from vid2ev import DataError, UsageError, convert
from vid2ev.cluster.task import GoOn, Tell
from vid2ev.making.conversion import Paused


def tried(name: str) -> int:
    """How often a task has been begun, this time too, by files in the folder that it is done in."""
    (Path(f"{name}.{os.getpid()}.{time.monotonic_ns()}")).touch()
    return len(list(Path().glob(f"{name}.*")))


def waits(tell: Tell, name: str, seconds: float) -> str:
    """Takes some time."""
    time.sleep(seconds)
    tell({"share": 1.0, "events": 7})
    return name


def compiles(tell: Tell) -> None:
    """Waits for what another process compiles."""
    from vid2ev.compiling.heard import waiting

    with waiting():
        pass


def gives_its_process(tell: Tell) -> int:
    """Where it was done."""
    return os.getpid()


def fails_once(tell: Tell) -> int:
    """A disk that is full for a moment."""
    if (count := tried("fails_once")) == 1:
        raise DataError("the disk is full")
    return count


def always_fails(tell: Tell) -> None:
    """A file that stays broken."""
    tried("always_fails")
    raise DataError("the file is broken")


def is_refused(tell: Tell) -> None:
    """A request that cannot be meant."""
    tried("is_refused")
    raise UsageError("expected something else")


def is_mistaken(tell: Tell) -> float:
    """A mistake of ours."""
    return 1 / len([])


def dies_once(tell: Tell) -> int:
    """Its process is killed in the middle, the first time."""
    if (count := tried("dies_once")) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return count


def takes_all_memory(tell: Tell) -> None:
    """Asks for more and more."""
    tried("takes_all_memory")
    held = []
    while True:
        held.append(os.urandom(10 << 20))
        time.sleep(0.03)


def converts_and_dies_once(tell: Tell, clip: str, directory: Path, options: dict[str, Any]) -> int:
    """A conversion killed after some checkpoints, the first time; gives the frames of the last run."""
    first, frames = tried("converts") == 1, 0

    def report(*_: Any) -> None:
        nonlocal frames
        frames += 1
        if first and frames == 12:
            os.kill(os.getpid(), signal.SIGKILL)

    convert(clip, directory, resume=True, report=report, **options)
    return frames


def converts_in_links(tell: Tell, clip: str, directory: Path, options: dict[str, Any], links: int = 1) -> int | GoOn:
    """A conversion that is left to the next one at every checkpoint, by a worker that is killed at its third link;
    gives how many there were."""
    if links == 3 and tried("third_link") == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    try:
        convert(clip, directory, resume=True, pause=lambda: True, **options)
    except Paused:
        return GoOn(partial(converts_in_links, clip=clip, directory=directory, options=options, links=links + 1))
    return links
