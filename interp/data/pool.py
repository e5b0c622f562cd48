"""A pool of clips: a folder that keeps what `made` gives while it is drawn from.

    FOLDER/NAME/000123.npy     clip 123 of the settings, files, seed and version that NAME stands for

The folder is a cache of a pure function and no more: whatever is missing, or damaged by a crash of the machine, is made
again, so that nothing depends on who made a clip, when, or whether the process was killed meanwhile.

Samples are drawn from a window of clips that slides: sample i sees clips low(i) to high(i) - 1,

    high(i) = begin + floor(fresh i)        low(i) = max(0, high(i) - most)

Who draws a sample at which high(i) steps on makes a clip that is needed some time later, so that the processes that
load samples share the work, and removes one that is needed no more.  With a GPU to make them on, `ahead` makes them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from concurrent.futures import as_completed
from pathlib import Path

from interp.data.clip import Clip, remove_half_written, sound_clip, write_clip
from interp.data.inputs import known_by
from interp.data.making import made
from interp.data.settings import ClipSettings
from vid2ev.cluster.processes import processes
from vid2ev.errors import UsageError
from vid2ev.recording.disk import THEN_RESUME, writing
from vid2ev.sensors.devices import CPU, Device

AHEAD = 48  # clips that are made before they are drawn from
KEPT = 48  # clips behind the window that a slower process may still look at
VERSION = 10  # of what `made` makes: raise it when clips of a number change

Report = Callable[[int, int], object]  # clips made, of how many


class Pool:
    """Clips of settings and a seed in a folder.

    begin   clips that there are before the first sample
    most    clips in the window; each of 128x128 pixels takes 2.6 MB
    fresh   clips that join it with each sample
    device  what clips are made on; one that is needed and not there yet is made on the CPU
    besides folders that are no part of what clips are made of, wherever they are
    Raises UsageError for a window that cannot be.
    """

    def __init__(
        self,
        folder: Path,
        settings: ClipSettings,
        seed: int,
        *,
        begin: int = 256,
        most: int = 1500,
        fresh: float = 0.02,
        device: Device = CPU,
        besides: Collection[Path] = (),
    ):
        if not 1 <= begin <= most or fresh < 0:
            raise UsageError(
                f"a window of {begin} to {most} clips, {fresh} fresh ones a sample: expected 1 <= begin <= most"
            )
        self.settings, self.seed, self.begin, self.most, self.fresh = settings, seed, begin, most, fresh
        self.device = device
        self.folder = folder / f"{known_by(settings, besides=besides)}-{seed}-{VERSION}"
        with writing(self.folder, THEN_RESUME):
            self.folder.mkdir(parents=True, exist_ok=True)

    def window(self, sample: int) -> range:
        """The clips that a sample may be drawn from."""
        high = self.begin + int(self.fresh * sample)
        return range(max(0, high - self.most), high)

    def clip(self, number: int) -> Clip:
        """A clip, made if it is not there, or is none.  Raises DataError where the folder cannot be written."""
        clip = sound_clip(self._path(number))
        if clip is None:
            clip = made(self.settings, self.seed, number)
            self.keep(number, clip)
        return clip

    def keep(self, number: int, clip: Clip) -> None:
        """Write the clip of a number.  Raises DataError where the folder cannot be written."""
        path = self._path(number)
        with writing(path, THEN_RESUME):
            write_clip(path, clip)

    def missing(self, sample: int, ahead: int = AHEAD) -> list[int]:
        """Those that are not there, of the clips that a sample may be drawn from and so many after them."""
        window = self.window(sample)
        return [number for number in range(window.start, window.stop + ahead) if not self._path(number).exists()]

    def step(self, sample: int) -> None:
        """What drawing a sample is due: a clip of later, if the window steps on here."""
        here, after = self.window(sample), self.window(sample + 1)
        for number in range(here.stop, after.stop):
            if self.device.name == "cpu" and not self._path(number + AHEAD).exists():
                self.clip(number + AHEAD)
            self._path(number - self.most - KEPT).unlink(missing_ok=True)

    def fill(self, sample: int, jobs: int = 1, report: Report | None = None) -> None:
        """Make what samples from this one on need at first, with some processes, and remove what they do not.

        Where one clip cannot be made, those that no process has begun are not tried.
        """
        self.remove_others(sample)
        missing = self.missing(sample)
        if not missing:
            return
        if jobs == 1:
            for done, number in enumerate(missing, 1):
                self.clip(number)
                if report:
                    report(done, len(missing))
            return
        with processes(jobs, _alone) as submit:
            making = [submit(_make, self, number) for number in missing]
            for done, future in enumerate(as_completed(making), 1):
                future.result()
                if report:
                    report(done, len(missing))

    def remove_others(self, sample: int) -> None:
        """Remove clips that samples from this one on do not need, or not soon, those that are none, and what was left
        half written."""
        window = self.window(sample)
        soon = range(window.start, window.stop + AHEAD)
        for path in self.folder.glob("*.npy"):
            if path.stem.isdecimal() and (int(path.stem) not in soon or sound_clip(path) is None):
                path.unlink(missing_ok=True)
        remove_half_written(self.folder)

    def _path(self, number: int) -> Path:
        return self.folder / f"{number:06d}.npy"


def _make(pool: Pool, number: int) -> None:
    pool.clip(number)


def _alone() -> None:
    """One thread for each process: they share the cores."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import cv2
    import torch

    torch.set_num_threads(1)
    cv2.setNumThreads(1)
