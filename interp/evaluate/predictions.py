"""Pictures that others have made, in folders as the field has them:

    DIR/SEQUENCE/*.png            one method, called like DIR
    DIR/SEQUENCE/METHOD/*.png     several; what is called GT is the truth, and is left alone

How folders are called, `prediction_folders.py` says, and `pairing.py` which frames the pictures are of.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from interp.data.picture_codes import codes_in
from interp.evaluate.group import Footage, Group
from interp.evaluate.naming import plain
from interp.evaluate.pairing import paired
from interp.evaluate.prediction_folders import SUFFIX, folders_in, other_pictures, pictures_in, sequence_folders
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.manifest import identity


@dataclass(frozen=True)
class Predictions:
    """The pictures of a method.

    within     the folder of the method in that of a sequence; None for that one itself
    unpaired   why nobody can tell which frames those of a sequence are of
    """

    name: str
    folder: Path
    within: str | None
    identity: dict[str, Any]
    files: Mapping[int, Path] = field(default_factory=dict)  # by the number of the frame
    unpaired: str = ""
    unfit: dict[str, list[str]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    sequential = True  # (looked at again after a kill, so that what cannot be used is known)

    def begin(self, footage: Footage) -> Self:
        """See `interp.evaluate.rebuilders.Rebuilder`."""
        places = [self.folder / name / (self.within or "") for name in footage.called]
        if not any(place.is_dir() for place in places):
            missing = f"no folder {' or '.join(map(str, places))}"
            return replace(self, files={}, unpaired=missing, unfit={}, remarks=())
        files = next(filter(None, map(pictures_in, places)), [])
        try:
            known, remark = paired(
                files, footage.frames, footage.protocol, footage.begin, footage.limit, footage.numbers
            )
            return replace(self, files=known, unpaired="", unfit={}, remarks=(remark,) if remark else ())
        except DataError as error:
            return replace(self, files={}, unpaired=str(error), unfit={}, remarks=())

    def frames(self, group: Group) -> Sequence[np.ndarray | None]:
        """See `interp.evaluate.rebuilders.Rebuilder`."""
        return [self._picture(group.first + position, group.truth.shape[1:]) for position in group.positions]

    def _picture(self, frame: int, shape: tuple[int, ...]) -> np.ndarray | None:
        if self.unpaired:
            self.unfit.setdefault(self.unpaired, []).append(f"frame {frame}")
        if frame not in self.files:
            return None
        try:
            return _read(self.files[frame], shape)
        except DataError as error:
            self.unfit.setdefault(str(error), []).append(self.files[frame].name)
            return None


def predictions_in(
    folder: str | Path, footage: Sequence[Footage] = (), besides: Collection[Path] = ()
) -> list[Predictions]:
    """The methods whose pictures of footage a folder holds, in order of their names; `besides` are folders that are
    made of them.  Raises UsageError where there are none."""
    folder = Path(folder)
    sequences = sequence_folders(folder, footage)
    inner = sorted({each.name for of in sequences for each in folders_in(of) if pictures_in(each)})

    def known(within: str | None) -> dict[str, Any]:
        others = [each / name for each in sequences for name in inner if name != within]
        return identity(folder, copies=True, deep=True, besides=[*besides, *others])

    found = [Predictions(plain(name), folder, name, known(name)) for name in inner]
    if any(map(pictures_in, sequences)):
        found.insert(0, Predictions(plain(folder.resolve().name), folder, None, known(None)))
    if not found:
        others = "".join(f"; {said}" for said in other_pictures(folder, sequences))
        raise UsageError(
            f"{folder}: no predictions in it; expected SEQUENCE/*{SUFFIX}, or SEQUENCE/METHOD/*{SUFFIX}, in it{others}"
        )
    return found


def _read(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    """A picture of a shape.  Raises DataError, which does not name it, for what is none."""
    try:
        picture = codes_in(path)
    except DataError as error:
        raise DataError(str(error).removeprefix(f"{path}: ")) from error
    if picture is None or picture.shape != shape:
        size = "no picture" if picture is None else f"{picture.shape[1]}x{picture.shape[0]} pixels"
        raise DataError(f"{size}, expected a picture of {shape[1]}x{shape[0]}")
    return picture
