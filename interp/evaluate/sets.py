"""From what is named on the command line to footage: recordings, videos and scenes."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from interp.data.layouts import Sequence as Recorded
from interp.data.layouts import opened_in
from interp.evaluate.films import Film
from interp.evaluate.group import Footage
from interp.evaluate.naming import apart, plain
from interp.evaluate.prediction_folders import folder_names
from interp.evaluate.protocol import Protocol
from interp.evaluate.recordings import Recording
from interp.evaluate.simulated import Simulated
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import recognise
from vid2ev.sources import SCENE_PREFIX, check_there, is_scene
from vid2ev.sources.many import sources_in


class Found(NamedTuple):
    """Footage, in order; names of each data set's; and what cannot be used, with the reason."""

    footage: list[Footage]
    sets: dict[str, list[str]]
    unusable: dict[str, str]

    @property
    def reasons(self) -> list[str]:
        """Why each that cannot be used cannot, with its name."""
        return [said if name in said else f"{name}: {said}" for name, said in self.unusable.items()]


def footage_of(
    datasets: Sequence[str],
    protocol: Protocol,
    simulated: Simulated,
    limit: int | None = None,
    besides: Collection[Path] = (),
) -> Found:
    """The footage of data sets: folders with recordings, videos, folders of them or of pictures, `scene:NAME`;
    `besides` are folders that are made of it.

    Raises UsageError for what is none of these, or where nothing can be used.
    """
    places, unusable = list[tuple[str, str | Recorded]](), dict[str, str]()
    datasets = _each_once(datasets)
    for dataset in datasets:
        found, broken = _places(dataset)
        places += [(dataset, place) for place in found]
        unusable |= broken
    footage, sets, called = list[Footage](), dict[str, list[str]](), set_names(datasets)
    names = apart([_called(place) for _, place in places])
    folders = _folders_of(places, names, called)
    for (dataset, place), name, folder in zip(places, names, folders, strict=True):
        try:
            made = _opened(place, protocol, name, simulated, limit, folder, besides)
        except DataError as error:
            unusable[place if isinstance(place, str) else str(place.folder)] = str(error)
            continue
        footage.append(made)
        sets.setdefault(called[dataset], []).append(name)
    everything = Found(footage, sets, unusable)
    if not footage:
        raise DataError(f"nothing in {', '.join(datasets)} can be scored: {'; '.join(everything.reasons[:3])}")
    return everything


def _each_once(datasets: Sequence[str]) -> list[str]:
    """Data sets that are not the same place, however it was written."""
    places = dict[str, str]()
    for each in datasets:
        places.setdefault(each if is_scene(each) else os.path.realpath(each), each)
    return [*places.values()]


def check_simulated(footage: Sequence[Footage], simulated: Simulated | None) -> None:
    """Raise UsageError where it is said how films are seen, and there are none."""
    if simulated is None or any(isinstance(each, Film) for each in footage):
        return
    edits = (f"--{name}" for name in simulated.options)
    raise UsageError(
        f"{footage[0].name} is a recording, whose frames and events stay as they are; leave"
        f" {next(edits, '--sensor, --set and --seed')} out"
    )


def set_names(datasets: Sequence[str]) -> dict[str, str]:
    """What data sets are called: by the ends of their paths, as long as it takes to tell them apart."""
    return dict(zip(datasets, apart(_ends_of(datasets)), strict=True))


def _ends_of(datasets: Sequence[str]) -> list[str]:
    parts = [(each,) if is_scene(each) else Path(each).resolve().parts for each in datasets]
    longest = max(map(len, parts))
    ends = (["/".join(each[-length:]) for each in parts] for length in range(1, longest + 1))
    return next((names for names in ends if len({*map(plain, names)}) == len(names)), list(datasets))


def _folders_of(
    places: Sequence[tuple[str, str | Recorded]], names: Sequence[str], called: Mapping[str, str]
) -> list[tuple[str, ...]]:
    """What folders of others' pictures may be called, of each place."""
    on_disk, several = [_on_disk(place) for _, place in places], len(called) > 1
    ends = dict(zip(called, _ends_of([*called]), strict=True))
    below = [
        [*_below((ends[dataset], called[dataset]), own, dataset, place)] if several else []
        for (dataset, place), own in zip(places, on_disk, strict=True)
    ]
    return folder_names(on_disk, names, below)


def _below(sets: Sequence[str], own: Sequence[str], dataset: str, place: str | Recorded) -> Iterator[str]:
    """The paths of a place below the names of its data set; a data set that is a recording may be its own."""
    for each in sets:
        if not Path(each).is_absolute():
            if "/" in each and Path(dataset) == (Path(place) if isinstance(place, str) else place.folder):
                yield each
            yield from (f"{each}/{name}" for name in own)


def _opened(
    place: str | Recorded,
    protocol: Protocol,
    name: str,
    simulated: Simulated,
    limit: int | None,
    called: tuple[str, ...],
    besides: Collection[Path],
) -> Footage:
    if isinstance(place, str):
        return Film(place, protocol, name, simulated, limit, called, besides)
    return Recording(place, protocol, name, limit, called, besides)


def _places(dataset: str) -> tuple[list[str | Recorded], dict[str, str]]:
    """Recordings, or films by what they are opened with; and what cannot be used."""
    if is_scene(dataset) or not Path(dataset).is_dir():
        _check(dataset)
        return [dataset], {}
    try:
        found, unusable = opened_in(dataset)
    except UsageError:
        return [*sources_in(dataset)], {}
    if any(each.folder == Path(dataset) for each in found):  # (its pictures are no data beside it)
        return [*found], unusable
    recordings = {Path(dataset), *(each.folder for each in found), *map(Path, unusable)}
    beside = [each for each in sources_in(dataset) if Path(each) not in recordings]
    return [*found], unusable | dict.fromkeys(beside, "no recording, in a folder of such; give it by itself")


def _check(dataset: str) -> None:
    """Raise UsageError for what is not there, and for events, of which no frames could be rebuilt and compared."""
    try:
        check_there(dataset)
    except UsageError as error:
        raise UsageError(
            f"{dataset}: no such file or folder; give a recording of vid2ev, HS-ERGB or BS-ERGB, a video or scene:NAME"
        ) from error
    if not is_scene(dataset) and Path(dataset).is_file() and (kind := recognise(dataset)):
        raise UsageError(
            f"{dataset} is an event file ({kind.name}), and what is scored are frames; give a recording of both, a"
            " video or a scene; `vid2ev reconstruct` makes pictures of events alone"
        )


def _called(place: str | Recorded) -> str:
    if not isinstance(place, str):
        return place.folder.resolve().name
    return place.removeprefix(SCENE_PREFIX) if is_scene(place) else Path(place).stem


def _on_disk(place: str | Recorded) -> list[str]:
    """What a place is called on disk: a folder of pictures by the whole of its name, too."""
    folder = isinstance(place, str) and not is_scene(place) and Path(place).is_dir()
    whole = [Path(str(place)).resolve().name] if folder else []
    names = [*whole, _called(place).rpartition("/")[2]]
    return [each for each in dict.fromkeys(names) if each not in ("", ".", "..")]
