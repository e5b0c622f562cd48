"""The light of a short part of a setup's source, as each of its cameras sees it, small enough to be looked at at once.

A preview begins at an instant and takes as long as the slowest exposure asks for; what comes just before it is seen by
its sensors, so that they remember something (`gui.run_in`), but not shown.  Cameras and source have at most `side`
pixels each way.  Of a scene the reference camera is made smaller, and it is rendered at even intervals
(`gui.scene_light`); of a video, what lies between its frames is made as for a conversion.  The light is kept as long as
nothing changes that decides it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.gui.files import stamp_of_scene
from vid2ev.gui.run_in import RUN_IN_S, PartRecipe, since_cut
from vid2ev.gui.scene_light import Film, grid_hz, ticks_of
from vid2ev.gui.scene_part import ScenePart, scene_part
from vid2ev.gui.setup import Setup
from vid2ev.rig.camera import ResolvedRig, Rig
from vid2ev.scenes.instants import others
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.world import World
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.mounts import Loaded, Mount, mounts_of
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import taken_by
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.limits import check_seed
from vid2ev.sources import OPTIONS, open_source
from vid2ev.sources.framing import Framed, framing_of
from vid2ev.sources.source import Source
from vid2ev.stamps import Stamp, stamp

SIDE = 346  # px
LONGEST_S = 0.25
MARGIN = 1.02
NEAR_S = 1e-6  # what rounds to the beginning is there


@dataclass(frozen=True, eq=False)
class Light:
    """What the cameras see.

    recipe     of the preview: its mounts are the cameras, made smaller
    instants   those of the run-in first
    lead       how many these are: the part that is shown begins at instants[lead]
    whole      whether these are all, or some of them, soon to be followed by the others
    sizes      of the cameras as they are converted [px]
    notes      what a person should know of it, one sentence each
    """

    recipe: Recipe
    instants: tuple[Instant, ...]
    lead: int
    sizes: tuple[tuple[int, int], ...]
    notes: tuple[str, ...]
    whole: bool = True

    def with_sensors(self, setup: Setup) -> Light:
        """The same light before the sensors of another setup."""
        sensors = sensors_of(setup)
        mounts = [replace(mount, sensor=sensor) for mount, sensor in zip(self.recipe.mounts, sensors, strict=True)]
        return replace(self, recipe=replace(self.recipe, mounts=tuple(mounts)))


class LightTable:
    """The light of the setup that was last asked for; `check` is called now and then while it is made."""

    def __init__(self, check: Callable[[], None] = lambda: None):
        self._check = check
        self._film = Film(check)
        self._key: Any = None
        self._light: Light | None = None

    def light(self, setup: Setup, start_s: float, length_s: float, side: int = SIDE) -> Light:
        """From an instant [s] on, on the recording's clock, at least so long.  Raises UsageError, DataError."""
        *_, light = self.lights(setup, start_s, length_s, side)
        return light

    def lights(self, setup: Setup, start_s: float, length_s: float, side: int = SIDE) -> Iterator[Light]:
        """The same; before it, where it takes long, some of its instants."""
        length_s = _lasting(setup, length_s)
        key: Any = (_without_sensors(setup), tuple(each.colour for each in sensors_of(setup)), start_s, length_s, side)
        if not setup.is_scene:
            key = (*key, _threshold(setup))  # (by which light between frames is made)
        if self._light is None or key != self._key:
            made = self._of_scene if setup.is_scene else self._of_video
            for light in made(setup, start_s, length_s, side):
                if not light.whole:
                    yield light
            self._light, self._key = light, key
        yield self._light.with_sensors(setup)

    def _of_scene(self, setup: Setup, start_s: float, length_s: float, side: int) -> Iterator[Light]:
        scene, sensors, part = setup.settled(), sensors_of(setup), scene_part(setup)
        world = _world(scene, side, stamp_of_scene(scene))
        lens = part.lens(scene.camera.intrinsics)
        whole = setup.rig.resolved(lens.size, lens)
        shown = lens.scaled_to(smaller(lens.size, side)) if part.framing else world.intrinsics
        rig = _smaller_rig(whole, shown, side)
        begin_s, end_s = _span_s(part, start_s, length_s)
        eyes = others(world, ((view.intrinsics, view.pose) for view in rig.viewpoints))
        asked = self._film.rate_hz(world, begin_s, end_s, eyes)
        fps = min(grid_hz(asked, end_s - begin_s), part.fps or math.inf)
        mounts = mounts_of(rig, sensors, _seed(setup), alone=False)
        notes = _notes(mounts, _sizes(whole))
        if (asked := part.fps or asked) > 1.5 * fps:
            notes.append(f"the scene is rendered {fps:g} times a second here, where {asked:.0f} are asked for")
        colour: Any = "rgb" if any(sensor.colour for sensor in sensors) else "luminance"
        source = part.source(world, fps, colour, shown.size)
        recipe = Recipe("scene", source, rig, mounts, setup.options.get("depth"), upsample="none")
        recipe.check()
        ticks = [k for k in ticks_of(begin_s, end_s, fps, part.begin_s) if not part.fps or part.has(k / fps)]
        for seen in self._film.parts(world, mounts, ticks, fps, part.slower):
            lead = _lead(seen, begin_s / part.slower)
            yield Light(recipe, seen, lead, tuple(_sizes(whole)), tuple(notes), len(seen) == len(ticks))

    def _of_video(self, setup: Setup, start_s: float, length_s: float, side: int) -> Iterator[Light]:
        before_s = RUN_IN_S
        while (found := self._part(setup, start_s, length_s, side, before_s)) is None:
            before_s *= 4  # (frames are further apart there than elsewhere)
        yield found

    def _part(self, setup: Setup, start_s: float, length_s: float, side: int, before_s: float) -> Light | None:
        """That of a video; None where its sensors have to begin earlier, or there is no picture as it begins."""
        try:
            recipe, sizes, begin_s = _part_of_video(setup, start_s, length_s, side, before_s)
        except UsageError:
            if before_s > start_s:
                raise
            return None
        seen = []
        with closing(instants(recipe)) as coming:
            for instant in coming:
                self._check()
                seen.append(instant)
                if 1e-9 * instant.t_ns >= begin_s + length_s:
                    break
        if 1e-9 * seen[0].t_ns > begin_s + NEAR_S and before_s <= start_s:
            return None
        shown, lead = since_cut(seen, _lead(seen, begin_s))
        return Light(recipe, tuple(shown), lead, tuple(sizes), tuple(_notes(recipe.mounts, sizes)))


