"""The folder of a rendered scene: there as a whole or not at all.

scene.toml   the scene with every number settled; its first line says how it was made
files/       the photographs, meshes and rig that it names, with what these name
...          what the reference camera saw (`camera_folder.py`)
NAME/        what a camera of the scene's rig saw, likewise
"""

from __future__ import annotations

import filecmp
import re
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from vid2ev.errors import UsageError
from vid2ev.recording.destination import check_folder
from vid2ev.recording.disk import whole, writing
from vid2ev.scenes.camera_folder import TRUTH, CameraFolder, Contents
from vid2ev.scenes.own_files import FOLDER, copy_files, with_own_files
from vid2ev.scenes.source import SceneSource
from vid2ev.toml_text import toml_text

Report = Callable[[int, int], object]  # frames written, of how many
FILES = re.compile(  # what a rendered scene holds, beside the folders of cameras
    r"scene\.toml|files|\d{6,}\.(png|tiff|exr)|(timestamps|poses)\.txt|intrinsics\.json|preview\.mp4|depth|flow"
)
WITHIN = re.compile(r"\d{6,}\.(npy|exr|png|npz|flo)|(depth|flow)\.txt")  # what depth and flow are held in
MADE = "# vid2ev "  # how scene.toml begins in a folder that was rendered; a person's own does not


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

    how  how it was made, in a line; a folder that was made otherwise, or of other files, is not taken for this one

    Raises UsageError where the folder is taken, DataError where it cannot be written.
    """
    world = source.world
    source.watched_by((view.intrinsics, view.pose) for view in world.viewpoints)
    said = f"{MADE}{version('vid2ev')}: {_in_a_comment(how)}; {contents.describe()}"
    tables, files = with_own_files(world.scene.tables())
    text = f"{said}\n\n{toml_text(tables)}"
    if _is_made(directory, text, files, overwrite, resume):
        return False
    with writing(directory, "make room or access there, or use -o"), whole(directory) as made:
        made.mkdir()
        (made / "scene.toml").write_text(text, encoding="utf-8")
        copy_files(files, made)
        _write_all(made, source, contents, report)
    return True


def _in_a_comment(text: str) -> str:
    """A text as TOML has it in a comment: names of files may have lines, and letters that are none."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)


def _is_made(directory: Path, text: str, files: Mapping[str, Path], overwrite: bool, resume: bool) -> bool:
    check_folder(directory)
    if not directory.exists() or not any(directory.iterdir()):
        return False
    file = directory / "scene.toml"
    made = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
    if not made.startswith(MADE):
        raise UsageError(f"{directory} exists and is no rendered scene; choose another folder with -o")
    if overwrite:
        _check_replaceable(directory)
        return False
    if not resume:
        raise UsageError(f"{directory} exists; --resume leaves it, --overwrite replaces it, -o chooses another folder")
    if made != text or not _has_copies(directory, files):
        raise UsageError(
            f"{directory} was made with other options or files; --overwrite replaces it, -o chooses another folder"
        )
    return True


def _has_copies(directory: Path, files: Mapping[str, Path]) -> bool:
    """Whether a folder has what `copy_files` would put there."""
    with TemporaryDirectory() as place:
        copy_files(files, Path(place))
        copies = [(copy, directory / copy.relative_to(place)) for copy in Path(place).rglob("*") if copy.is_file()]
        return all(kept.is_file() and filecmp.cmp(copy, kept, shallow=False) for copy, kept in copies)


def _check_replaceable(directory: Path) -> None:
    """Raise UsageError for a rendered scene in which something else was put, which would be gone with it."""
    cameras = [path for path in directory.iterdir() if (path / "intrinsics.json").is_file()]
    held = [path for folder in (directory, *cameras) for path in folder.iterdir() if path not in cameras]
    others = [path for path in held if not FILES.fullmatch(path.name)]
    truth = (path for path in held if path.name in ("depth", "flow") and path.is_dir())
    others += [path for folder in truth for path in folder.iterdir() if not WITHIN.fullmatch(path.name)]
    if others:
        first = min(path.relative_to(directory).as_posix() for path in others)
        raise UsageError(f"{directory} holds files that are no rendered scene ({first}); choose another folder with -o")


def _write_all(folder: Path, source: SceneSource, contents: Contents, report: Report | None) -> None:
    world, total = source.world, len(source.instants)
    times = [*(source.instants[k] for k in range(total)), None]
    with ExitStack() as stack:
        views = [CameraFolder(folder, world, contents)]
        for view in world.viewpoints:
            if view.camera.name in (*TRUTH, FOLDER):
                raise UsageError(f"camera {view.camera.name}: that folder is for {view.camera.name}; rename the camera")
            views.append(CameraFolder(folder / view.camera.name, world, contents, view.intrinsics, view.pose))
        for camera in views:
            stack.enter_context(camera)
        for done, (t_ns, next_ns) in enumerate(pairwise(times), 1):
            assert t_ns is not None
            for camera in views:
                camera.add(t_ns, next_ns)
            if report:
                report(done, total)
