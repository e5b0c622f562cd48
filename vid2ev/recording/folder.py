"""The folder of a recording: there as a whole or not at all, and resumable until it is.

    DIR.partial/          while the recording is being made
        lock              held by the process that makes it
        job.json          what is made; only the same is ever continued
        t x y p [label]   the events so far, raw columns that only grow; so do the other files that are begun
        preview-00000.mp4 finished pieces of the preview
        checkpoint.npz    the last point at which everything fitted together
        whole/            the files of the finished recording
    DIR/                  whole/, renamed

A checkpoint is written beside the old one and renamed, after everything it speaks of has reached the disk.  Whenever
the process is killed, the checkpoint is therefore whole; what lies beyond it is cut off on resuming.
"""

from __future__ import annotations

import io
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from vid2ev.errors import DataError, SavedError, UsageError, Vid2evError
from vid2ev.formats.eager import EagerFile
from vid2ev.recording.destination import begun_at, check_apart, check_folder, partial_of
from vid2ev.recording.disk import THEN_RESUME, put_in_place, sync, whole_file, writing
from vid2ev.recording.held import LOCK, Held, undisturbed
from vid2ev.recording.manifest import is_of_job, read_manifest
from vid2ev.terminal import counted
from vid2ev.untrusted import read_arrays

FILES = re.compile(  # what a recording holds, and nothing else
    r"events([_-]\w+)*\.\w+|frames(\.npz|\.mp4|\.csv)?|raw|preview\.mp4|frame_index\.csv|probe\.(csv|png)"
    r"|noise_maps\.npz|truth|rig(\.[^/]+)?\.toml|manifest\.json"
)
WITHIN = re.compile(  # what the folders among them hold
    r"\d{6,}\.(png|npy|npz)|(timestamps|poses)\.txt|slices\.csv|intrinsics\.json"
)


class Folder:
    """The folder `directory` while it is made, as a context: `write`, `checkpoint`, then `publish`.

    job        what decides the recording, for JSON; what is there of another job is in the way
    overwrite  replace a recording that is in the way; it stays until the new one is whole
    resume     take what is there if it is of the same job: a finished recording, or the last checkpoint
    growing    names of the files that grow with the recording
    Left without `publish`, the folder keeps its last checkpoint; without one it leaves nothing.
    Raises UsageError where `directory` is taken, DataError where it cannot be written.
    """

    def __init__(
        self,
        directory: Path,
        job: Mapping[str, Any],
        *,
        overwrite: bool = False,
        resume: bool = False,
        growing: Sequence[str] = (),
    ):
        self.directory = directory
        self.partial = partial_of(directory)
        self.job = json.loads(json.dumps(job))
        self.overwrite, self.resume = overwrite, resume
        self._growing = tuple(growing)
        self.finished: dict[str, Any] | None = None  # the manifest, if `resume` finds the recording made
        self._files: dict[str, io.BufferedRandom] = {}
        self._held = Held(self.partial)

    def __enter__(self) -> Self:
        check_free(self.directory, self.overwrite, self.resume)
        try:
            with self.writing():
                self._held.take()
                self._begin()
        except BaseException as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with undisturbed():  # (Ctrl-C twice leaves nothing, either)
            for file in self._files.values():
                with suppress(OSError):
                    file.close()
            if self._held:
                if self.finished or not self.resumable:
                    with suppress(OSError):
                        self._clear()
                    shutil.rmtree(self.partial, ignore_errors=True)
                self._held.close()

    @property
    def resumable(self) -> bool:
        """Whether there is a checkpoint to resume from."""
        return (self.partial / "checkpoint.npz").exists()

    def write(self, name: str, content: bytes | memoryview) -> None:
        """Add to one of the files that grow; it counts from the next checkpoint on."""
        self._files[name].write(content)

    def size(self, name: str) -> int:
        """How many bytes a file that grows has."""
        return self._files[name].tell()

    def written(self, name: str) -> Path:
        """A file that grows, with all that was written to it."""
        self._files[name].flush()
        return self.partial / name

    def checkpoint(self, state: Mapping[str, np.ndarray]) -> None:
        """Make all that was appended, and `state` with it, the point to resume from."""
        for file in self._files.values():
            file.flush()
            os.fsync(file.fileno())
        with whole_file(self.partial / "checkpoint.npz") as saved:
            sizes = {f"size.{name}": np.int64(file.tell()) for name, file in self._files.items()}
            np.savez(saved, allow_pickle=False, **state, **sizes)

    def saved(self) -> dict[str, np.ndarray]:
        """The state of the last checkpoint; empty without one.  Raises DataError."""
        if not self.resumable:
            return {}
        with self.taking_up():
            return read_arrays(self.partial / "checkpoint.npz")

    @contextmanager
    def taking_up(self) -> Iterator[None]:
        """What does not fit in the last checkpoint becomes one sentence: DataError."""
        try:
            yield
        except DataError:
            raise
        except Exception as error:  # (numpy, zipfile and zlib have a dozen of their own; the state may be of anything)
            said = (str(error).splitlines() or [""])[0] if isinstance(error, Vid2evError) else type(error).__name__
            raise SavedError(
                f"{self.partial / 'checkpoint.npz'} is damaged, or not of this recording ({said[:150]}); --overwrite"
                " starts again"
            ) from error

    @property
    def whole(self) -> Path:
        """The folder for the files of the finished recording, which `publish` renames."""
        path = self.partial / "whole"
        path.mkdir(exist_ok=True)
        return path

    def begin_again(self) -> None:
        """Forget what was made so far, the last checkpoint too."""
        for file in self._files.values():
            file.close()
        self._clear()
        self._write_job()
        self._open({})

    def publish(self) -> None:
        """Put the finished recording in its place, at once."""
        for path in self.whole.rglob("*"):
            sync(path)
        sync(self.whole)
        shutil.rmtree(self.partial / "replaced", ignore_errors=True)
        put_in_place(self.whole, self.directory, self.partial / "replaced")
        sync(self.directory.absolute().parent)
        (self.partial / "checkpoint.npz").unlink(missing_ok=True)

    def writing(self) -> AbstractContextManager[None]:
        """What goes wrong with the disk within becomes one sentence."""
        elsewhere = "make room or access there, or choose another folder with -o"
        return writing(self.directory, THEN_RESUME if self.resumable else elsewhere)

    def _begin(self) -> None:
        """Take up the checkpoint, find the recording finished, or start."""
        sizes = dict[str, int]()
        begun = taken_up(self.directory, self.job, self.overwrite) if self.resume else None
        if begun and begun.parent == self.partial:
            shutil.rmtree(self.partial / "whole", ignore_errors=True)  # (perhaps the recording that was replaced)
            saved = self.saved()
            with self.taking_up():
                sizes = {name[5:]: int(saved[name]) for name in saved if name.startswith("size.")}
                self._check_sizes(sizes)
        elif begun:
            self.finished = read_manifest(begun)
            return
        else:
            self._clear()
            self._write_job()
        self._open(sizes)

    def _check_sizes(self, sizes: Mapping[str, int]) -> None:
        """Raise DataError where less is there of a file that grows than was there at the checkpoint."""
        for name in self._growing:
            path = self.partial / name
            there = path.stat().st_size if path.is_file() else 0
            if not 0 <= sizes[name] <= there:
                raise SavedError(
                    f"{path} has {counted(there, 'byte')}, and {sizes[name]:,} at the last checkpoint; --overwrite"
                    " starts again"
                )

    def _write_job(self) -> None:
        with whole_file(self.partial / "job.json") as file:
            file.write(json.dumps(self.job, indent=2).encode())

    def _open(self, sizes: Mapping[str, int]) -> None:
        for name in self._growing:
            (self.partial / name).parent.mkdir(exist_ok=True)
            (self.partial / name).touch()
            self._files[name] = file = io.BufferedRandom(EagerFile(self.partial / name, "r+"))  # (closed by __exit__)
            file.truncate(sizes.get(name, 0))
            file.seek(0, os.SEEK_END)

    def _clear(self) -> None:
        """Remove all but the lock: first what could be gone on from, last what says whose folder it is."""
        (self.partial / "checkpoint.npz").unlink(missing_ok=True)
        for path in sorted(self.partial.iterdir(), key=lambda path: path.name == "job.json"):
            if path.name != LOCK:
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def taken_up(directory: Path, job: Mapping[str, Any], overwrite: bool) -> Path | None:
    """What a conversion that resumes finds of its job: that of the last checkpoint, the manifest of a finished
    recording, or nothing.  Raises UsageError for another job's unless it may be overwritten."""
    begun, made = partial_of(directory) / "job.json", directory / "manifest.json"
    found = begun if begun.with_name("checkpoint.npz").exists() else made if made.exists() else None
    return found if found and is_of_job(found, job, directory, overwrite) else None


