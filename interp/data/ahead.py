"""Clips made on a GPU ahead of the samples that are drawn from them, by a process of its own.

It compiles for itself, which takes a minute on a new machine, and then makes many clips together.  What it has not made
in time is made on the CPU by whoever draws it, so that nothing waits.
"""

from __future__ import annotations

import signal
import time
from multiprocessing import get_context, parent_process
from typing import Any

from interp.data.on_card import made_on_card
from interp.data.pool import AHEAD, Pool, Report
from vid2ev.errors import DataError, Vid2evError

MANY = AHEAD // 2  # clips that are made together, unless they are needed now
LOOKED_FOR_S = 0.1  # how often the folder is looked into
ENDING_S = 5.0  # what the process has to end, when asked to
STOP = -1


class Ahead:
    """Keeps a pool filled for the samples from one on.  `close` ends it."""

    def __init__(self, pool: Pool, sample: int):
        spawn, self._pool = get_context("spawn"), pool  # (CUDA does not survive a fork)
        self._reached, self._failed = spawn.Value("q", sample), spawn.SimpleQueue()
        pool.remove_others(sample)
        self._process = spawn.Process(target=_keep_filled, args=(pool, self._reached, self._failed), daemon=True)
        self._process.start()

    def fill(self, sample: int, report: Report | None = None) -> None:
        """Wait until there is what a sample may be drawn from.  Raises DataError as `reached` does."""
        missing, done = len(self._pool.missing(sample)), 0
        while done < missing:
            self.reached(sample)
            time.sleep(LOOKED_FOR_S)
            before, done = done, missing - len(self._pool.missing(sample))
            for count in range(before + 1, done + 1):
                if report:
                    report(count, missing)

    def reached(self, sample: int) -> None:
        """Take a sample for the next that is drawn.  Raises DataError where clips cannot be made."""
        self._reached.value = sample  # type: ignore[attr-defined]
        if not self._process.is_alive():
            why = self._failed.get() if not self._failed.empty() else f"exit code {self._process.exitcode}"
            raise DataError(
                f"clips cannot be made on the GPU ({why}); go on with --resume --clips-on cpu, or mend that"
            )

    def close(self) -> None:
        """End the process."""
        self._reached.value = STOP  # type: ignore[attr-defined]
        self._process.join(ENDING_S)
        self._process.kill()
        self._process.join()


def _keep_filled(pool: Pool, reached: Any, failed: Any) -> None:
    """Make clips until there is nobody to draw from them."""
    for asked in (signal.SIGINT, signal.SIGTERM):  # (Ctrl-C, and a cluster that ends all, are for who trains)
        signal.signal(asked, signal.SIG_IGN)
    try:
        while _wanted(reached):
            missing = pool.missing(reached.value, 2 * AHEAD)
            if len(missing) < MANY and not pool.missing(reached.value, 0):
                time.sleep(LOOKED_FOR_S)
                continue
            for number, clip in made_on_card(pool.settings, pool.seed, missing[: 2 * AHEAD], pool.device):
                pool.keep(number, clip)
                if not _wanted(reached):
                    return
    except Exception as error:  # (what is said there is said by the process that trains)
        failed.put(f"{error}" if isinstance(error, Vid2evError) else f"{type(error).__name__}: {error}")
        raise SystemExit(1) from None


def _wanted(reached: Any) -> bool:
    parent = parent_process()
    return reached.value != STOP and parent is not None and parent.is_alive()
