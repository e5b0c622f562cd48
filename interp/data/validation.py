"""What a network is validated with: clips that it never trains on, always the same."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from interp.data.chance import chance
from interp.data.clip import Clip
from interp.data.making import made
from interp.data.settings import HELD_OUT, ClipSettings

EACH = 4  # clips of a real video
SEED = 0x5EED  # whatever the seed of the training; the draws have names of their own beside


def held_out(settings: ClipSettings) -> ClipSettings:
    """The settings of clips with the photographs that are kept for validation, of scenes and photographs alone."""
    return settings.model_copy(update={"textures": HELD_OUT, "videos": 0.0, "recordings": 0.0} | _plain(settings))


def validation_clips(
    settings: ClipSettings, count: int = 16, videos: Sequence[str | Path] = (), each: int = EACH
) -> list[Clip]:
    """Clips to validate with: `count` of scenes and photographs with textures that training does not see, and `each` of
    every real video, of which K - 1 of K frames are dropped.

    They depend on the settings of the clips alone.  Raises UsageError, DataError for videos that cannot be used.
    """
    clips = [made(held_out(settings), SEED, number) for number in range(count)]
    for video in videos:
        real = settings.model_copy(
            update={"scenes": 0.0, "photographs": 0.0, "recordings": 0.0, "videos": 1.0, "video_files": (str(video),)}
        )
        seed = int(chance(SEED, "video", Path(video).name).integers(1 << 62))
        clips += [made(real, seed, number) for number in range(each)]
    return clips


def _plain(settings: ClipSettings) -> dict[str, float]:
    """Shares of scenes and photographs; halves where training has neither."""
    return {} if settings.scenes + settings.photographs > 0 else {"scenes": 0.5, "photographs": 0.5}
