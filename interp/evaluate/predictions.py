"""Pictures that others have made, in folders as the field has them:

    DIR/SEQUENCE/*.png            one method, called like DIR
    DIR/SEQUENCE/METHOD/*.png     several; what is called GT is the truth, and is left alone

They are sorted by name and paired with the frames of the sequence by position: the first is frame 0, a key frame.
Where there are as many as frames to rebuild, and fewer than frames, key frames are taken to be left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from interp.evaluate.group import Footage, Group
from interp.evaluate.identity import contents, plain
from vid2ev.errors import DataError, UsageError
from vid2ev.light.picture_files import decoded
from vid2ev.light.recognise import natural

TRUTH = "gt"
SUFFIX = ".png"


@dataclass(frozen=True)
class Predictions:
    """The pictures of a method.

    within   the folder of the method in that of a sequence; None for that one itself
    """

    name: str
    folder: Path
    within: str | None
    identity: dict[str, Any]
    files: tuple[Path, ...] = ()
    with_keys: bool = True
    sequential = False

    def begin(self, footage: Footage) -> Self:
        """See `interp.evaluate.rebuilders.Rebuilder`."""
        folder = self.folder / footage.name
        files = pictures_in(folder / self.within if self.within else folder)
        rebuilt = (footage.frames - 1) // footage.multiple * (footage.multiple - 1)
        return replace(self, files=tuple(files), with_keys=len(files) != rebuilt)

    def frames(self, group: Group) -> Sequence[np.ndarray | None]:
        """See `interp.evaluate.rebuilders.Rebuilder`.  Raises DataError for a picture of another size."""
        multiple = len(group.times_us) - 1
        first = group.first if self.with_keys else group.first - group.first // multiple - 1
        return [self._read(first + position, group.truth.shape[1:]) for position in group.positions]

    def _read(self, place: int, shape: tuple[int, ...]) -> np.ndarray | None:
        import cv2

        if place >= len(self.files):
            return None
        picture = next(iter(decoded(self.files[place], cv2.IMREAD_COLOR)), None)
        if picture is None or picture.shape != shape:
            size = "no picture" if picture is None else f"{picture.shape[1]}x{picture.shape[0]} pixels"
            raise DataError(f"{self.files[place]}: {size}, expected a picture of {shape[1]}x{shape[0]}")
        return picture[..., ::-1]


def predictions_in(folder: str | Path) -> list[Predictions]:
    """The methods whose pictures a folder holds, in order of their names.  Raises UsageError where there are none."""
    folder = Path(folder)
    children = sorted(each for each in folder.iterdir() if each.is_dir()) if folder.is_dir() else []
    inner = sorted({each.name for child in children for each in child.iterdir() if each.is_dir() and pictures_in(each)})
    known = contents(folder) if children else {}
    found = [Predictions(plain(name), folder, name, known) for name in inner if name.lower() != TRUTH]
    if any(pictures_in(child) for child in children):
        found.insert(0, Predictions(plain(folder.resolve().name), folder, None, known))
    if not found:
        raise UsageError(
            f"{folder}: no predictions in it; expected SEQUENCE/*{SUFFIX}, or SEQUENCE/METHOD/*{SUFFIX}, in it"
        )
    return found


def pictures_in(folder: Path) -> list[Path]:
    """The pictures in a folder, in natural order of their names; none where there is no folder."""
    found = folder.iterdir() if folder.is_dir() else ()
    return sorted((path for path in found if path.suffix.lower() == SUFFIX), key=lambda path: natural(path.name))