def duration_s(setup: Setup) -> float | None:
    """How long a setup's source lasts, on the recording's clock; None if there is no telling.  Raises UsageError,
    DataError."""
    return scene_part(setup).duration_s if setup.is_scene else _opened(setup).duration_expected_s


def sensors_of(setup: Setup) -> list[Loaded]:
    """The sensor of each camera."""
    return [Loaded(setup.preset(k), setup.spec(k)) for k in range(len(setup.rig.cameras))]


def smaller(size: tuple[int, int], side: int) -> tuple[int, int]:
    """A size of the same shape with at most `side` pixels along each side."""
    share = min(1.0, side / max(size))
    return max(1, round(size[0] * share)), max(1, round(size[1] * share))


def _lasting(setup: Setup, length_s: float) -> float:
    """As long as asked, or as the slowest exposure takes."""
    for camera, sensor in zip(setup.rig.cameras, sensors_of(setup), strict=True):
        if isinstance(sensor.spec, CisSpec):
            height = (camera.size or (0, 480))[1]
            length_s = max(length_s, MARGIN * 1e-6 * sensor.spec.window_us(height))
    return min(length_s, LONGEST_S)


def _part_of_video(
    setup: Setup, start_s: float, length_s: float, side: int, before_s: float = RUN_IN_S
) -> tuple[Recipe, list[tuple[int, int]], float]:
    """What a part is made by, the sizes of its cameras, and where it begins on the recording's own clock [s]; before it
    there is what its sensors see first, so long or an interval at least."""
    source, options = _opened(setup), dict(setup.options)
    slower = float(options.get("slowdown") or 1)
    interval_s = _interval_s(source)
    lasting_s = source.duration_expected_s or length_s
    framing, (width, height) = framing_of(source), smaller(source.size, side)
    whole = setup.rig.around(taken_by(source)).resolved(source.size, framing=framing)
    shown = _smaller_rig(whole, whole.source.scaled_to((width, height)), side)
    rig = shown.settled(framing and framing._replace(size=(width, height)))
    origin_s = _origin_s(*_opening(setup))
    begin_s = origin_s + min(start_s, max(lasting_s - length_s, 0.0))
    shaped = "motion" in options or ("size" in options and not str(options["size"]).endswith("!"))
    own = {"size": options["size"]} if "size" in options else {}
    options |= {"size": f"{width}x{height}{'' if shaped else '!'}"}
    if (since_s := begin_s - max(before_s, 1.5 * interval_s)) > origin_s:
        options["start"] = slower * since_s
    if source.size == (width, height) and "size" not in setup.options:
        options.pop("size")
    since_ns = round(1e9 * (begin_s - 0.5 * interval_s))
    recipe = PartRecipe.of(setup.source, rig=rig, since_ns=since_ns, **options)
    if "motion" in options:  # (which is told in pixels of the picture as it is converted)
        edits = {name: options[name] for name in OPTIONS if name in options and name != "size"} | own
        colour: Any = "rgb" if any(sensor.colour for sensor in sensors_of(setup)) else "luminance"
        moving = open_source(setup.source, colour=colour, **edits)
        recipe = replace(recipe, source=Framed(moving, None, f"{width}x{height}!"))
    return replace(recipe, mounts=_with_sensors(recipe.mounts, setup)), _sizes(whole), begin_s


