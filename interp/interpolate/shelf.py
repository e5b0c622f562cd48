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
import operator
import os
import re
import reprlib
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Literal, Self

import numpy as np

from interp.interpolate.instants import TooFine
from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.light.tags import tag_of
from vid2ev.pictures.film import film_size, join_films, remarks_on_size, write_film
from vid2ev.recording.disk import lock, put_in_place, sync, undisturbed, whole_file, writing
from vid2ev.recording.exposures import read_codes, write_codes
from vid2ev.recording.manifest import as_stated, difference, is_of_job, read_manifest, write_manifest
from vid2ev.sources.images import FRAMES
from vid2ev.untrusted import first_line, json_of, read_arrays, read_text

Kind = Literal["mp4", "png", "exr"]
PIECE = 128  # pictures
LATEST_US = 1 << 60
REMEDY = "make room or access there, or choose another place with -o"


class Shelf:
    """Where frames are put, as a context.

    kind     mp4, a film; png or exr, a folder
    job      what decides the frames, for JSON
    write    writes light or codes to a path, of EXR; None: PNG of the codes
    line     what the line of a stretch has beside its times: int or str
    Raises UsageError where `output` is taken, or was begun with another job, DataError where it cannot be written.
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
        self.partial = output.with_name(f"{output.name}.partial")
        self.finished: dict[str, Any] | None = None  # the manifest, if `resume` finds all done
        self.done: list[dict[str, Any]] = []
        self._line = line
        self._write, self._frames, self._pieces = write, self.partial / "frames", self.partial / "pieces"
        self._whole = self.partial / "whole"
        self._lock: int | None = None
        self._begun = False

    def __enter__(self) -> Self:
        check_free(self.output, self.kind, self.overwrite, self.resume)
        try:
            with self.writing(), undisturbed():
                self.partial.mkdir(parents=True, exist_ok=True)
                self._lock = lock(self.partial)
                self._begin()
                self._begun = True
        except BaseException as error:
            self.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._lock is None:
            return
        if self._begun and (not self.done or isinstance(error, TooFine)):
            shutil.rmtree(self.partial, ignore_errors=True)
        os.close(self._lock)

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
        return writing(self.output, REMEDY)

    def put(self, number: int, picture: np.ndarray) -> None:
        """A frame."""
        path = self._path(number)
        beside = path.with_name(f"new{path.suffix}")
        self._write(beside, picture)
        sync(beside)
        beside.replace(path)

    def stretch(self, line: Mapping[str, Any], memory: Mapping[str, np.ndarray] | None = None) -> None:
        """All frames of a stretch are there: `t_us` of the line has their times."""
        sync(self._frames)
        if memory:
            with whole_file(self.partial / f"memory-{len(self.done) + 1}.npz") as file:
                np.savez(file, allow_pickle=False, **memory)
        with open(self.partial / "done.jsonl", "a", encoding="utf-8") as lines:
            lines.write(json.dumps(line) + "\n")
            lines.flush()
            os.fsync(lines.fileno())
        self.done.append(dict(line))
        self._memory(len(self.done) - 1).unlink(missing_ok=True)
        self._encode(PIECE)

    def memory(self) -> dict[str, np.ndarray]:
        """What was kept with the last stretch that is done."""
        path = self._memory(len(self.done))
        if not path.exists():
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
                join_films(film, [(piece, first) for piece, first, _ in self._found()], self.rate)
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
        if self.resume and job.exists() and self._frames.exists() and self._is_same(job):
            self._take_up()
            return
        if self.resume and self.output.exists() and made.exists() and self._is_same(made):
            self.finished = read_manifest(made)
            return
        for path in self.partial.iterdir():
            if path.name != "lock":
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        self._frames.mkdir()
        self._pieces.mkdir()
        with whole_file(job) as file:
            file.write(json.dumps(self.job, indent=2).encode())

    def _take_up(self) -> None:
        journal = self.partial / "done.jsonl"
        lines = journal.read_bytes().split(b"\n")[:-1] if journal.exists() else []  # (the rest was cut off in writing)
        with as_stated(journal):
            self.done = [_line_of(line, self._line) for line in lines]
        with whole_file(journal) as file:
            file.write(b"".join(line + b"\n" for line in lines))
        encoded = max([stop for *_, stop in self._found()], default=0)
        for path in self._frames.iterdir():
            if not path.stem.isdecimal() or not encoded <= int(path.stem) < self.count:
                path.unlink()
        self._encode(PIECE)

    def _is_same(self, path: Path) -> bool:
        return is_of_job(path, self.job, self.output, self.overwrite)

    def _encode(self, least: int) -> None:
        """Of a film, make a piece of the frames that wait, if there are so many."""
        if self.kind != "mp4":
            return
        first = max([stop for *_, stop in self._found()], default=0)
        stop = self.count
        if stop - first < least:
            return
        aside = self.partial / "piece.mp4"
        pictures = (_rgb(read_codes(self._path(number))) for number in range(first, stop))
        write_film(aside, pictures, self.rate, tag_of(self.job["transfer"]))
        sync(aside)
        aside.replace(self._pieces / f"{first:06d}-{stop:06d}.mp4")
        sync(self._pieces)
        for number in range(first, stop):
            self._path(number).unlink()

    def _found(self) -> list[tuple[Path, int, int]]:
        """The pieces, in order, each with the number of its first frame and of the one after its last."""
        named = ((path, re.fullmatch(r"(\d{6,12})-(\d{6,12})", path.stem)) for path in self._pieces.glob("*.mp4"))
        return sorted([(path, int(of[1]), int(of[2])) for path, of in named if of], key=lambda piece: piece[1])

    def _path(self, number: int) -> Path:
        return self._frames / f"{number:06d}.{'exr' if self.kind == 'exr' else 'png'}"

    def _memory(self, count: int) -> Path:
        return self.partial / f"memory-{count}.npz"


def _line_of(text: bytes, wanted: Mapping[str, type]) -> dict[str, Any]:
    """A line of the journal.  Raises KeyError, TypeError, ValueError for what is none."""
    line = json_of(text)
    numbers = [*map(operator.index, line["t_us"])]
    for key, kind in wanted.items():
        if type(line[key]) is not kind:
            raise TypeError(f"{key} = {reprlib.repr(line[key])}")
        numbers += [line[key]] if kind is int else []
    if any(abs(number) >= LATEST_US for number in numbers):
        raise ValueError("times beyond all clocks")
    return line


def kind_of(output: Path | None, asked: str | None) -> Kind:
    """What is made: as asked, or as the name says.  Raises UsageError if both differ."""
    suffix = "" if output is None or output.is_dir() else output.suffix.lower()
    if asked is None and suffix not in ("", ".mp4"):
        raise UsageError(
            f"{output}: '{suffix}' cannot be made; expected .mp4, or a folder's name without a dot, or --format png"
        )
    if asked is None:
        return "mp4" if output is None or suffix else "png"
    if asked not in ("mp4", "png", "exr") or (output is not None and (asked == "mp4") != (suffix == ".mp4")):
        wanted = "a name that ends in .mp4" if asked == "mp4" else "the name of a folder"
        raise UsageError(f"format {asked} to {output}: expected {wanted}, and mp4, png or exr")
    return asked  # type: ignore[return-value]


def manifest_of(output: Path, kind: str) -> Path:
    """Where the manifest of an output is."""
    return output.with_suffix(".json") if kind == "mp4" else output / FRAMES


def check_free(output: Path, kind: Kind, overwrite: bool, resume: bool) -> None:
    """Raise UsageError unless frames may be written to `output`; touches nothing."""
    if kind != "mp4":
        if output.name in ("", "..") or output.is_mount() or os.path.realpath(output) == os.getcwd():
            raise UsageError(f"{output} cannot be renamed into place; give a folder within it, such as {output / 'x'}")
        held = {path.name for path in output.iterdir()} if output.is_dir() else set()
        ours = {"timestamps.txt", FRAMES}
        if others := [name for name in held - ours if not (name[:-4].isdecimal() and name[-4:] in (".png", ".exr"))]:
            raise UsageError(f"{output} holds other files ({min(others)}); choose another folder with -o")
    begun = (output.with_name(f"{output.name}.partial") / "job.json").exists()
    beside = manifest_of(output, kind)
    if kind == "mp4" and beside.exists() and not (overwrite or _is_manifest(beside)):
        raise UsageError(f"{beside} is to be the film's manifest, and is another file; choose another name with -o")
    if output.exists() and not (overwrite or resume):
        raise UsageError(f"{output} exists; --overwrite replaces it, -o chooses another place")
    if begun and not (overwrite or resume):
        raise UsageError(f"{output} was begun and not finished; --resume continues it, --overwrite starts again")
    if output.exists() and resume and not overwrite and not begun and not beside.exists():
        raise DataError(f"{output} has no manifest to go on by; --overwrite replaces it")


def _is_manifest(path: Path) -> bool:
    """Whether a file says of a film what `Shelf.publish` writes of one."""
    try:
        return "film_rate" in json_of(read_text(path))
    except (OSError, ValueError, TypeError, DataError):
        return False


def _rgb(codes: np.ndarray) -> np.ndarray:
    return codes if codes.ndim == 3 else np.repeat(codes[..., None], 3, axis=2)
