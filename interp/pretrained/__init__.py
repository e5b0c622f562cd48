"""Weights that come with the package: `NAME-SIZE.safetensors` beside this file, such as
`rrin_events_guided-tiny.safetensors`, each with a card that says where it comes from and what it scores.

What is used where nothing is asked for stands first.
"""

from __future__ import annotations

import os
from pathlib import Path

from vid2ev.errors import UsageError, nearest

OF_RUN = "weights.safetensors"  # of a run of training
HERE = Path(__file__).parent
WITH_EVENTS = ("rrin_events_guided-small", "rrin_events_guided-tiny")
OF_FRAMES = ("rrin_light-small", "rrin_light-tiny")
OF_EVENTS = ("e2vid-small", "e2vid-tiny", "firenet-paper", "firenet-small", "firenet-tiny")
HDR = ("hdr-small", "hdr-tiny")


def path_of(weights: str | Path) -> Path:
    """A file of weights: itself, that of a run's folder, or by its name, with _ or -, one that comes with this version.

    Raises UsageError where there is no such file, or none yet of a run, DataError for a pipe or a device.
    """
    from vid2ev.untrusted import check_file

    folder = path = Path(str(weights))
    is_folder = os.path.isdir(path)  # (Path.is_dir and Path.exists raise OSError for a name that is too long)
    if is_folder:
        path = path / OF_RUN
    if os.path.exists(path):
        check_file(path)
        return path
    if is_folder and (folder / "run.json").exists():  # (one may be called like weights that come with this version)
        raise UsageError(
            f"weights {weights}: a run without {OF_RUN}, which is there from its first validation on; go on with it"
            " (--resume), or name other weights"
        )
    here = {file.stem: file for file in sorted(HERE.glob("*.safetensors"))}
    asked = str(weights).replace("-", "_")
    found = next((file for name, file in here.items() if name.replace("-", "_") == asked), None)
    if found is None:
        what = f"a folder without {OF_RUN}" if is_folder else "no such file"
        raise UsageError(
            f"weights {weights}: {what}, and none of those that come with vid2ev"
            f"{nearest(str(weights), here)}: {', '.join(here)}"
        )
    return found


def name_of(weights: Path) -> str:
    """What a network is called: like the file of its weights, or like the folder of its run."""
    return weights.parent.name if weights.name == OF_RUN and weights.parent.name else weights.stem


def first(names: tuple[str, ...]) -> Path | None:
    """The weights of the first of some names that come with this version; None if there are none."""
    paths = (HERE / f"{name}.safetensors" for name in names)
    return next((path for path in paths if path.exists()), None)
