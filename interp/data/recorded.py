"""Clips cut from recordings on disk: real ones, and those that `vid2ev dataset` wrote."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from interp.data.between import events_between
from interp.data.chance import chance
from interp.data.clip import Clip
from interp.data.layouts import Sequence, open_sequence, sequences_in, windows
from interp.data.layouts.own import Own
from interp.data.settings import MULTIPLES, ClipSettings
from interp.data.simulate import kept_counts
from interp.own_codes import in_srgb
from interp.representation.carried import over
from vid2ev.errors import DataError, UsageError
from vid2ev.terminal import counted

MOST_OPENED = 512  # sequences, each of whose event files are looked through as it is opened; 8 bytes per pixel and less


def recorded(settings: ClipSettings, seed: int, number: int, multiple: int) -> Clip:
    """A clip of a recording, drawn for its number: any window, any part of the picture.

    Raises UsageError where no recording has a window of the multiple, or is as large as a clip.
    """
    draw = chance(seed, "recorded", number)
    places, _ = _places(settings.recording_folders, multiple, settings.size)
    folder, first = places[int(draw.integers(len(places)))]
    sequence = _opened(folder)
    left, top = (int(draw.integers(have - want + 1)) for have, want in zip(sequence.size, settings.size, strict=True))
    return clip_of(
        sequence, int(first[int(draw.integers(len(first)))]), multiple, settings.bins, (left, top, *settings.size)
    )


def left_out(settings: ClipSettings, multiple: int) -> list[str]:
    """The recordings of which no clip of the multiple can be cut, each with the reason.

    Raises UsageError where there is none of which one can.
    """
    return _places(settings.recording_folders, multiple, settings.size)[1]


def coarser_by(settings: ClipSettings) -> tuple[int, ...]:
    """How many pixels of frames there are, across, to a pixel of events: of all recordings that give clips, in order.

    Raises UsageError where there is none that does.
    """
    places = (
        place for each in settings.multiples for place in _places(settings.recording_folders, each, settings.size)[0]
    )
    return tuple(sorted({_coarser(_opened(folder)) for folder, _ in places}))


def clip_of(
    sequence: Sequence, first: int, multiple: int, bins: int = 32, part: tuple[int, int, int, int] | None = None
) -> Clip:
    """The clip of a window of a sequence; `part` is left, top, width and height of the picture, all of it by default.

    Where nobody knows the thresholds, `contrast` is fitted to the key frames.  Events of a camera that stands
    elsewhere, or whose pixels are not squares of whole pixels of the frames, are carried into the geometry of the
    frames, as `interpolate` does it.  Of one with larger pixels, left and top move to whole ones.
    """
    left, top, width, height = part or (0, 0, *sequence.size)
    coarser = _coarser(sequence)
    left, top, width, height = (value - value % coarser for value in (left, top, width, height))
    rows, columns = slice(top, top + height), slice(left, left + width)
    truth = np.stack([sequence.frame(first + k)[rows, columns] for k in range(multiple + 1)])
    keys = np.stack([sequence.key(k) for k in (first, first + multiple)])
    times_us = int(sequence.times_us[first]), int(sequence.times_us[first + multiple])
    if _edge_on_edge(sequence):
        below = left // coarser, top // coarser, width // coarser, height // coarser
        counted = events_between(sequence, keys[:, rows, columns], times_us, bins, below)
    else:
        counted = over(events_between(sequence, keys, times_us, bins), sequence.size[::-1], (rows, columns))
    off, on = sequence.contrast or counted.contrast[0].tolist()  # (those that are known, to the last bit)
    about = {"source": "recording", "name": sequence.name, "first": first, "part": [left, top, width, height]}
    about |= {"coarser": coarser, "footprint": max(coarser, counted.footprint)}
    truth, keys = (in_srgb(codes, sequence.curve) for codes in (truth, keys[:, rows, columns]))
    return Clip(truth, keys, kept_counts(counted), (off, on), times_us[1] - times_us[0], about)


def _edge_on_edge(sequence: Sequence) -> bool:
    """Whether pixels of the event camera are squares of whole pixels of the frames."""
    (width, height), (across, down) = sequence.size, sequence.event_size
    return not (sequence.apart or width % across or height % down or width // across != height // down)


def _coarser(sequence: Sequence) -> int:
    """How many pixels of the frames there are, across, to one of the counts in a clip."""
    return sequence.size[0] // sequence.event_size[0] if _edge_on_edge(sequence) else 1


@lru_cache(maxsize=MOST_OPENED)
def _opened(folder: str) -> Sequence:
    return open_sequence(folder)


@lru_cache(maxsize=8)
def _places(
    folders: tuple[str, ...], multiple: int, size: tuple[int, int]
) -> tuple[list[tuple[str, np.ndarray]], list[str]]:
    """Sequences as large as a clip, each with the first frames of its windows, in order of their names; and why others
    have none."""
    found, unfit = list[tuple[str, np.ndarray]](), list[str]()
    for folder in folders:
        paths, unusable = sequences_in(folder)
        unfit += [f"{path}: {reason}".replace(f"{path}: {path}", path) for path, reason in unusable.items()]
        for path in paths:
            try:
                first, reason = _windows_of(path, multiple, size)
            except (DataError, UsageError) as error:
                first, reason = np.empty(0, np.int64), str(error)
            found += [(str(path), first)] * bool(len(first))
            unfit += [reason] * bool(reason)
    if not found:
        raise UsageError(f"no window of {multiple + 1} frames in {', '.join(folders)}: {'; '.join(unfit[:3])}")
    return found, unfit


def _windows_of(path: Path, multiple: int, size: tuple[int, int]) -> tuple[np.ndarray, str]:
    """The first frames of a sequence's windows; and why there are none, or what is not used of it."""
    sequence = _opened(str(path))
    if min(have - want for have, want in zip(sequence.size, size, strict=True)) < 0:
        (wide, high), (width, height) = sequence.size, size
        return np.empty(0, np.int64), (
            f"{path}: frames of {wide}x{high} are smaller than clips, {width}x{height}; give --set clips.size=[W,H] and"
            " --set samples.size=N"
        )
    window = windows(sequence, multiple, even=True)
    if len(window.first) and isinstance(sequence, Own):
        return _between_pictures(sequence, window.first, multiple)
    reasons = [f"{counted(count, 'window')}: {reason}" for reason, count in window.unusable.items()]
    too_few = f"{counted(len(sequence.times_us), 'frame')}, expected {multiple + 1} or more"
    return window.first, "" if len(window.first) else f"{path}: {', '.join(reasons) or too_few}"


def _between_pictures(sequence: Own, first: np.ndarray, multiple: int) -> tuple[np.ndarray, str]:
    """Those windows that go from one picture of the slow camera to another, if it took some so far apart: with its
    noise and blur, which frames of the truth in their place are without."""
    taken = np.array(sequence.key_frames)
    between = np.isin(first, taken) & np.isin(first + multiple, taken)
    if between.any():
        return first[between], ""
    step = int(np.median(np.diff(taken))) if len(taken) > 1 else len(sequence.times_us)
    remedy = f"; --set clips.multiples=[{step}] uses them" if step in MULTIPLES else ""
    return first, (
        f"{sequence.folder}: the pictures of its slow camera, one in {step}: key frames of x{multiple} are of the fast"
        f" one{remedy}"
    )
