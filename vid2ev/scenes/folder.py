"""The folder of a rendered scene: there as a whole or not at all.

    scene.toml        the scene with every number settled; its first lines say how it was made
    000000.png ...    what the reference camera saw
    timestamps.txt    when [ns], one line for each of them
    intrinsics.json   the reference camera's lens and pixels
    poses.txt         camera to world, as TUM's benchmark has it: t [s], x y z [m], qx qy qz qw
    depth/000000.npy  float32 [H, W], z in the camera's coordinates [m]; inf where nothing is
    flow/000000.npy   float32 [H, W, 2], from this picture to the next [px]; NaN where it is unknown
    preview.mp4       for people

Source of the text of poses: J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.pictures.film import Film
from vid2ev.recording.disk import lock, sync
from vid2ev.rig.pose import Pose
from vid2ev.scenes.picture_writing import writer_of
from vid2ev.scenes.render import Picture
from vid2ev.scenes.source import SceneSource
from vid2ev.scenes.toml_text import toml_text

TRUTH = ("depth", "flow", "poses")
PREVIEW_FPS = 30
Report = Callable[[int, int], object]  # frames written, of how many


@dataclass(frozen=True)
class Contents:
    """What is written of a scene.

    frames   png, png16, tiff or exr
    truth    of TRUTH
    preview  a film, too

    Raises UsageError for what cannot be meant.
    """

    frames: str = "png"
    truth: Sequence[str] = ("poses",)
    preview: bool = True

    def __post_init__(self) -> None:
        writer_of(self.frames)
        for name in self.truth:
            if name not in TRUTH:
                raise UsageError(f"truth '{name}': expected some of {', '.join(TRUTH)}")


def write_scene(
    directory: Path,
    source: SceneSource,
    contents: Contents,
    how: str = "",
    *,
    overwrite: bool = False,
    resume: bool = False,
    report: Report | None = None,
) -> bool:
    """Render a scene into a folder; False if `resume` finds it made already.

    how  how it was made, in a line; a folder that was made otherwise is not taken for this one

    Raises UsageError where the folder is taken, DataError where it cannot be written.
    """
    said = (
        f"# vid2ev {version('vid2ev')}: {how} (frames {contents.frames}; truth {', '.join(contents.truth) or 'none'})"
    )
    text = f"{said}\n\n{toml_text(source.world.scene.tables())}"
    if _is_made(directory, text, overwrite, resume):
        return False
    with _new_folder(directory) as partial:
        (partial / "scene.toml").write_text(text, encoding="utf-8")
        (partial / "intrinsics.json").write_text(source.world.intrinsics.model_dump_json(indent=2) + "\n")
        _write_all(partial, source, contents, report)
    return True


def _is_made(directory: Path, text: str, overwrite: bool, resume: bool) -> bool:
    if not directory.exists():
        return False
    made = directory / "scene.toml"
    if not made.is_file() and (not directory.is_dir() or any(directory.iterdir())):
        raise UsageError(f"{directory} exists and is no rendered scene; choose another folder with -o")
    if overwrite or not made.is_file():
        return False
    if not resume:
        raise UsageError(f"{directory} exists; --resume leaves it, --overwrite replaces it, -o chooses another folder")
    if made.read_text(encoding="utf-8") != text:
        raise UsageError(f"{directory} was made with other options; --overwrite replaces it, -o chooses another folder")
    return True


@contextmanager
def _new_folder(directory: Path) -> Iterator[Path]:
    """A folder that takes its place when it is whole, and leaves nothing otherwise."""
    partial, replaced = (directory.with_name(f"{directory.name}.{what}") for what in ("partial", "replaced"))
    try:
        partial.mkdir(parents=True, exist_ok=True)
        handle = lock(partial)
        try:
            for path in partial.iterdir():
                if path.name != "lock":
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
            yield partial
            (partial / "lock").unlink()
            sync(partial)
            if directory.exists():
                directory.rename(replaced)
            partial.rename(directory)
            shutil.rmtree(replaced, ignore_errors=True)
        except BaseException:
            shutil.rmtree(partial, ignore_errors=True)
            raise
        finally:
            os.close(handle)
    except (DataError, UsageError):
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(f"{directory} cannot be written: {reason}; make room or access there, or use -o") from error


def _write_all(folder: Path, source: SceneSource, contents: Contents, report: Report | None) -> None:
    write, suffix = writer_of(contents.frames)
    world, instants, total = source.world, source.instants, len(source.instants)
    for name in ("depth", "flow"):
        if name in contents.truth:
            (folder / name).mkdir()
    with ExitStack() as stack:
        times = stack.enter_context(open(folder / "timestamps.txt", "w", encoding="ascii"))
        times.write("# unit: ns\n")
        film = stack.enter_context(_Preview(folder / "preview.mp4", source.size)) if contents.preview else None
        poses = stack.enter_context(open(folder / "poses.txt", "w")) if "poses" in contents.truth else None
        for k in range(total):
            t_ns = instants[k]
            picture = world.render(t_ns)
            write(picture.light, folder / f"{k:06d}{suffix}")
            times.write(f"{t_ns}\n")
            if poses:
                poses.write(tum_line(t_ns, world.camera_pose(t_ns)))
            if "depth" in contents.truth:
                np.save(folder / "depth" / f"{k:06d}.npy", picture.depth)
            if "flow" in contents.truth and k + 1 < total:
                np.save(folder / "flow" / f"{k:06d}.npy", world.flow(t_ns, instants[k + 1], picture)[0])
            if film:
                film.add(picture, t_ns)
            if report:
                report(k + 1, total)


def tum_line(t_ns: int, pose: Pose) -> str:
    """A pose as a line of text."""
    numbers = " ".join(f"{value:.9f}" for value in (*pose.translation_m, *pose.quaternion()))
    return f"{t_ns // 10**9}.{t_ns % 10**9:09d} {numbers}\n"


class _Preview(Film):
    """A film that shows, PREVIEW_FPS times a second, the first picture that is not earlier."""

    def __init__(self, path: Path, size: tuple[int, int]):
        self._width, self._height = (max(2, side - side % 2) for side in size)  # (4:2:0 needs even sides)
        super().__init__(path, (self._width, self._height), PREVIEW_FPS)

    def __enter__(self) -> _Preview:
        return self

    def add(self, picture: Picture, t_ns: int) -> None:  # type: ignore[override]
        """Show the picture, if it is its turn."""
        while t_ns * PREVIEW_FPS >= self.frames * 10**9:
            codes = srgb_codes(picture.light)
            padded = np.pad(codes, ((0, 1), (0, 1), (0, 0)), mode="edge")
            super().add(np.ascontiguousarray(padded[: self._height, : self._width]))
