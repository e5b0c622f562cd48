"""Frames while they are made, and the folder or film that they become: there as a whole or not at all.

    OUT.partial/
        lock             held by the process that makes them
        job.json         what is made; only the same is ever continued
        done.jsonl       a line for each stretch whose frames are all there: their times, and remarks
        frames/          000000.png ..., each written as a whole
        whole/           frames/ with all that belongs to it, about to be renamed
        pieces/          of a film: 000000-000128.mp4 ..., made of frames that are then removed

A folder is `frames`, renamed; a film is its pieces, one after the other, without encoding them again.  A stretch that
was begun when the process was killed is made again, to the same bytes, since it depends on nothing but its job; what
a method has to remember of the stretches before is kept beside (`keep`).
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Self

import numpy as np

from interp.interpolate.destination import Kind, check_free, manifest_of
from interp.interpolate.instants import TooFine
from interp.interpolate.journal import Line, append_line, read_lines
from interp.interpolate.pieces import Pieces
from vid2ev.errors import DataError, Vid2evError
from vid2ev.pictures.film import film_size, join_films, remarks_on_size
from vid2ev.recording.destination import partial_of
from vid2ev.recording.disk import THEN_RESUME, put_in_place, sync, whole_file, writing
from vid2ev.recording.exposures import read_codes, write_codes
from vid2ev.recording.held import LOCK, Held, undisturbed
from vid2ev.recording.manifest import difference, is_of_job, read_manifest, write_manifest
from vid2ev.sources.images import FRAMES
from vid2ev.untrusted import first_line, read_arrays

PIECE = 128  # pictures
REMEDY = "make room or access there, or choose another place with -o"


class Shelf:
    """Where frames are put, as a context.

    kind     mp4, a film; png or exr, a folder
    job      what decides the frames, for JSON
    write    writes light or codes to a path, of EXR; None: PNG of the codes
    line     what the line of a stretch has beside its times: int, bool or str
    Raises UsageError where `output` is taken, or was begun with another job, DataError where it cannot be written, or
    where something is missing of what is to be gone on with.
    """

    def __init__(
        self,
        output: Path,
        kind: Kind,
        job: Mapping[str, Any],
        rate: Fraction,
        *,
        overwrite: bool = False,
        resume: bool = False,
        write: Callable[[Path, np.ndarray], None] = write_codes,
        line: Mapping[str, type] = MappingProxyType({}),
    ):
        self.output, self.kind, self.rate = output, kind, rate
        self.job = json.loads(json.dumps(job))
        self.overwrite, self.resume = overwrite, resume
        self.partial = partial_of(output)
        self.finished: dict[str, Any] | None = None  # the manifest, if `resume` finds all done
        self.done: list[Line] = []
        self._line = {**line, "memory": bool}
        self._write, self._frames, self._whole = write, self.partial / "frames", self.partial / "whole"
        self._journal = self.partial / "done.jsonl"
        self._pieces = Pieces(self.partial / "pieces", rate, self.job["transfer"])
        self._held = Held(self.partial)
        self._begun = False

    def __enter__(self) -> Self:
        check_free(self.output, self.kind, self.overwrite, self.resume)
        try:
            with self.writing(), undisturbed():
                self._held.take()
                self._begin()
                self._begun = True
        except BaseException as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._held:
            return
        with undisturbed():  # (Ctrl-C twice leaves nothing, either)
            if not self._goes_on or isinstance(error, TooFine):
                shutil.rmtree(self.partial, ignore_errors=True)
            self._held.close()

    @property
    def _goes_on(self) -> bool:
        """Whether there is something to go on with."""
        return bool(self.done) if self._begun else (self.partial / "job.json").exists()

    @property
    def count(self) -> int:
        """How many frames belong to stretches that are done."""
        return sum(len(line["t_us"]) for line in self.done)

    def size_of(self, pictures: tuple[int, int]) -> tuple[int, int]:
        """Width and height of what is made of pictures of this size."""
        return film_size(pictures) if self.kind == "mp4" else pictures

    def remarks_on(self, pictures: tuple[int, int]) -> list[str]:
        """That it is not the pictures' own size, if it is not."""
        return remarks_on_size("the film", pictures) if self.kind == "mp4" else []

    def writing(self) -> Any:
        """What goes wrong with the disk within becomes one sentence."""
        return writing(self.output, THEN_RESUME if self.done else REMEDY)

    def put(self, number: int, picture: np.ndarray) -> None:
        """A frame."""
        path = self._path(number)
        beside = path.with_name(f"new{path.suffix}")
        self._write(beside, picture)
        sync(beside)
        beside.replace(path)

    def stretch(self, line: Mapping[str, Any], memory: Mapping[str, np.ndarray] | None = None) -> None:
        """All frames of a stretch are there: `t_us` of the line has their times."""
        done = {**line, "memory": bool(memory)}
        sync(self._frames)
        if memory:
            with whole_file(self.partial / f"memory-{len(self.done) + 1}.npz") as file:
                np.savez(file, allow_pickle=False, **memory)
        append_line(self._journal, done)
        self.done.append(done)
        self._memory(len(self.done) - 1).unlink(missing_ok=True)
        self._encode(PIECE)

    def memory(self) -> dict[str, np.ndarray]:
        """What was kept with the last stretch that is done.  Raises DataError."""
        path = self._memory(len(self.done))
        if not (self.done and self.done[-1]["memory"]):
            return {}
        try:
            return read_arrays(path)
        except DataError:
            raise
        except Exception as error:  # (numpy, zipfile and zlib have a dozen of their own)
            said = first_line(error, 100)
            raise DataError(f"{path} cannot be read ({said}); --overwrite starts again") from error

    @contextmanager
    def remembering(self) -> Iterator[None]:
        """What a method cannot take up of what was kept for it becomes one sentence: DataError."""
        try:
            yield
        except (Vid2evError, OSError):
            raise
        except Exception as error:  # (the networks are those of others, and what they remember is of any shape)
            said = first_line(error, 100)
            raise DataError(
                f"{self._memory(len(self.done))} does not fit what is asked for ({said}); --overwrite starts again"
            ) from error

    def publish(self, manifest: Mapping[str, Any]) -> None:
        """Put folder or film in its place, with its manifest."""
        with self.writing():
            if self.kind == "mp4":
                self._encode(1)
                film = self.partial / "film.mp4"
                join_films(film, [(piece, first) for piece, first, _ in self._pieces.found()], self.rate)
                sync(film)
                with whole_file(manifest_of(self.output, self.kind)) as file:
                    file.write((json.dumps(manifest, indent=2, allow_nan=False) + "\n").encode())
                film.replace(self.output)
            else:
                times = [t_us for line in self.done for t_us in line["t_us"]]
                (self._frames / "timestamps.txt").write_text("# us\n" + "".join(f"{t}\n" for t in times))
                write_manifest(self._frames / FRAMES, manifest)
                for name in ("timestamps.txt", FRAMES):
                    sync(self._frames / name)
                self._frames.rename(self._whole)
                shutil.rmtree(self.partial / "replaced", ignore_errors=True)
                put_in_place(self._whole, self.output, self.partial / "replaced")
            sync(self.output.absolute().parent)
            self.done = []

    def _begin(self) -> None:
        """Take up what is there, find all finished, or start."""
        job, made = self.partial / "job.json", manifest_of(self.output, self.kind)
        made_in = self._whole / FRAMES
        if self.resume and job.exists() and not self._frames.exists() and made_in.exists():
            about_to_be_put, wanted = read_manifest(made_in), self.job
            if not difference({key: about_to_be_put.get(key) for key in wanted}, wanted):
                self._whole.rename(self._frames)
        if self.resume and job.exists() and self._is_same(job) and self._frames.exists():
            self._take_up()
            return
        if self.resume and self.output.exists() and made.exists() and self._is_same(made):
            self.finished = read_manifest(made)
            return
        for path in self.partial.iterdir():
            if path.name != LOCK:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        self._frames.mkdir()
        self._pieces.folder.mkdir()
        with whole_file(job) as file:
            file.write(json.dumps(self.job, indent=2).encode())

    def _take_up(self) -> None:
        """Raises DataError unless each frame that is done is there, in a file of its own or in a piece."""
        done = read_lines(self._journal, self._line)
        count = sum(len(line["t_us"]) for line in done)
        self._pieces.check(count)
        wanted = {self._path(number) for number in range(self._pieces.stop, count)}
        found = set(self._frames.iterdir())
        if missing := wanted - found:
            raise DataError(f"{min(missing)} is not there any more; --overwrite starts again")
        for path in found - wanted:
            path.unlink()
        self.done = done
        self._encode(PIECE)

    def _is_same(self, path: Path) -> bool:
        return is_of_job(path, self.job, self.output, self.overwrite)

    def _encode(self, least: int) -> None:
        """Of a film, make a piece of the frames that wait, if there are so many."""
        if self.kind != "mp4":
            return
        first, stop = self._pieces.stop, self.count
        if stop - first < least:
            return
        self._pieces.add((read_codes(self._path(number)) for number in range(first, stop)), first, stop)
        for number in range(first, stop):
            self._path(number).unlink()

    def _path(self, number: int) -> Path:
        return self._frames / f"{number:06d}.{'exr' if self.kind == 'exr' else 'png'}"

    def _memory(self, count: int) -> Path:
        return self.partial / f"memory-{count}.npz"