def begun_job(directory: Path) -> dict[str, Any]:
    """The job of a recording that was begun or finished; empty if there is none."""
    for path in (partial_of(directory) / "job.json", directory / "manifest.json"):
        if path.exists():
            return read_manifest(path)
    return {}


def check_free(directory: Path, overwrite: bool = False, resume: bool = False, of: str | Path | None = None) -> None:
    """Raise UsageError unless a recording, `of` a file or folder, may be written to `directory`, DataError for a name
    that no folder can have; touches nothing."""
    check_folder(directory)
    if overwrite and of is not None:
        check_apart(of, directory)
    held = list(directory.iterdir()) if directory.is_dir() else []
    others = {path.name for path in held if not (_may_be_made(path) or _is_camera(path))}
    if others:
        raise UsageError(
            f"{directory} holds files that are no recording ({min(others)}); choose another folder with -o"
        )
    if held and not (overwrite or resume):
        raise UsageError(f"{directory} exists; --overwrite replaces it, -o chooses another folder")
    if held and not (directory / "manifest.json").is_file():
        raise UsageError(
            f"{directory} has no manifest.json, as a recording has, and holds {held[0].name}; choose another folder"
            " with -o"
        )
    if "checkpoint.npz" in begun_at(directory) and not (overwrite or resume):
        raise UsageError(f"{directory} was begun and not finished; --resume continues it, --overwrite starts again")


def _is_camera(path: Path) -> bool:
    """Whether a folder is that of a camera of a rig."""
    return (path / "manifest.json").is_file() and all(map(_may_be_made, path.iterdir()))


def _may_be_made(path: Path) -> bool:
    """Whether it has the name of something in a recording and, a folder, holds nothing but what that does."""
    if not FILES.fullmatch(path.name):
        return False
    return not path.is_dir() or all(WITHIN.fullmatch(file.name) for file in path.rglob("*") if not file.is_dir())
