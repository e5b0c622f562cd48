"""What the cameras of a recording see, instant by instant: the light of its source, made denser in time, as views.

source -> intervals (motion between two frames) -> frames (light carried along it) -> views
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.formats.event_file import Picture
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.rig.depth import between
from vid2ev.seen.mounts import Mount
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import Sight, Stage, arriving, instants_of, scene_behind
from vid2ev.seen.truth import Truth, Wanted, with_next
from vid2ev.sensors.clock import LONGEST_INTERVAL_NS
from vid2ev.sensors.devices import CPU, Device
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.ahead import ahead
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still
from vid2ev.stream.upload import Upload, as_array, downloaded
from vid2ev.upsample import Interval
from vid2ev.upsample.cuts import CutDetector
from vid2ev.upsample.linear import LinearUpsampling
from vid2ev.upsample.none import NoUpsampling

LEAST_AHEAD, MOST_AHEAD = 4, 16  # frames made in advance, while the sensors work: between them as many as
AHEAD_PX = 1 << 23  # have so many pixels together
INTERVALS_AHEAD = 3  # whose motion is known in advance


@dataclass(frozen=True, slots=True)
class Instant:
    """What the cameras see at one instant of the source's clock: a frame for each, on its own clock.

    `original` and `cut` are those of the source's frame, and `depth` [m], where it has some.  `limited` is the number
    of source intervals so far that hit `max_subframes`, `shift_px` how far things move in the interval that the instant
    is of, where that was looked at; `truth` is that of each camera, where it is due.
    """

    frames: tuple[Frame, ...]
    t_ns: int
    original: bool = True
    cut: bool = False
    limited: int = 0
    truth: tuple[Truth, ...] = ()
    shift_px: float | None = None
    depth: np.ndarray | None = None

    def downloaded(self) -> Instant:
        """The instant with light in arrays, wherever it is."""
        return replace(self, frames=tuple(map(downloaded, self.frames)))


def instants(recipe: Recipe, start: int = 0, device: Device = CPU, threads: int | None = None) -> Generator[Instant]:
    """What is seen at source frame `start`, and at all frames after it, those in between too.  Threads make it, a
    little in advance: one looks for motion, another carries light along it, and `threads` form the views or render a
    scene; if not given, one and all cores.

    Light is made on the `device` from the source's frames on, and is in tensors of torch there.
    """
    upload = None if device.light is None else Upload(device.light)
    return ahead(_instants(recipe, start, upload, threads), frames_ahead(recipe.source.size))


def frames_ahead(size: tuple[int, int]) -> int:
    """How many frames of a size are made in advance: the more, the less threads that take turns at being slow wait."""
    return min(max(AHEAD_PX // (size[0] * size[1]), LEAST_AHEAD), MOST_AHEAD)


def events_of(
    video: str | Path,
    sensor: str | Path | DvsSpec = "paper",
    overrides: Sequence[str] = (),
    *,
    threads: int = 1,
    **rest: Any,
) -> Iterator[Events]:
    """The events of a video, those that `convert` writes: one Events for each frame and sub-frame, the empty ones too.

    The arguments are those of `Recipe.of`, and the `threads` of the sensor.  What is impossible is refused at once.
    """
    recipe = Recipe.of(video, sensor, overrides, **rest)
    if not recipe.alone or recipe.mounts[0].kind != "dvs":
        raise UsageError("events of several cameras at once: expected one event camera; convert the video instead")
    dvs = recipe.mounts[0].dvs(recipe.labels, threads)
    return dvs.run(instant.frames[0] for instant in instants(recipe))


def pictures(recipe: Recipe, mount: Mount) -> Iterator[Picture]:
    """The frames of the source as a camera sees them, read again, in 8 bits of sRGB: to be kept beside its events."""
    sight = Sight(recipe.rig.source, [mount], recipe.plane_m)
    seen: Iterable[tuple[int, Any]]
    if recipe.source.dense and not sight.free:
        stage = Stage(recipe.source, [mount])
        seen = zip(stage.instants_ns, (picture.light for ((picture, _),) in stage.pictures()), strict=True)
    else:
        seen = ((frame.t_ns, sight.views(downloaded(frame))[0].light) for frame in recipe.source.frames())
    for t_ns, light in seen:
        yield Picture(t_ns // 1000 + mount.clock_offset_us, srgb_codes(as_array(light)))


def _instants(recipe: Recipe, start: int, upload: Upload | None, threads: int | None) -> Generator[Instant]:
    sight = Sight(recipe.rig.source, recipe.mounts, recipe.plane_m, recipe.bayer, threads or 1)
    wanted, before_ns = recipe.truth, None
    if threads and (scene := scene_behind(recipe.source)):
        scene.world.threads = threads
    if recipe.rendered:
        return (yield from _rendered(recipe, start, upload))
    of_scene = _of_scene(recipe, wanted) if wanted else None
    made = _light(recipe, start, upload)
    with closing(made if sight.free else ahead(made, LEAST_AHEAD)) as light:
        for frame, limited, shift_px in light:
            views, truth = sight.views(frame), tuple[Truth, ...]()
            if of_scene:
                truth = of_scene(frame.t_ns)
            elif wanted and frame.original:
                if wanted.due(before_ns, frame.t_ns):
                    masks = [view.valid for view in views]
                    truth = wanted.of_views(frame, recipe.rig.source, recipe.plane_m, recipe.mounts, masks)
                before_ns = frame.t_ns
            frames = arriving(frame, [view.light for view in views], recipe.mounts, recipe.bayer)
            yield Instant(frames, frame.t_ns, frame.original, frame.cut, limited, truth, shift_px, frame.depth)


def _of_scene(recipe: Recipe, wanted: Wanted) -> Callable[[int], tuple[Truth, ...]] | None:
    """What is known of a scene at an instant of a source that shows a part of it, or shows it at another size or speed:
    nothing where it is not due.  None for other sources."""
    scene = scene_behind(recipe.source)
    if scene is None:
        return None
    world, mounts, shown = scene.world, recipe.mounts, instants_of(scene, recipe.source)
    due = with_next([*shown], wanted)

    def truth(t_ns: int) -> tuple[Truth, ...]:
        if t_ns not in due:
            return ()
        at_ns, next_ns = shown[t_ns], due[t_ns]
        pictures = [world.render(at_ns, *mount.view) for mount in mounts]
        known = wanted.of_pictures(world, at_ns, None if next_ns is None else shown[next_ns], pictures, mounts)
        return tuple(each._replace(t_ns=each.t_ns + t_ns - at_ns) for each in known)

    return truth


def _rendered(recipe: Recipe, start: int, upload: Upload | None) -> Generator[Instant]:
    """What each camera sees of a scene."""
    stage, wanted = Stage(recipe.source, recipe.mounts), recipe.truth
    due = with_next(stage.instants_ns, wanted) if wanted else {}
    before: tuple[Frame, ...] = ()
    for t_ns, pictures in zip(stage.instants_ns[start:], stage.pictures(start), strict=True):
        (seen, stills), truth = zip(*pictures, strict=True), tuple[Truth, ...]()
        if wanted and t_ns in due:
            known = [each._make(map(as_array, each)) for each in seen]
            truth = wanted.of_pictures(stage.world, t_ns, due[t_ns], known, recipe.mounts)
        lights = [upload.light(picture.light) if upload else picture.light for picture in seen]
        frames = arriving(Frame(lights[0], t_ns), lights, recipe.mounts, recipe.bayer)
        if before:  # (what reaches a pixel is a function of the light there)
            frames = tuple(
                replace(frame, still=None if still is None else Still(last.light, still))
                for frame, last, still in zip(frames, before, stills, strict=True)
            )
        yield Instant(frames, t_ns, truth=truth)
        before = frames


def _light(recipe: Recipe, start: int, upload: Upload | None) -> Generator[tuple[Frame, int, float | None]]:
    """The frames of the source and those in between, each with the number of intervals so far that hit a limit, and how
    far things move in its interval [px]."""
    limited = 0
    with closing(ahead(_intervals(recipe, start, upload), INTERVALS_AHEAD)) as intervals:
        for interval in intervals:
            limited += interval.limited
            for frame in interval:
                yield upload.frame(frame) if upload else frame, limited, interval.shift_px


def _intervals(recipe: Recipe, start: int, upload: Upload | None) -> Generator[Interval]:
    """The frame `start` by itself, and each interval after it."""
    upsampler, straight = recipe.upsampler(upload), NoUpsampling()
    cuts = CutDetector(recipe.threshold)
    before: Frame | None = None
    # (whether there is a cut after frame `start` depends on the frame before it, too; a scene is a single shot)
    for index, frame in enumerate(recipe.source.frames(max(start - 1, 0)), max(start - 1, 0)):
        shot = before is not None and not recipe.source.dense and cuts.begins_shot(before, frame)
        cut = shot and recipe.cuts == "restart"
        if index == start:
            yield Interval(iter([frame]))
        elif before is not None and index > start:
            gap_ns = frame.t_ns - before.t_ns
            method = straight if cuts.unrelated else upsampler
            if gap_ns >= LONGEST_INTERVAL_NS:  # (more than a sensor takes at a time)
                method = LinearUpsampling(gap_ns // LONGEST_INTERVAL_NS + 1, upload)
            interval = method.between(before, replace(frame, cut=cut))
            yield interval if frame.depth is None else replace(interval, frames=_filled(interval, before, frame))
        before = frame


def _filled(frames: Iterable[Frame], before: Frame, after: Frame) -> Iterator[Frame]:
    """The frames of an interval, with depth between those of its ends."""
    assert before.depth is not None and after.depth is not None
    same = np.array_equal(before.depth, after.depth, equal_nan=True)
    for frame in frames:
        if frame.depth is None:
            share = (frame.t_ns - before.t_ns) / (after.t_ns - before.t_ns)
            frame = replace(frame, depth=before.depth if same else between(before.depth, after.depth, share))
        yield frame