def _lead(seen: Sequence[Instant], begin_s: float) -> int:
    """The number of the last instant that is not after the beginning."""
    return max((k for k, instant in enumerate(seen) if 1e-9 * instant.t_ns <= begin_s + NEAR_S), default=0)


def _notes(mounts: Sequence[Mount], sizes: Sequence[tuple[int, int]]) -> list[str]:
    notes = []
    for size in dict.fromkeys(sizes):
        these = [mount for mount, own in zip(mounts, sizes, strict=True) if own == size != mount.size]
        if these:
            names, (width, height) = ", ".join(mount.name for mount in these), these[0].size
            notes.append(f"{names} shown with {width}x{height} of {size[0]}x{size[1]} pixels")
    return notes


def _with_sensors(mounts: tuple[Mount, ...], setup: Setup) -> tuple[Mount, ...]:
    return tuple(replace(mount, sensor=sensor) for mount, sensor in zip(mounts, sensors_of(setup), strict=True))


def _smaller_rig(rig: ResolvedRig, source: Any, side: int) -> ResolvedRig:
    views = [
        replace(view, intrinsics=view.intrinsics.scaled_to(smaller(view.intrinsics.size, side)))
        for view in rig.viewpoints
    ]
    return ResolvedRig(source, rig.source_assumed, tuple(views))


def _sizes(rig: ResolvedRig) -> list[tuple[int, int]]:
    return [view.intrinsics.size for view in rig.viewpoints]


def _interval_s(source: Source) -> float:
    frames, seconds = source.frames_expected, source.duration_expected_s
    return seconds / (frames - 1) if frames and frames > 1 and seconds else 1 / 30


def _span_s(part: ScenePart, start_s: float, length_s: float) -> tuple[float, float]:
    """What is shown of a part of a scene, on the scene's clock."""
    latest_s = max(part.duration_s - length_s, 0.0)
    begin_s = part.scene_s(min(max(start_s, 0.0), latest_s))
    return begin_s, min(begin_s + part.slower * length_s, part.end_s)


def _seed(setup: Setup) -> int:
    check_seed(seed := setup.options.get("seed", 0))
    return seed


def _threshold(setup: Setup) -> float:
    specs = [sensor.spec for sensor in sensors_of(setup)]
    return min(
        (min(each.threshold_on, each.threshold_off) for each in specs if not isinstance(each, CisSpec)), default=0
    )


def _without_sensors(setup: Setup) -> Any:
    """What of a setup decides the light, comparable."""
    bare = tuple(camera.model_copy(update={"sensor": None, "set": {}}) for camera in setup.rig.cameras)
    scene = setup.settled() if setup.is_scene else None
    depth = re.sub(r"(,\w+=[^,=]*)*$", "", str(setup.options.get("depth", "")))  # (without what its numbers mean)
    return (
        setup.source,
        _stamp(setup) if scene is None else stamp_of_scene(scene),
        stamp(depth),
        Rig(source=setup.rig.source, cameras=bare),
        scene,
        tuple(setup.options.items()),
    )


def _opened(setup: Setup) -> Source:
    source = _source(*_opening(setup))
    if not source.rewindable:
        raise UsageError(f"{setup.source} passes once and cannot be looked at here and there; give a file")
    return source


def _opening(setup: Setup) -> tuple[str, Stamp, tuple[tuple[str, Any], ...]]:
    known = ("transfer", "fps", "slowdown", "start", "stop", "crop", "size", "motion")
    return (
        setup.source,
        _stamp(setup),
        tuple((name, setup.options[name]) for name in known if name in setup.options),
    )


def _stamp(setup: Setup) -> Stamp:
    """That of a video, or of a folder of images, of the times beside it, and of the path over a photograph."""
    path = Path(setup.source)
    beside = (f"{path.stem}_timestamps{suffix}" for suffix in (".npy", ".txt"))
    return stamp(path, *(path.parent / name for name in beside), str(setup.options.get("motion", "")))


@lru_cache(maxsize=4)
def _source(path: str, written: Stamp, options: tuple[tuple[str, Any], ...]) -> Source:
    return open_source(path, **dict(options))


@lru_cache(maxsize=4)
def _origin_s(path: str, written: Stamp, options: tuple[tuple[str, Any], ...]) -> float:
    """When the first frame is [s]."""
    return 1e-9 * next(frame.t_ns for frame in _source(path, written, options).frames())


@lru_cache(maxsize=2)
def _world(scene: Scene, side: int, written: Stamp) -> World:
    lens = scene.camera.intrinsics.scaled_to(smaller(scene.camera.size, side))
    changes: dict[str, Any] = {"size": lens.size}
    if scene.camera.focal_px is not None:
        changes["focal_px"] = lens.focal_px
    if scene.camera.centre_px is not None:
        changes["centre_px"] = lens.centre_px
    return World(scene.model_copy(update={"camera": scene.camera.model_copy(update=changes), "scene": scene.scene}))
