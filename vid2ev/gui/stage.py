"""The rig and the scene in three dimensions: things, lamps and cameras where they are, to be clicked and dragged.

Axes of the page's view have z upwards; those of scenes and rigs have y down and z forwards: (x, y, z) -> (x, z, -y).
"""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

import numpy as np
from nicegui import ui

from vid2ev.errors import UsageError
from vid2ev.gui.scene_edit import Thing, moved, pose_at, things_of
from vid2ev.gui.scene_part import scene_part
from vid2ev.gui.session import Session
from vid2ev.gui.theme import ACCENT, MUTED, ON, refuse
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.scene import LightSource, Object

TO_VIEW = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # cylinders of the view stand along their y
STRAIGHT = np.eye(3)
THIN_M = 0.004
GROUND = "#101218"  # of every picture of events
NEAR_M = 0.2
LARGE_M = 4.0  # what is larger is seen through, and stays where it is when the view is turned
CAMERAS = "cameras."
CLICK_S = 0.7  # after a drop


class Stage:
    """The 3-D view of a session; `select` is called with the name of what is clicked."""

    def __init__(self, session: Session, select: Any):
        self._session, self._select = session, select
        self._poses: dict[str, Pose] = {}
        self._shapes: list[tuple[str, Any, np.ndarray]] = []  # name, shape and how that stands where it is
        self._start_s: float | None = None
        self._dropped_s = -CLICK_S
        self._held = False
        self._scene = ui.scene(
            width=760,
            height=420,
            grid=False,
            background_color=GROUND,
            on_click=self._clicked,
            on_drag_start=self._grabbed,
            on_drag_end=self._dropped,
        ).classes("w-full")
        self.show()
        self.look()

    def show(self) -> None:
        """Draw what there is, at the instant that is looked at."""
        self._scene.clear()
        self._shapes, self._start_s, self._held = [], None, False
        setup = self._session.setup
        with self._scene:
            if setup.is_scene:
                scene = setup.settled()
                for thing in things_of(scene)[2:]:
                    self._draw(thing)
                source = scene.camera.intrinsics
            else:
                source = setup.rig.source.intrinsics((640, 480))
            self._draw_camera("camera" if setup.is_scene else "source", source, MUTED)
            for camera in setup.rig.cameras:
                self._draw_camera(f"{CAMERAS}{camera.name}", camera.intrinsics(source), ACCENT, named=True)
        self.follow()

    def follow(self) -> None:
        """Bring all to where it is at the instant that is looked at, but for what is being dragged there."""
        start_s = self._session.request.start_s
        if self._held or self._start_s == start_s:
            return
        self._start_s, self._poses = start_s, self._poses_at(start_s)
        for name, shape, turn in self._shapes:
            pose = self._poses[name]
            shape.move(*(TO_VIEW @ pose.translation_m).tolist())
            shape.rotate_R((TO_VIEW @ pose.rotation @ turn).tolist())

    def _poses_at(self, t_s: float) -> dict[str, Pose]:
        setup = self._session.setup
        poses, reference = {}, "source"
        if setup.is_scene:
            with suppress(UsageError):  # (of options, which the preview tells)
                t_s = scene_part(setup).scene_s(t_s)
            poses, reference = {thing.name: pose_at(thing, t_s) for thing in things_of(setup.settled())[1:]}, "camera"
        poses.setdefault(reference, IDENTITY)
        return poses | {f"{CAMERAS}{camera.name}": poses[reference] @ camera.pose for camera in setup.rig.cameras}

    def look(self) -> None:
        """Look over the shoulder of the reference camera."""
        pose = next((pose for name, pose in self._poses.items() if name in ("camera", "source")), IDENTITY)
        away = [float(np.linalg.norm(other.translation_m - pose.translation_m)) for other in self._poses.values()]
        far_m = float(np.median([way for way in away if way > NEAR_M] or [2.0]))
        eye, target = pose.apply(far_m * np.array([0.5, -0.45, -0.55])), pose.apply(far_m * np.array([0.0, 0, 0.8]))
        (x, y, z), (to_x, to_y, to_z) = TO_VIEW @ eye, TO_VIEW @ target
        self._scene.move_camera(x, y, z, to_x, to_y, to_z, 0, 0, 1, duration=0)

    def _draw(self, thing: Thing) -> None:
        values = thing.values
        if isinstance(values, LightSource):
            if values.kind == "point":
                self._put(thing.name, self._scene.sphere(0.06).material(ON))
            return
        assert isinstance(values, Object)
        x, y, z = extents_m(values)
        turn = STRAIGHT
        shape: Any
        if values.kind == "sphere":
            shape = self._scene.sphere(0.5).scale(x, y, z)
        elif values.kind == "cylinder":
            shape, turn = self._scene.cylinder(0.5, 0.5, 1, 24).scale(x, z, y), UPRIGHT
        else:
            shape = self._scene.box(x, y, z, wireframe=values.kind == "mesh")
        large = max(x, y, z) > LARGE_M
        self._put(thing.name, shape.material(_tone(values), 0.25 if large else 1.0), turn, fixed=large)

    def _draw_camera(self, name: str, lens: Intrinsics, colour: str, named: bool = False) -> None:
        width, height = lens.size
        reach = 0.35
        corners = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
        rays = np.column_stack([(corners - lens.centre_px) / lens.focal_px, np.ones(4)]) * reach
        ends = rays.tolist()
        with self._scene.group() as pyramid:
            for k, end in enumerate(ends):
                self._scene.line([0.0, 0.0, 0.0], end).material(colour)
                self._scene.line(end, ends[(k + 1) % 4]).material(colour)
        self._shapes.append((name, pyramid, STRAIGHT))
        if named:
            self._put(name, self._scene.sphere(0.03).material(colour))

    def _put(self, name: str, shape: Any, turn: np.ndarray = STRAIGHT, fixed: bool = False) -> None:
        self._shapes.append((name, shape.with_name(name).draggable(not fixed), turn))

    def _clicked(self, event: Any) -> None:
        named = [hit.object_name for hit in event.hits if hit.object_name]
        if named and time.monotonic() - self._dropped_s > CLICK_S:  # (a drop is followed by a click on what is there)
            self._select(named[0])

    def _grabbed(self, _: Any) -> None:
        self._held = True

    def _dropped(self, event: Any) -> None:
        name, self._held = event.object_name, False
        if name in self._poses:
            place_m = TO_VIEW.T @ np.array([event.x, event.y, event.z])
            self._dropped_s = time.monotonic()
            self._move(name, place_m)
            self.show()
            self._select(name)

    def _move(self, name: str, place_m: np.ndarray) -> None:
        setup = self._session.setup
        way_m = place_m - self._poses[name].translation_m
        if not name.startswith(CAMERAS):
            refuse(self._session.change(lambda: setup.with_scene(moved(setup.settled(), name, way_m))))
            return
        number = [camera.name for camera in setup.rig.cameras].index(name.removeprefix(CAMERAS))
        reference = self._poses["camera" if setup.is_scene else "source"]
        seen = reference.inverse().apply(place_m)
        place_mm = tuple(round(1000 * float(part), 2) for part in seen)
        refuse(self._session.change(lambda: setup.with_camera_values(number, {"translation_mm": place_mm})))


def extents_m(thing: Object) -> tuple[float, float, float]:
    """The full extents of a thing in the view, where a plane is a thin box whatever its file says of its z."""
    x, y, z = thing.size_m
    return x, y, THIN_M if thing.kind == "plane" else max(z, THIN_M)


def _tone(thing: Object) -> str:
    """A quiet colour near the thing's own."""
    shares = [min(max(part, 0.0), 1.0) for part in thing.colour]
    return "#" + "".join(f"{round(90 + 110 * share):02x}" for share in shares)
