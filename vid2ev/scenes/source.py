"""A scene as a source of frames: rendered at instants that follow its motion, so that nothing is made up in between.

On the command line `scene:NAME`, with settings after commas: `scene:room,seed=3,size=346x260,camera.fov_deg=70`, or a
scene file.  Besides the keys of scene files there are `seed` and `size`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.recording.manifest import identity
from vid2ev.scenes.instants import Eye, Instants, others, rate_of
from vid2ev.scenes.mesh_files import opened_by
from vid2ev.scenes.reel import Reel
from vid2ev.scenes.scene_file import files_named, plain_size, read_scene
from vid2ev.scenes.world import World
from vid2ev.stream.frames import LUMINANCE, Colour, Frame
from vid2ev.stream.still import Still


class Request(NamedTuple):
    """What is asked of a scene: `name` or path, `seed` and `key=value` settings."""

    name: str
    seed: int
    settings: list[str]


class SceneSource:
    """Frames of a world, as the reference camera sees it.

    name    what it was opened by
    fps     frames per second, instead of instants that follow the motion
    memory  of the device that paints the frames (`vid2ev.kernels.cuda.memory`), whose light is then a tensor of torch;
            None for the CPU.  A world with a renderer of its own is not painted there

    Raises UsageError for a rate that cannot be meant.
    """

    rewindable = True
    kept = None
    dense = True  # in time: light is a straight line between two frames, as near as it was asked for

    def __init__(
        self,
        world: World,
        name: str = "scene",
        *,
        seed: int = 0,
        fps: float | Fraction | None = None,
        colour: Colour = "luminance",
    ):
        self.world, self.name, self.seed, self.colour = world, name, seed, colour
        self.size = world.intrinsics.size
        self._fps = None if fps is None else rate_of(fps)
        self._eyes: tuple[Eye, ...] = ()
        self.memory: Any = None

    @cached_property
    def instants(self) -> Instants:
        """When it is rendered."""
        return Instants(self.world, self._fps, self._eyes)

    def watched_by(self, cameras: Iterable[Eye]) -> None:
        """Let the instants suit cameras that see other things than the reference camera, or the same more finely."""
        if eyes := others(self.world, cameras):
            self._eyes = eyes
            vars(self).pop("instants", None)

    @property
    def warnings(self) -> list[str]:
        """Whether it is rendered less often than was asked for."""
        limit = self.world.scene.scene.max_fps
        if self._fps is not None or self.instants.asked_hz <= limit:
            return []
        return [
            f"{self.name}: more changes between two instants than was asked for, as there are {limit:g} a second at"
            " most; raise max_fps"
        ]

    @property
    def frames_expected(self) -> int:
        """How many instants there are."""
        return len(self.instants)

    @property
    def duration_expected_s(self) -> float:
        """From the first instant to the last [s]."""
        return 1e-9 * self.instants[len(self.instants) - 1]

    def describe(self) -> dict[str, Any]:
        """What the scene is, every number settled, and by what its photographs and meshes, with all that these name,
        are known again, for the manifest."""
        return {
            "kind": "scene",
            "path": self.name,
            "seed": self.seed,
            "size": list(self.size),
            "frames_expected": self.frames_expected,
            "duration_expected_s": self.duration_expected_s,
            "scene": self.world.scene.tables(),
            "files": self._files,
        }

    @cached_property
    def _files(self) -> dict[str, Any]:
        """What tells its photographs and meshes, and what these name, from others of these names; a rig is settled."""
        named = {Path(table[key]): key for table, key, _ in files_named(self.world.scene.tables()) if key != "rig"}
        files = [file for file in named if file.is_absolute()]
        files += [beside for file in files if named[file] == "file" for beside in opened_by(file)]
        return {str(file): identity(file) for file in files}

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on; earlier ones are not rendered."""
        return self.frames_between(None, None, start)

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """The frames from `since_ns` to `until_ns`, both included, None without end; from index `start` among these."""
        instants_ns = self.instants_between(since_ns, until_ns, start)
        if self.memory is not None and self.world.renderer is None:
            return (yield from self._painted(instants_ns))
        reel = Reel(self.world)
        before: np.ndarray = np.empty(0)
        for t_ns in instants_ns:
            picture, still = reel.picture(t_ns)
            light = picture.light if self.colour == "rgb" else picture.light @ LUMINANCE
            yield Frame(light, t_ns, still=None if still is None else Still(before, still))
            before = light

    def _painted(self, instants_ns: list[int]) -> Iterator[Frame]:
        """The frames at these instants, from a device."""
        import torch

        from vid2ev.scenes.reel_on_card import ReelOnCard

        for t_ns, picture in zip(instants_ns, ReelOnCard(self.world, self.memory).pictures(instants_ns), strict=True):
            light: Any = torch.as_tensor(picture.light)
            frame = Frame(light, t_ns)
            yield frame if self.colour == "rgb" else replace(frame, light=frame.luminance)

    def instants_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> list[int]:
        """The instants [ns] from `since_ns` to `until_ns`, both included, None without end; from index `start` on."""
        return [self.instants[k] for k in self._indices(since_ns, until_ns, start)]

    def _indices(self, since_ns: int | None, until_ns: int | None, start: int) -> range:
        first = 0 if since_ns is None else self.instants.first_from(since_ns)
        end = len(self.instants) if until_ns is None else self.instants.first_from(until_ns + 1)
        return range(first + start, end)


def open_scene(text: str, *, fps: float | Fraction | None = None, colour: Colour = "luminance") -> SceneSource:
    """The source of `NAME,key=value,...` or of a scene file.  Raises UsageError, DataError."""
    request = parse_request(text)
    world = World(read_scene(request.name, request.settings), request.seed)
    name = text if os.path.exists(text) else f"scene:{text}"
    return SceneSource(world, name, seed=request.seed, fps=fps, colour=colour)


def rig_of_scene(text: str) -> str | None:
    """The rig file that a scene names, of `NAME,key=value,...` or a scene file; None without one.  Raises as
    `open_scene` does."""
    request = parse_request(text)
    return read_scene(request.name, request.settings).resolved(request.seed).scene.rig


def parse_request(text: str) -> Request:
    """What `NAME,key=value,...` asks for; commas within brackets and quotes belong to a value.  Raises UsageError."""
    if os.path.isfile(text):  # (of names that are too long for files, too)
        return Request(text, 0, [])
    name, *parts = split_outside(text)
    seed, settings = 0, []
    for part in parts:
        key, _, value = part.partition("=")
        if key.strip() == "seed":
            if not re.fullmatch(r"\s*\d{1,19}\s*", value):
                raise UsageError(f"scene:{text}: seed '{value}', expected a whole number from 0")
            seed = int(value)
        else:
            settings.append(plain_size(part))
    return Request(name, seed, settings)


def split_outside(text: str) -> list[str]:
    """The parts of a text between commas, but for those within brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for sign in text:
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        depth += (sign in "[{") - (sign in "]}") if not quote else 0
        if sign == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    return parts
