"""What clips are to be made of, looked at before the first is made.

So training ends in its first seconds for want of data, not hours later when what cannot be used happens to be drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from interp.data.recorded import left_out
from interp.data.scene_shots import SPAN_S
from interp.data.settings import ClipSettings
from interp.data.video_shots import check_film
from vid2ev.errors import UsageError, nearest
from vid2ev.light.recognise import recognise
from vid2ev.scenes.scene_file import read_scene
from vid2ev.scenes.textures import PHOTOGRAPHS


def unusable(settings: ClipSettings, films: Sequence[str] = ()) -> list[str]:
    """The recordings that give no clips, each with the reason.

    films   videos beside those of the settings
    Raises UsageError for a film that is too short or too small, for a scene or picture that is not there, or where no
    recording gives a clip, DataError for what cannot be read.
    """
    found: dict[str, None] = {}
    if settings.scenes > 0:
        for name in settings.scene_names:
            _check_scene(name)
        for picture in settings.environments:
            _check_picture("environment", picture)
    if settings.scenes > 0 or settings.photographs > 0:
        for picture in settings.textures:
            _check_picture("texture", picture)
    for multiple in settings.multiples:
        for film in [*(settings.video_files if settings.videos > 0 else ()), *films]:
            check_film(film, settings, multiple)
        if settings.recordings > 0:
            found |= dict.fromkeys(left_out(settings, multiple))
    return list(found)


def _check_scene(name: str) -> None:
    duration_s = read_scene(name).resolved(0).scene.duration_s
    if duration_s < SPAN_S[1]:
        raise UsageError(f"scene {name} lasts {duration_s:g} s; expected {SPAN_S[1]:g} s at least, to cut gaps from")


def _check_picture(what: str, name: str) -> None:
    if name in PHOTOGRAPHS:
        return
    if not Path(name).is_file() or recognise(Path(name)) != "picture":
        raise UsageError(
            f"{what} '{name}'{nearest(name, PHOTOGRAPHS)}: no picture; expected a file, or one of"
            f" {', '.join(PHOTOGRAPHS)}"
        )
