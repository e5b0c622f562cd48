"""What is interpolated: frames in order of time, and events beside them, one gap after the other.

A new kind is a class that satisfies `Take`, and a line in `open_take`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from interp.representation.dead_time import DeadTime
from interp.representation.event_counts import MOST_NATS
from vid2ev import Events
from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from interp.representation.carried import Look

__all__ = ["AS_IT_IS", "Key", "Options", "Take", "check_contrast", "check_second", "open_take", "refuse_edits"]

LATEST_S = 1e9


@dataclass(frozen=True, slots=True)
class Key:
    """A frame as it came: sRGB codes float32 [H, W, C], C 1 or 3, of which 1 is full code; and when [us].

    known   whether it shows what was there at that instant; otherwise that is to be made, too
    light   linear, float32 [H, W, C], where codes do not hold it to the bit
    """

    t_us: int
    codes: np.ndarray = field(repr=False)
    known: bool = True
    light: np.ndarray | None = field(default=None, repr=False)


class Take(Protocol):
    """Key frames, and events if there are any.

    name         for files
    size         width and height of the frames [px]
    channels     1 or 3
    bits         8 or 16: what holds the codes of its frames as they are
    curve        the transfer curve of a film of it that looks as it does
    coded        that of the codes of its pictures (`interp.own_codes`)
    bright       whether its frames may have light above white
    rate         frames per second, as the file says, or on average
    gaps_expected  how many gaps there should be; None if there is no telling
    event_size   width and height of the event camera [px]; None without one
    contrast     what an OFF and an ON event stand for [nat]; None where nobody knows
    dead_time    how long a pixel is blind after an event; None where nobody knows
    apart        whether the event camera stands elsewhere than the frame camera
    remarks      what a person should know, one sentence each; more may come while it is read
    """

    @property
    def name(self) -> str: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def channels(self) -> int: ...
    @property
    def bits(self) -> int: ...
    @property
    def curve(self) -> str: ...
    @property
    def coded(self) -> str: ...
    @property
    def bright(self) -> bool: ...
    @property
    def rate(self) -> Fraction: ...
    @property
    def gaps_expected(self) -> int | None: ...
    @property
    def event_size(self) -> tuple[int, int] | None: ...
    @property
    def contrast(self) -> tuple[float, float] | None: ...
    @property
    def dead_time(self) -> DeadTime | None: ...
    @property
    def apart(self) -> bool: ...
    @property
    def remarks(self) -> list[str]: ...

    def looks(self, t_us: int) -> tuple[Look, ...]:
        """Where pixels of a key frame may look in the event camera, as far as is known.  Raises DataError."""

    def describe(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """What it is, for JSON; `besides` are files and folders that are made of it."""

    def keys(self, start: int = 0) -> Iterator[Key]:
        """The key frames from index `start` on, their times strictly increasing.  Raises DataError."""

    def events(self, start_us: int, stop_us: int) -> Events | None:
        """The events in (start_us, stop_us], within `event_size`, and of a dead time those before that matter to what
        they stand for; None where they are not known.  Quick if each begins where the one before ended.  Raises
        DataError for files that cannot be read."""


def check_second(second: float | None, option: str) -> None:
    """Raise UsageError for a time [s] that no clock shows."""
    if second is not None and not (isinstance(second, int | float) and abs(second) <= LATEST_S):
        raise UsageError(f"{option} {second}: expected seconds, such as 1.5")


def refuse_edits(path: Path, options: Options) -> None:
    """Raise UsageError for options of videos that a recording cannot have."""
    transfer = None if options.transfer == "auto" else options.transfer
    unfit = {"--crop": options.crop, "--size": options.size, "--transfer": transfer, "--source-fps": options.source_hz}
    if asked := [name for name, value in unfit.items() if value is not None]:
        raise UsageError(f"{path} is a recording, whose frames stay as they are; leave {asked[0]} out")


def check_contrast(contrast: tuple[float, float] | None) -> None:
    """Raise UsageError for what no OFF and ON event stands for."""
    if contrast is not None and not (np.shape(contrast) == (2,) and all(0 < nats <= MOST_NATS for nats in contrast)):
        raise UsageError(
            f"contrast {contrast}: expected nats of an OFF and an ON event, above 0 and at most {MOST_NATS:g}, such as"
            " (0.2, 0.25)"
        )


@dataclass(frozen=True, slots=True)
class Options:
    """How it is read.

    start_s, stop_s   the part to take: on a video's own clock, of a recording after its first frame [s]
    crop, size, transfer   of videos and images, as `vid2ev.open_source` takes them
    source_hz   frames per second, instead of the source's own times
    contrast    what an OFF and an ON event stand for [nat], in place of what the recording says
    refractory_us   how long a pixel is blind after an event, likewise; 0 for not at all
    events      file of the events, where the frames are in another one
    Raises UsageError for times, contrasts and refractory periods that are none.
    """

    start_s: float | None = None
    stop_s: float | None = None
    crop: str | None = None
    size: str | Sequence[int] | None = None
    transfer: str = "auto"
    source_hz: Fraction | None = None
    contrast: tuple[float, float] | None = None
    refractory_us: float | None = None
    events: Path | None = None

    def __post_init__(self) -> None:
        check_second(self.start_s, "--start")
        check_second(self.stop_s, "--stop")
        check_contrast(self.contrast)
        self.dead_time()

    def dead_time(self, said: DeadTime | None = None) -> DeadTime | None:
        """Of an event camera, of which the recording says `said`."""
        return DeadTime.asked(self.refractory_us, said)


AS_IT_IS = Options()


def open_take(path: str | Path, options: Options = AS_IT_IS) -> Take:
    """A recording of `vid2ev convert`, in the HS-ERGB or BS-ERGB layout, an event file with frames, any video or folder
    of images, with events or without, or a single frame with events.

    Raises UsageError for what is none of these, or options that it cannot have, DataError for what is damaged.
    """
    if not isinstance(options, Options):
        raise UsageError(f"options {options!r}: expected Options, as of `interp.interpolate`; leave them out for none")
    if not Path(path).exists():
        raise UsageError(f"{path}: no such file or folder; give a recording, a video or a folder of images")
    from interp.data.layouts import is_sequence
    from interp.interpolate.of_events import FramesBesideEvents, OfEventFile
    from interp.interpolate.of_sequence import OfSequence
    from interp.interpolate.of_source import OfSource
    from interp.interpolate.of_still import OfStill, picture_beside
    from vid2ev.formats import recognise as recognise_events
    from vid2ev.formats.matlab import is_mat
    from vid2ev.sources import is_single_picture

    path = Path(path)
    has_both = is_sequence(path) or is_mat(path) or (path.is_file() and recognise_events(path) is not None)
    if has_both and options.events:
        raise UsageError(f"{path} has events of its own; leave --events {options.events} out")
    if is_sequence(path):
        return OfSequence(path, options)
    if is_mat(path):
        return OfStill(picture_beside(path), path, options)
    if has_both:
        return OfEventFile(path, options)
    if is_single_picture(path):
        events = options.events or path.with_suffix(".mat")
        if options.events or is_mat(events):
            return OfStill(path, events, options)
    return FramesBesideEvents(str(path), options, options.events) if options.events else OfSource(str(path), options)
