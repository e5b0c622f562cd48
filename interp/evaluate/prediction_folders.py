"""Where pictures that others have made of sequences lie, and what lies beside them that is passed over.

DIR/SEQUENCE        called as the sequence is on disk, or in the report
DIR/SET/SEQUENCE    likewise, of several data sets
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from interp.evaluate.group import Footage
from interp.evaluate.remarks import several
from vid2ev.light import recognise

TRUTH = "gt"
SUFFIX = ".png"


def folder_names(
    on_disk: Sequence[Sequence[str]], names: Sequence[str], below: Sequence[Sequence[str]]
) -> list[tuple[str, ...]]:
    """Of each sequence, what a folder of its pictures may be called, the likeliest first.

    on_disk  what it is called there
    names    what it is called in the report
    below    paths that it has in its data set, if there are several sets
    """
    times = Counter(name for each in on_disk for name in {*each})
    alone = [
        [*(each for each in own if times[each] == 1), *([name] if name in own or not times[name] else [])]
        for own, name in zip(on_disk, names, strict=True)
    ]
    taken = {name for each in alone for name in each}
    return [
        tuple(dict.fromkeys([*own, *(path for path in paths if path.partition("/")[0] not in taken)]))
        for own, paths in zip(alone, below, strict=True)
    ]


def sequence_folders(folder: Path, footage: Sequence[Footage]) -> list[Path]:
    """The folders in a folder that are those of sequences, and those that may be of others."""
    return [*_known(folder, footage), *_others(folder, {*_known(folder, footage)})]


def pictures_in(folder: Path) -> list[Path]:
    """The pictures in a folder that can be scored, in natural order of their names; none where there is no folder.

    Hidden files are none: macOS puts ._NAME.png beside NAME.png on disks of others.
    """
    return [path for path in _all_pictures(folder) if path.suffix.lower() == SUFFIX]


def folders_in(folder: Path) -> list[Path]:
    """The folders in a folder but for those of the truth and hidden ones."""
    found = [each for each in folder.iterdir() if each.is_dir()] if folder.is_dir() else []
    return sorted(each for each in found if each.name.lower() != TRUTH and not each.name.startswith("."))


def passed_over(folder: Path, footage: Sequence[Footage]) -> str:
    """What is in a folder of predictions and not scored; nothing if there is nothing."""
    known = _known(folder, footage)
    loose = [each for each in _others(folder, {*known}) if any(map(_all_pictures, [each, *folders_in(each)]))]
    unknown = several(each.relative_to(folder).as_posix() for each in loose)
    said = [f"folders of no sequence that is scored: {unknown}"] if loose else []
    return "; ".join([*said, *other_pictures(folder, known)])


def other_pictures(folder: Path, sequences: Sequence[Path]) -> Iterator[str]:
    """That there are pictures in the folders of sequences, and of methods in these, that are no PNG."""
    places = [place for each in sequences for place in (each, *folders_in(each))]
    found: Mapping[Path, list[Path]] = {
        place: [path for path in _all_pictures(place) if path.suffix.lower() != SUFFIX] for place in places
    }
    names = [path.name for paths in found.values() for path in paths]
    where = several(place.relative_to(folder).as_posix() for place, paths in found.items() if paths)
    if names:
        yield f"pictures that are no PNG: {len(names)} in {where} ({several(names)}); save them as PNG"


def _known(folder: Path, footage: Sequence[Footage]) -> list[Path]:
    """The folders in a folder that are there for sequences."""
    named = dict.fromkeys(folder / name for each in footage for name in each.called)
    return sorted(path for path in named if path.is_dir())


def _others(folder: Path, known: set[Path]) -> Iterator[Path]:
    """Folders that are none of the known ones, and hold none of them."""
    for each in folders_in(folder):
        if each in known:
            continue
        if any(each in path.parents for path in known):
            yield from _others(each, known)
        else:
            yield each


def _all_pictures(folder: Path) -> list[Path]:
    return recognise.pictures_in(folder) if folder.is_dir() else []
