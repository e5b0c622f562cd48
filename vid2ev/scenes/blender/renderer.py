"""Cycles as a renderer of worlds.

    with Cycles(samples=16) as cycles:
        world = World(scene, renderer=cycles)     # pictures by Cycles; flow, poses and instants as ever

Depth and things are those at the centres of the pixels, and true flow follows from them (`scenes.flow`), exact for any
motion.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Self

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.destination import check_folder
from vid2ev.recording.disk import writing
from vid2ev.recording.held import Held
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.blender.answer import read_answers
from vid2ev.scenes.blender.exchange import Exchange
from vid2ev.scenes.blender.program import Blender, find_blender
from vid2ev.scenes.render import Picture
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world import World
from vid2ev.terminal import counted
from vid2ev.untrusted import openexr

SAMPLES = 32


class Cycles:
    """Blender's renderer, as a context; the process is started by the first picture.

    samples  of each pixel's light
    folder   for the exchange; what is rendered stays there, and is not rendered again.  By default one that goes away
    program  Blender, or a Python that has bpy (`program.py`)
    threads  that render; None for all cores

    Raises UsageError where there is no Blender or a package is missing.
    """

    def __init__(
        self,
        samples: int = SAMPLES,
        folder: Path | None = None,
        *,
        program: str | None = None,
        threads: int | None = None,
    ):
        if not 1 <= samples <= 1 << 16:
            raise UsageError(f"{samples} samples must be 1 to 65536; {SAMPLES} are usual")
        openexr("renderer 'blender'")
        self.program, self.samples, self.threads = find_blender(program), samples, threads
        self._temporary = tempfile.TemporaryDirectory(prefix="vid2ev-blender-") if folder is None else None
        self._folder = Path(self._temporary.name) if self._temporary else Path(folder or "")
        self._exchange: Exchange | None = None
        self._blender: Blender | None = None
        self._version, self._pictures, self._seconds = "", 0, 0.0

    def __call__(self, snapshot: Snapshot, intrinsics: Intrinsics, pose: Pose) -> Picture:
        """What a camera with this pose (camera to world) sees.

        Raises UsageError for a lens with distortion, DataError if Blender fails or the folder cannot be written.
        """
        with writing(self._folder):
            request = self._made().request(snapshot, intrinsics, pose)
        if not all(answer.exists() for answer in request.answers):
            blender, began_s = self._running(), monotonic()
            try:
                blender.ask(request.path)
            except DataError:  # (it has ended)
                self._blender = None
                raise
            self._pictures, self._seconds = self._pictures + 1, self._seconds + monotonic() - began_s
        picture = read_answers(request.answers, intrinsics.size, request.larger)
        if self._temporary:
            for path in (request.path, *request.answers):
                path.unlink()
        return picture

    def describe(self) -> str:
        """Which Blender has rendered how much, on a line; empty if it had nothing to do."""
        if not self._pictures:
            return ""
        each_s = self._seconds / self._pictures
        return f"Blender {self._version}, Cycles: {counted(self._pictures, 'picture')}, {each_s:.2g} s each"

    def close(self) -> None:
        """End Blender."""
        if self._blender is not None:
            self._blender.close()
            self._blender = None
        if self._temporary:
            self._temporary.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _running(self) -> Blender:
        if self._blender is None:
            self._blender = Blender(self.program)
            self._version = self._blender.version
        return self._blender

    def _made(self) -> Exchange:
        if self._exchange is None:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._exchange = Exchange(self._folder, self.samples, self.threads)
        return self._exchange


@contextmanager
def renderer_beside(directory: Path, samples: int | None = None, program: str | None = None) -> Iterator[Cycles]:
    """Cycles for what is to be in a folder; until that is there, what is rendered stays beside it, in NAME.cycles."""
    check_folder(directory)  # (of some there is no place beside)
    folder = directory.with_name(f"{directory.name}.cycles")
    with Cycles(SAMPLES if samples is None else samples, folder, program=program) as cycles:
        try:
            yield cycles
        except BaseException:
            if not any(folder.glob("*.exr")):
                _remove(folder, directory)
            raise
    _remove(folder, directory)


def _remove(folder: Path, directory: Path) -> None:
    """Remove what was rendered for a folder, unless another process is writing that (`disk.whole`): it is its own."""
    with suppress(UsageError, OSError), Held(directory.with_name(f"{directory.name}.new")):
        shutil.rmtree(folder, ignore_errors=True)


def render_with_blender(
    world: World,
    instants: Sequence[int],
    folder: Path | None = None,
    *,
    intrinsics: Intrinsics | None = None,
    pose_in_rig: Pose = IDENTITY,
    samples: int = SAMPLES,
    program: str | None = None,
) -> Iterator[Picture]:
    """What a camera of a world sees at instants [ns], one after the other; see `Cycles` for the rest."""
    with Cycles(samples, folder, program=program, threads=world.threads) as cycles:
        for t_ns in instants:
            pose = world.camera_pose(t_ns) @ pose_in_rig
            yield cycles(world.snapshot(t_ns), intrinsics or world.intrinsics, pose)
