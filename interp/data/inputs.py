"""Files and folders that clips are made of: what settings name by a path is known by what is in it.

    inputs    name: digest, as of a copy of it wherever it lies (`vid2ev.recording.manifest.identity`)

What comes with vid2ev, scenes and photographs by their names, is not among them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

from interp.data.settings import ClipSettings
from vid2ev.recording.manifest import identity
from vid2ev.scenes.scene_file import files_named, read_scene, scene_names
from vid2ev.scenes.textures import PHOTOGRAPHS


def digests_of(names: Iterable[str], besides: Collection[Path] = ()) -> dict[str, str]:
    """Digests of those of the names that are paths of files or folders; `besides` are folders that are made of them,
    wherever they are."""
    there = sorted({name for name in names if Path(name).exists()})
    return {name: identity(Path(name), copies=True, deep=True, besides=besides)["sha256"] for name in there}


def inputs_of(settings: ClipSettings, videos: Iterable[str] = (), besides: Collection[Path] = ()) -> dict[str, str]:
    """Those of settings of clips, and of further videos."""
    pictures = (name for name in (*settings.textures, *settings.environments) if name not in PHOTOGRAPHS)
    scenes = (file for name in settings.scene_names for file in _files_of_scene(name))
    return digests_of([*settings.video_files, *settings.recording_folders, *pictures, *scenes, *videos], besides)


def trained_with(settings: ClipSettings, videos: Sequence[str]) -> list[str]:
    """Which of the videos to validate with clips are made of, too, by what is in them, each with what that means."""
    ours = {digest: name for name, digest in digests_of(settings.video_files if settings.videos > 0 else ()).items()}
    known = digests_of(videos)
    return [
        f"{video} is validated with, and trained with as {ours[known[video]]}: its scores are better than of films"
        " that training never sees"
        for video in dict.fromkeys(videos)
        if known.get(video) in ours
    ]


def _files_of_scene(name: str) -> Iterator[str]:
    """The file of somebody's own scene, and its meshes and environment beside it; of those that come along none."""
    if name in scene_names() or not Path(name).is_file():
        return
    yield name
    for table, key, _ in files_named(read_scene(name).tables):
        if key in ("file", "environment") and table[key] not in PHOTOGRAPHS:
            yield str(Path(name).parent / table[key])


def known_by(settings: ClipSettings, *more: object, besides: Collection[Path] = ()) -> str:
    """A short name of clips; those of other settings, other files and others of what else decides have another."""
    said = [settings.model_dump_json(), json.dumps(inputs_of(settings, besides=besides)), *map(str, more)]
    return hashlib.sha256(" ".join(said).encode()).hexdigest()[:12]
