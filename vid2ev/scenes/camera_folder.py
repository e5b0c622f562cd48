"""What one camera saw of a scene, as files.

000000.png ...       its pictures
timestamps.txt       when [ns], a line for each of them
intrinsics.json      its lens and pixels
poses.txt            camera to world, as TUM's benchmark has it (`recording/pose_text.py`)
depth/000000.npy     z in the camera's coordinates [m], inf where nothing is (`recording/depth_files.py`)
flow/000000.npz      from this picture to the next [px], NaN where it is unknown (`recording/flow_files.py`)
preview.mp4          for people
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.light.tags import tag_of
from vid2ev.pictures.film import Film
from vid2ev.recording.depth_files import write_depth
from vid2ev.recording.flow_files import write_flow
from vid2ev.recording.pose_text import HEADER, pose_lines
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens_file import write_lens
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.picture_writing import writer_of
from vid2ev.scenes.reel import Reel
from vid2ev.scenes.world import World

TRUTH = {"depth": ("npy", "exr", "png"), "flow": ("npz", "flo", "png"), "poses": ("txt",)}  # the first by default
PREVIEW_FPS = 30


@dataclass(frozen=True)
class Contents:
    """What is written of each camera.

    frames   png, png16, tiff or exr
    truth    names of TRUTH, with a format or without: depth, depth:png, flow, flow:flo, poses
    preview  a film, too

    Raises UsageError for what cannot be meant.
    """

    frames: str = "png"
    truth: Sequence[str] = ("poses",)
    preview: bool = True
    formats: dict[str, str] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        writer_of(self.frames)
        for text in self.truth:
            name, _, kind = text.partition(":")
            if name not in TRUTH or kind not in ("", *TRUTH[name]):
                known = ", ".join(f"{one}:{'|'.join(kinds)}" for one, kinds in TRUTH.items())
                raise UsageError(f"truth '{text}': expected some of {known}")
            kind = kind or TRUTH[name][0]
            if self.formats.setdefault(name, kind) != kind:
                raise UsageError(f"truth '{text}': {name} is to be {self.formats[name]} as well; give one format of it")

    def describe(self) -> str:
        """On a line."""
        return f"frames {self.frames}; truth {', '.join(self.truth) or 'none'}; preview {self.preview}"


class CameraFolder:
    """The files of a camera while they are written, as a context: `add` an instant after the other."""

    def __init__(
        self,
        folder: Path,
        world: World,
        contents: Contents,
        intrinsics: Intrinsics | None = None,
        pose_in_rig: Pose = IDENTITY,
    ):
        self.folder, self.world, self.contents = folder, world, contents
        self.camera = intrinsics or world.intrinsics, pose_in_rig
        self._reel = Reel(world, *self.camera)
        self.count = 0
        self._write, self._suffix = writer_of(contents.frames)
        self._open = ExitStack()

    def __enter__(self) -> Self:
        for name in ("", *(name for name in ("depth", "flow") if name in self.contents.formats)):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        intrinsics = self.camera[0]
        write_lens(self.folder, intrinsics)
        self._times = self._open.enter_context(open(self.folder / "timestamps.txt", "w", encoding="ascii"))
        self._times.write("# unit: ns\n")
        if "poses" in self.contents.formats:
            self._poses = self._open.enter_context(open(self.folder / "poses.txt", "w", encoding="ascii"))
            self._poses.write(HEADER)
        if self.contents.preview:
            self._film = self._open.enter_context(_Preview(self.folder / "preview.mp4", intrinsics.size))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.__exit__(kind, error, trace)

    def add(self, t_ns: int, next_ns: int | None) -> None:
        """Render and write what is seen at an instant, and the flow to the next one, if there is one."""
        (picture, _), number, truth = self._reel.picture(t_ns), f"{self.count:06d}", self.contents.formats
        self._write(picture.light, self.folder / f"{number}{self._suffix}")
        self._times.write(f"{t_ns}\n")
        if "poses" in truth:
            pose = self.world.camera_pose(t_ns) @ self.camera[1]
            self._poses.write(pose_lines(np.array([t_ns]), pose.translation_m[None], pose.quaternion()[None]))
        if "depth" in truth:
            write_depth(self.folder / "depth" / f"{number}.{truth['depth']}", picture.depth)
        if "flow" in truth and next_ns is not None:
            shift = self.world.flow(t_ns, next_ns, picture, *self.camera).shift
            write_flow(self.folder / "flow" / f"{number}.{truth['flow']}", shift)
        if self.contents.preview:
            self._film.show(picture.light, next_ns)
        self.count += 1


class _Preview(Film):
    """A film that shows, PREVIEW_FPS times a second, the newest picture: number k that of (k + 1/4) / PREVIEW_FPS s, so
    that times which are rounded are shown in step.  The last picture is shown once."""

    def __init__(self, path: Path, size: tuple[int, int]):
        super().__init__(path, size, PREVIEW_FPS, tag_of("srgb"))

    def show(self, light: np.ndarray, next_ns: int | None) -> None:
        """Show the picture for as long as it is the newest: up to the instant of the next one, if there is one."""
        if next_ns is None:
            self.add(srgb_codes(light))
            return
        while (4 * self.frames + 1) * 10**9 < 4 * PREVIEW_FPS * next_ns:
            self.add(srgb_codes(light))
