"""Real videos as shots: every K-th frame a key frame, what the film shows in between the truth.

The event camera sees the very stream that the truth is of: the film's frames, and light carried along the motion
between them as `vid2ev convert` does it.  So events know nothing that the truth does not show, and nothing of what the
film did not see.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from interp.data.chance import chance
from interp.data.settings import ClipSettings
from interp.data.shot import AHEAD, Beside, coarse
from vid2ev import DataError, Frame, UsageError, open_source
from vid2ev.sensors.devices import Device
from vid2ev.sources import Source, begins_s, is_single_picture
from vid2ev.stamps import Stamp, stamp
from vid2ev.terminal import counted
from vid2ev.upsample import make_upsampler
from vid2ev.upsample.cuts import CutDetector

TRIES = 8  # places in films that are looked at for one without a cut
SMALLER = (1, 2, 3)  # pixels of the film per pixel of a clip, across
NEARER = (1, 1 / 2, 1 / 4, 0)  # to the film's beginning, as shares of where a place was drawn
THRESHOLD = 0.15  # nat, that motion is looked for with


class VideoShot:
    """A shot of a real video, drawn for a clip.

    gap_us   from key frame to key frame [us]
    Raises UsageError for videos that are too short or too small, DataError for those that cannot be read.
    """

    exposed = True

    def __init__(self, settings: ClipSettings, seed: int, number: int, beside: Beside, multiple: int):
        draw = chance(seed, "video", number)
        for _ in range(TRIES):
            name = settings.video_files[int(draw.integers(len(settings.video_files)))]
            source, begin_s = _opened(name, settings.fps)
            after_s, part = _place(source, name, settings.size, multiple, draw)
            start_s, self._frames = _drawn(source, begin_s, after_s, _wanted(multiple), part, settings.size, name)
            if not _is_cut(self._frames):
                break
        self._multiple, self._before, self._beside = multiple, _before(multiple), beside
        gap_ns = (self._frames[self._before + multiple].t_ns - self._frames[self._before].t_ns) / settings.slowdown
        self.gap_us = settings.bins * max(1, round(gap_ns / 1000 / settings.bins))
        middle = self._frames[self._before + multiple // 2 :][:2]
        self.moved_px = multiple * (make_upsampler("flow", 2).between(*middle).shift_px or 0.0)
        self.about: dict[str, Any] = {"source": "video", "video": name, "start_s": start_s, "part": list(part)}

    def pictures(self, steps: int, first: int, last: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """The light of both cameras (`Shot`); as far before the gap as event cameras watch, and a frame after it."""
        each = steps // self._multiple
        upsampler = make_upsampler("flow", each)
        stream = [self._frames[0]]
        for a, b in pairwise(self._frames):
            stream += upsampler.between(a, b).frames
        for j in range(first, last + 1):
            frame = stream[j + each * self._before]
            yield frame.light, coarse(frame.luminance, self._beside.coarser)

    def on_device(self, device: Device, steps: int, first: int, last: int) -> tuple[Any, Any]:
        """The same on a device (`Shot`), made here: motion is sought on the CPU."""
        import torch

        light, luminance = zip(*self.pictures(steps, first, last), strict=True)
        return tuple(torch.from_numpy(np.stack(each)).to(device.light) for each in (light, luminance))  # type: ignore[return-value]


def _is_cut(frames: list[Frame]) -> bool:
    """Whether a new shot begins among frames; of the first two, of which nobody knows what was before, if they are
    unrelated."""
    cuts = CutDetector(THRESHOLD)
    return any(cuts.begins_shot(a, b) or (a is frames[0] and cuts.unrelated) for a, b in pairwise(frames))


def _before(multiple: int) -> int:
    """Frames of the film before the gap, which event cameras watch."""
    return max(1, -(-multiple // AHEAD))


def _wanted(multiple: int) -> int:
    """Frames of the film for a clip: those before the gap, its key frames and what is between them, and one more."""
    return _before(multiple) + multiple + 2


def check_film(name: str, settings: ClipSettings, multiple: int) -> None:
    """Raise UsageError for a film that is none, too short or too small for clips, DataError for one that cannot be
    read."""
    if is_single_picture(Path(name)):
        raise UsageError(
            f"{name}: a single picture, expected a video; leave it out, or train with photographs in motion that"
            " --set clips.textures=[...] names"
        )
    _fitting(_opened(name, settings.fps)[0], name, settings.size, multiple)


def length_of(source: Source, name: str) -> tuple[int, float]:
    """Frames and seconds of a film, by its header.  Raises UsageError where that says neither."""
    count, seconds = source.frames_expected, source.duration_expected_s
    if count is None or seconds is None:
        raise UsageError(
            f"{name} does not say how long it is, and parts are drawn from all of it; bring it into a container that"
            " does, as ffmpeg -i IN -c copy OUT.mkv does"
        )
    return count, seconds


def _opened(name: str, fps: float | None) -> tuple[Source, float]:
    """A film, and where it begins by its own clock [s]."""
    return _opened_once(name, fps, stamp(name))


@lru_cache(maxsize=16)
def _opened_once(name: str, fps: float | None, written: Stamp) -> tuple[Source, float]:
    try:
        source = open_source(name, colour="rgb", fps=fps)
    except (UsageError, DataError) as error:  # (that is how --fps is called here)
        raise type(error)(str(error).replace("--fps", "--set clips.fps=RATE")) from error
    return source, begins_s(source)


def _place(
    source: Source, name: str, size: tuple[int, int], multiple: int, draw: np.random.Generator
) -> tuple[float, tuple[int, int, int, int]]:
    """A start [s after the first frame] and a part (left, top, width, height) of a film."""
    count, seconds, fits = _fitting(source, name, size, multiple)
    smaller = fits[int(draw.integers(len(fits)))]
    wanted = smaller * size[0], smaller * size[1]
    left, top = (int(draw.integers(have - want + 1)) for have, want in zip(source.size, wanted, strict=True))
    return float(draw.uniform(0, seconds * (1 - (_wanted(multiple) + 1) / count))), (left, top, *wanted)


def _fitting(source: Source, name: str, size: tuple[int, int], multiple: int) -> tuple[int, float, list[int]]:
    """Frames and seconds of a film, and by how much clips of it can be made smaller."""
    count, seconds = length_of(source, name)
    least = _wanted(multiple) + 1
    if not seconds or count < least:
        raise UsageError(f"{name}: {counted(count, 'frame')}; expected at least {least} for clips of {multiple}")
    fits = [each for each in SMALLER if all(each * want <= have for want, have in zip(size, source.size, strict=True))]
    if not fits:
        raise UsageError(
            f"{name}: {source.size[0]}x{source.size[1]} pixels; expected at least {size[0]}x{size[1]}, or give --set"
            " clips.size=[W,H] and --set samples.size=N"
        )
    return count, seconds, fits


def _drawn(
    source: Source,
    begin_s: float,
    after_s: float,
    count: int,
    part: tuple[int, int, int, int],
    size: tuple[int, int],
    name: str,
) -> tuple[float, list[Frame]]:
    """The start [s] and so many frames from there on; earlier, where those of a film at no constant rate come to an end
    before."""
    for nearer in NEARER:
        start_s = begin_s + nearer * after_s
        frames = _read(source, start_s, count, part, size)
        if len(frames) == count:
            return start_s, frames
    found = counted(len(frames), "frame")
    raise UsageError(f"{name}: {found} after {start_s:.3f} s, expected {count}; give a longer film")


def _read(
    source: Source, start_s: float, count: int, part: tuple[int, int, int, int], size: tuple[int, int]
) -> list[Frame]:
    """Up to so many frames of a part of a film, at the size of a clip."""
    from vid2ev.sources.cut import Divisible

    left, top, width, height = part
    coming = source.frames_between(round(1e9 * start_s), None) if isinstance(source, Divisible) else source.frames()
    frames = []
    for frame in coming:
        light = frame.light[top : top + height, left : left + width]
        planes = [coarse(np.ascontiguousarray(light[..., c]), width // size[0]) for c in range(3)]
        frames.append(Frame(np.stack(planes, axis=-1), frame.t_ns))
        if len(frames) == count:
            break
    return frames
