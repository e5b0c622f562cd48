"""Instants: when a scene is rendered, so that little changes from one picture to the next.

The rate at t is the greatest of

    fastest thing that any camera sees [px/s] / max_shift_px        motion
    d ln light / dt by the lamps / max_light_step                   lamps that move, and highlights with them; shadows
                                                                    of things that move, on those that stand still
    samples_per_period * frequency of every flicker
    min_fps

and at most max_fps.  It is found at knots (`knots.py`), and halfway between two where it changes much from one to the
next, down to 2 ms.  There the true flow and the change of light are measured over a small step on a grid of pixels, and
the motion of the corners of all things in view beside it, for those that fall between the pixels of the grid.  Between
two knots the greater of their rates R holds, and instant k of N + 1 is where

    integral of R dt = k (integral over all of the scene) / N,    N rounded up,

so that the first instant is the beginning, the last one the end.  All this is a function of the scene and of the
cameras that see it, the reference camera and those of a rig; any instant is found without those before it.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Hashable, Iterable, Sequence
from fractions import Fraction
from itertools import product

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixels_of
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.knots import FINEST_NS, STEP_NS, first_knots_ns
from vid2ev.scenes.render import Picture, render
from vid2ev.scenes.scene import LightSource, Object
from vid2ev.scenes.snapshot import Snapshot, Thing
from vid2ev.scenes.world import World, is_still

STEADY = 1.25  # rates of two knots that differ less need none between them
GRID = 64  # pixels across, of the pictures in which it is measured
MARGIN = 1.15  # for what the grid misses
SMOOTH = 2  # cells along a pixel at an edge, where changes of light are measured
FEW = 1 / 500  # of the pixels
DARK = 0.01  # light of which changes do not count
CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
AXES = np.concatenate([np.eye(3), -np.eye(3)]) / 2
ROUND = np.concatenate([AXES, CORNERS / math.sqrt(3)])  # on a sphere
RIM = np.array([(math.cos(a) / 2, math.sin(a) / 2, z) for a in np.arange(8) * math.pi / 4 for z in (-0.5, 0.5)])
OUTERMOST = {"plane": CORNERS * (1, 1, 0), "box": CORNERS, "sphere": ROUND, "cylinder": RIM}
NEAREST_M = 0.05

Eye = tuple[Intrinsics, Pose]  # a camera, and where it is in the coordinates of the reference camera


class Instants:
    """The instants of a world [ns]; with `fps` at k / fps, otherwise as motion and light ask for.

    eyes    cameras of a rig, whose motion counts beside that of the reference camera (`others`)
    """

    def __init__(self, world: World, fps: float | Fraction | None = None, eyes: Sequence[Eye] = ()):
        self._end_ns = world.duration_ns
        self._fps = None if fps is None else rate_of(fps)
        if self._fps is not None:
            self.count = self._end_ns * self._fps.numerator // (10**9 * self._fps.denominator) + 1
            return
        knots, rates = _rates(world, eyes)
        self.asked_hz, rates = float(rates.max()), np.minimum(rates, world.scene.scene.max_fps)
        self.slowest_hz, self.fastest_hz = float(rates.min()), float(rates.max())
        spans = 1e-9 * np.diff(knots) * np.maximum(rates[1:], rates[:-1])
        self._knots, self._steps = knots, np.concatenate([[0.0], np.cumsum(spans)])
        self.count = max(1, math.ceil(self._steps[-1] - 1e-9)) + 1

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, k: int) -> int:
        """Instant k [ns]."""
        if not 0 <= k < self.count:
            raise IndexError(k)
        if self._fps is not None:
            return round(k / self._fps * 10**9)
        steps = self._steps[-1] * k / (self.count - 1)
        return round(float(np.interp(steps, self._steps, self._knots)))

    def first_from(self, t_ns: int) -> int:
        """The index of the first instant that is not before t_ns; `len` if there is none."""
        return bisect_left(range(self.count), t_ns, key=self.__getitem__)


def _reference(world: World) -> Eye:
    return world.intrinsics, IDENTITY


def others(world: World, eyes: Iterable[Eye]) -> tuple[Eye, ...]:
    """The cameras whose pictures are those of no camera before them, nor of the reference camera."""
    reference, found = key_of(_reference(world)), dict[Hashable, Eye]()
    for eye in eyes:
        found.setdefault(key_of(eye), eye)
    return tuple(eye for key, eye in found.items() if key != reference)


def key_of(eye: Eye) -> Hashable:
    """What is the same for cameras that see the same."""
    lens, pose = eye
    return lens, (pose.rotation + 0.0).tobytes(), (pose.translation_m + 0.0).tobytes()  # (no zero has a sign)


def _rates(world: World, eyes: Sequence[Eye]) -> tuple[np.ndarray, np.ndarray]:
    """The knots [ns], and the rates that are asked for at them; those above `max_fps` count as alike."""
    coming = first_knots_ns(world)[::-1]  # (the earliest last)
    known, most = {t_ns: asked_hz(world, t_ns, eyes) for t_ns in coming}, world.scene.scene.max_fps
    knots = [coming.pop()]
    while coming:
        low, high = sorted(min(known[t_ns], most) for t_ns in (knots[-1], coming[-1]))
        middle = (knots[-1] + coming[-1]) // 2
        if high > STEADY * low and middle - knots[-1] >= FINEST_NS:
            known[middle] = asked_hz(world, middle, eyes)
            coming.append(middle)
        else:
            knots.append(coming.pop())
    return np.array(knots, np.float64), np.array([known[t_ns] for t_ns in knots])


def rate_hz(world: World, t_ns: int, eyes: Sequence[Eye] = ()) -> float:
    """Instants per second that there are about an instant: those that are asked for, up to `max_fps`."""
    return min(asked_hz(world, t_ns, eyes), world.scene.scene.max_fps)


def asked_hz(world: World, t_ns: int, eyes: Sequence[Eye] = ()) -> float:
    """Instants per second that motion and light ask for at an instant."""
    setting, watching = world.scene.scene, [_reference(world), *eyes]
    lit: list[LightSource | Object] = [*world.scene.lights, *world.scene.objects]
    asked = [
        setting.min_fps,
        *(setting.samples_per_period * thing.flicker.frequency_hz for thing in lit if thing.flicker),
        max(speed_px_s(world, t_ns, eye) for eye in watching) / setting.max_shift_px,
    ]
    if _lamps_change(world) or _shadows_move(world):
        asked.append(max(light_rate(world, t_ns, eye) for eye in watching) / setting.max_light_step)
    return max(asked)


def _lamps_change(world: World) -> bool:
    return any(light.flicker or not is_still(light) for light in world.scene.lights)


def _shadows_move(world: World) -> bool:
    """Whether any thing moves that lamps may throw a shadow of."""
    casting = any(light.shadows and light.kind != "ambient" for light in world.scene.lights)
    return casting and not all(map(is_still, world.scene.objects))


def speed_px_s(world: World, t_ns: int, eye: Eye | None = None) -> float:
    """The fastest that anything moves in the picture of a camera, the reference camera by default [px/s]."""
    lens, pose = eye or _reference(world)
    coarse = _coarse(lens)
    scale = lens.size[0] / coarse.size[0]
    shift, _ = world.flow(t_ns, t_ns + STEP_NS, _seen(world, t_ns, coarse, pose), coarse, pose)
    lengths = np.hypot(shift[..., 0], shift[..., 1])
    on_grid = scale * float(np.nanmax(lengths, initial=0.0))
    return MARGIN * max(on_grid, _fastest_corner(world, t_ns, lens, pose)) / (1e-9 * STEP_NS)


def light_rate(world: World, t_ns: int, eye: Eye | None = None) -> float:
    """How fast lamps change the light of what a camera sees, everything else standing still, and shadows of things that
    move that of things which do not [nat/s].

    The fastest few pixels do not count: at the edge of a shadow light changes as fast as one looks closely.
    """
    lens, pose = eye or _reference(world)
    coarse, then_ns, changes = _coarse(lens), t_ns + STEP_NS, [0.0]
    # (with smooth edges, so that shadows that move change the light of the pixels at their edge)
    before = _seen(world, t_ns, coarse, pose, samples=SMOOTH)
    if _lamps_change(world):
        lit = _seen(world, t_ns, coarse, pose, world.snapshot(t_ns, then_ns), SMOOTH)
        changes.append(_usual(_change(before, lit)))
    if _shadows_move(world):
        after = _seen(world, t_ns, coarse, pose, world.snapshot(then_ns), SMOOTH)
        changes.append(_usual(np.where(_stands_still(world, before, after), _change(before, after), 0)))
    return MARGIN * max(changes) / (1e-9 * STEP_NS)


def _change(before: Picture, after: Picture) -> np.ndarray:
    """By how much light is another [H, W, nat]."""
    one, other = (picture.light.max(axis=-1) for picture in (before, after))
    return np.abs(np.log((other + DARK) / (one + DARK)))


def _usual(change: np.ndarray) -> float:
    """The largest of changes, but for those of a few pixels."""
    return float(np.quantile(change, 1 - FEW))


def _stands_still(world: World, *pictures: Picture) -> np.ndarray:
    """The pixels [H, W] that show, as do those around them, nothing that moves or flickers by itself."""
    import cv2

    things = world.scene.objects
    moving = [number for number, thing in enumerate(things) if thing.flicker or not is_still(thing)]
    shown = np.any([np.isin(picture.thing, moving) for picture in pictures], axis=0)
    return cv2.dilate(shown.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0


def _seen(
    world: World, t_ns: int, lens: Intrinsics, pose: Pose, snapshot: Snapshot | None = None, samples: int = 1
) -> Picture:
    """What a camera sees from where it is at an instant, then or, of a snapshot, at another."""
    there = world.camera_pose(t_ns) @ pose
    return render(snapshot or world.snapshot(t_ns), lens, there, samples=samples, threads=world.threads)


def _fastest_corner(world: World, t_ns: int, lens: Intrinsics, pose: Pose) -> float:
    """How far the corner of any thing in view moves within the step [px]."""
    from_world = [(world.camera_pose(t) @ pose).inverse() for t in (t_ns, t_ns + STEP_NS)]
    pairs = zip(world.snapshot(t_ns).things, world.snapshot(t_ns + STEP_NS).things, strict=True)
    return max((_shift(before, after, from_world, lens) for before, after in pairs), default=0.0)


def _shift(before: Thing, after: Thing, from_world: list[Pose], intrinsics: Intrinsics) -> float:
    corners = _corners(before)
    places = [(view @ thing.pose).apply(corners) for view, thing in zip(from_world, (before, after), strict=True)]
    if min(place[:, 2].min() for place in places) < NEAREST_M:
        return 0.0
    pixels = [pixels_of(place, intrinsics) for place in places]
    inside = np.all((pixels[0] > -20) & (pixels[0] < np.array(intrinsics.size) + 20), axis=1)
    return float(np.nanmax(np.linalg.norm(pixels[1] - pixels[0], axis=1)[inside], initial=0.0))


def _corners(thing: Thing) -> np.ndarray:
    """The points of a thing that are farthest out [n, 3], in its own coordinates; of a mesh, the corners of its box."""
    mesh = thing.shape.mesh
    if mesh is None:
        return OUTERMOST[thing.shape.kind] * thing.shape.size_m
    low, high = mesh.box
    return (low + high) / 2 + CORNERS * (high - low)


def _coarse(intrinsics: Intrinsics) -> Intrinsics:
    """The same field with few pixels."""
    width, height = intrinsics.size
    across = min(GRID, width)
    return intrinsics.scaled_to((across, max(1, round(height * across / width))))


def rate_of(fps: float | Fraction) -> Fraction:
    if not math.isfinite(fps) or not 0 < fps <= 10**9:
        raise UsageError(f"fps {fps}: expected more than 0 and at most 1e9 frames per second")
    return Fraction(str(fps))
