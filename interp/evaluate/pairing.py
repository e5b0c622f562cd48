"""Which frames the pictures are of that others have made of a sequence, sorted by name.

    as many as frames             one for each, the first is a key frame
    as many as are rebuilt        one for each of those of all gaps, or of those asked for; key frames are left out
    as many as are skipped        likewise, where others are rebuilt than were skipped; or as are scored of these
    else                          by the number that their names end in: 0 is the first frame, a key frame; or that
                                  of the sequence's own picture, where these are numbered otherwise

Of the last two, that which has pictures of frames that are scored alone; where both or neither have, the first.
Numbers without a gap are counted; those with gaps are of frames, unless they are those of the rebuilt frames by their
own count, or as many as these, and of frames that are scored alone if 1 is the first.  Where a count from 0 may be
either, nobody can tell.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from interp.evaluate.protocol import Protocol
from vid2ev.errors import DataError
from vid2ev.terminal import counted

Frames = tuple[int | None, ...]  # that pictures are of, in order; None where there is no frame of the truth


class Paired(NamedTuple):
    """Pictures by the number of the frame that each is of; and how they were paired, where that is not plain."""

    files: dict[int, Path]
    remark: str = ""


class Reading(NamedTuple):
    """What as many pictures may be of."""

    frames: Frames
    said: str = ""


class Numbers(NamedTuple):
    """The numbers that names end in, in order; none where some have none, or two the same."""

    of: list[int]

    @classmethod
    def of_names(cls, files: Sequence[Path]) -> Numbers:
        """Those of files."""
        ends = [re.search(r"(\d+)\D*$", path.stem) for path in files]
        numbers = [int(end[1]) for end in ends if end]
        return cls(numbers if len({*numbers}) == len(files) else [])

    @property
    def gapless(self) -> bool:
        """Whether they are a count."""
        return bool(self.of) and max(self.of) - min(self.of) < len(self.of)

    def counted_from(self, *first: int) -> bool:
        """Whether they are a count from one of these."""
        return self.gapless and min(self.of) in first


class Gaps(NamedTuple):
    """The gaps of a sequence of frames: from its first key frame on, as many as a limit asks for."""

    frames: int
    protocol: Protocol
    begin: int
    limit: int | None

    @property
    def every(self) -> int:
        """How many gaps there are."""
        return max(self.frames - 1 - self.begin, 0) // self.protocol.multiple

    @property
    def asked(self) -> int:
        """How many of them are asked for."""
        return self.every if self.limit is None else min(self.limit, self.every)

    @property
    def rebuilt(self) -> list[int | None]:
        """Places in a gap of the frames that are rebuilt; None where no frame was."""
        places: dict[int, int] = dict(zip(self.protocol.picked, self.protocol.positions, strict=True))
        return [places.get(k) for k in range(self.protocol.insert)]

    @property
    def skipped(self) -> list[int | None]:
        """Places in a gap of the frames between the key frames."""
        return [*range(1, self.protocol.multiple)]

    @property
    def scored(self) -> set[int | None]:
        """The frames that are scored, of all gaps."""
        return {*self.within([*self.protocol.positions], self.every)}

    def within(self, places: Sequence[int | None], gaps: int, keys: bool = False) -> Frames:
        """The frames at places of the first gaps, and key frames around each if these are there, too."""
        multiple = self.protocol.multiple
        inner = [0, *places] if keys else places
        firsts = [self.begin + gap * multiple for gap in range(gaps)]
        found = [place if place is None else first + place for first in firsts for place in inner]
        return (*found, self.begin + gaps * multiple) if keys else (*found,)


def paired(
    files: Sequence[Path],
    frames: int,
    protocol: Protocol,
    begin: int = 0,
    limit: int | None = None,
    own: Sequence[int] = (),
) -> Paired:
    """Pictures, in order of their names, by the number of the frame that each is of.

    frames   how many the sequence has
    begin    the first key frame
    limit    gaps that are asked for, from the first on; None for all
    own      numbers of the sequence's own pictures, if it has any
    Raises DataError where there is no telling.
    """
    if not files:
        return Paired({})
    gaps, numbers = Gaps(frames, protocol, begin, limit), Numbers.of_names(files)
    for readings in (_promised(gaps, numbers), _likely(gaps, numbers), _with_keys(gaps, numbers)):
        fitting = {each.frames: each for each in readings if len(each.frames) == len(files)}
        if len(fitting) > 1:
            raise _unknown(files, gaps, numbers)
        for found in fitting.values():
            files_of = {frame: path for frame, path in zip(found.frames, files, strict=True) if frame is not None}
            return Paired(files_of, f"{counted(len(files), 'picture')}, {found.said}" if found.said else "")
    if its_own := _of_own(files, gaps, numbers, own):
        return its_own
    many = f"{counted(len(files), 'picture')} for {counted(frames, 'frame')}"
    from_1 = _only_from_1(gaps, numbers)
    if from_1 and len(files) in (len(gaps.within(gaps.rebuilt, count)) for count in (gaps.every, gaps.asked)):
        named = {number - 1: path for number, path in zip(numbers.of, files, strict=True)}
        return Paired(named, f"{many}, {_by_number(numbers, 1)}")
    if not _of_frames(gaps, numbers):
        raise _unknown(files, gaps, numbers)
    plain = protocol.insert == protocol.skip and not numbers.counted_from(0) and max(numbers.of) < frames
    plain &= not from_1 and (not own or [*own] == [*range(frames)])
    remark = "" if plain else f"{many}, {_by_number(numbers)}"
    return Paired(dict(zip(numbers.of, files, strict=True)), remark)


def _promised(gaps: Gaps, numbers: Numbers) -> Iterator[Reading]:
    """One for each frame, or for each that is rebuilt."""
    yield Reading((*range(gaps.frames),))
    beyond = bool(numbers.of) and max(numbers.of) >= gaps.frames
    for count in dict.fromkeys((gaps.every, gaps.asked)):
        partly = count < gaps.every
        counted = numbers.counted_from(0, 1) if partly else numbers.gapless
        if counted or beyond or not numbers.of or numbers.of == _own_count(gaps, count):
            yield Reading(gaps.within(gaps.rebuilt, count), _limited(gaps, count))


def _likely(gaps: Gaps, numbers: Numbers) -> Iterator[Reading]:
    """One for each that was skipped, or is scored, where these are others than are rebuilt."""
    if numbers.of and not numbers.counted_from(0, 1):
        return
    for count in dict.fromkeys((gaps.every, gaps.asked)):
        for places, what in ((gaps.skipped, "are skipped"), ([*gaps.protocol.positions], "are scored")):
            if places != gaps.rebuilt:
                yield Reading(gaps.within(places, count), f"taken for the frames that {what} in {_of(count)}")


def _with_keys(gaps: Gaps, numbers: Numbers) -> Iterator[Reading]:
    """A count from 0 of frames, or of what is rebuilt and the key frames around."""
    if not numbers.counted_from(0):
        return
    for count in dict.fromkeys((gaps.every, gaps.asked)):
        for places, what in ((gaps.skipped, "skipped"), (gaps.rebuilt, "rebuilt")):
            found = gaps.within(places, count, keys=True)
            yield Reading(found, f"taken for the frames {what} in {_of(count)}, and the key frames around them")
            if len(found) == len(numbers.of) < gaps.frames:
                yield Reading((*range(len(found)),), _by_number(numbers))


def _of_frames(gaps: Gaps, numbers: Numbers) -> bool:
    """Whether numbers can be of nothing but frames."""
    protocol, beyond = gaps.protocol, bool(numbers.of) and max(numbers.of) >= gaps.frames
    if not numbers.of or min(numbers.of) >= gaps.frames or (beyond and protocol.insert != protocol.skip):
        return False
    if not numbers.gapless:
        return True
    if protocol.insert != protocol.skip and max(numbers.of) <= (protocol.insert + 1) * gaps.every:
        return False
    if numbers.counted_from(0):  # (of some gaps, or of more than there are, the rebuilt frames may be counted alone)
        count = len(numbers.of)
        return bool(count % protocol.insert) or protocol.insert * gaps.every <= count <= gaps.frames
    return {*numbers.of} <= {*gaps.within(gaps.skipped, gaps.every)}


def _of_own(files: Sequence[Path], gaps: Gaps, numbers: Numbers, own: Sequence[int]) -> Paired | None:
    """Numbers as those of the sequence's own pictures, where these are of frames that are scored alone, and as numbers
    of frames they are not."""
    frame_of = {number: frame for frame, number in enumerate(own)}
    if not numbers.of or not {*numbers.of} <= frame_of.keys():
        return None
    named = [frame_of[number] for number in numbers.of]
    if {*numbers.of} <= gaps.scored or not {*named} <= gaps.scored:
        return None
    taken = f"taken for the frames whose own pictures have the same numbers, {_ends(numbers)}"
    said = f"{counted(len(files), 'picture')}, {taken}"
    return Paired(dict(zip(named, files, strict=True)), said)


def _only_from_1(gaps: Gaps, numbers: Numbers) -> bool:
    """Whether numbers with gaps are all of frames that are scored if 1 is that of the first, and not if it is 0."""
    named = {number - 1 for number in numbers.of}
    return not numbers.gapless and named <= gaps.scored and not {*numbers.of} <= gaps.scored


def _own_count(gaps: Gaps, count: int) -> list[int]:
    """The numbers of rebuilt frames of some gaps in a count of their own, in which key frames are counted, too."""
    whole = gaps.protocol.insert + 1
    return [k for k in range(count * whole) if k % whole]


def _limited(gaps: Gaps, count: int) -> str:
    """That a limit makes it less plain which gaps pictures are of."""
    return f"taken for those rebuilt in {_of(count)}" if gaps.asked < gaps.every else ""


def _by_number(numbers: Numbers, first: int = 0) -> str:
    ends = _ends(numbers)
    return f"taken for the frames of the numbers that their names end in, {ends}, {first} for the first frame"


def _ends(numbers: Numbers) -> str:
    return f"{min(numbers.of)} to {max(numbers.of)}"


def _of(gaps: int) -> str:
    return "the first gap" if gaps == 1 else f"the first {gaps} gaps"


def _unknown(files: Sequence[Path], gaps: Gaps, numbers: Numbers) -> DataError:
    rebuilt = gaps.protocol.insert * gaps.asked
    either = "; without a gap in their numbers these may be counted: leave out key frames" if numbers.gapless else ""
    return DataError(
        f"{files[0].parent}: {counted(len(files), 'picture')} for {counted(gaps.frames, 'frame')}, of which"
        f" {rebuilt} are rebuilt; expected as many as either, or names that end in the number of the frame, from"
        f" 0{either}"
    )
