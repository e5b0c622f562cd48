"""What clips are to be made of, looked at before the first is made.

So training ends in its first seconds for want of data, not hours later when what cannot be used happens to be drawn.
"""

from __future__ import annotations

from collections.abc import Sequence

from interp.data.recorded import left_out
from interp.data.settings import ClipSettings
from interp.data.video_shots import check_film


def unusable(settings: ClipSettings, films: Sequence[str] = ()) -> list[str]:
    """The recordings that give no clips, each with the reason.

    films   videos beside those of the settings
    Raises UsageError for a film that is too short or too small, or where no recording gives a clip, DataError for what
    cannot be read.
    """
    found: dict[str, None] = {}
    for multiple in settings.multiples:
        for film in [*(settings.video_files if settings.videos > 0 else ()), *films]:
            check_film(film, settings.size, multiple)
        if settings.recordings > 0:
            found |= dict.fromkeys(left_out(settings, multiple))
    return list(found)
