"""The rig and the scene in three dimensions: things, lamps and cameras where they are, to be clicked and dragged.

Axes of the page's view have z upwards; those of scenes and rigs have y down and z forwards: (x, y, z) -> (x, z, -y).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from nicegui import ui

from vid2ev.gui.scene_edit import Thing, moved, pose_at, things_of
from vid2ev.gui.session import Session
from vid2ev.gui.theme import ACCENT, MUTED, ON
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.scene import LightSource, Object

TO_VIEW = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # cylinders of the view stand along their y
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
        self._dropped_s = -CLICK_S
        self._scene = ui.scene(
            width=760,
            height=420,
            grid=False,
            background_color=GROUND,
            on_click=self._clicked,
            on_drag_end=self._dropped,
        ).classes("w-full")
        self.show()
        self.look()

    def show(self) -> None:
        """Draw what there is at the instant that is looked at."""
        self._scene.clear()
        setup, t_s = self._session.setup, self._session.request.start_s
        reference = IDENTITY
        with self._scene:
            if setup.is_scene:
                scene = setup.settled()
                for thing in things_of(scene)[2:]:
                    self._draw(thing, t_s)
                reference = pose_at(things_of(scene)[1], t_s)
                source = scene.camera.intrinsics
            else:
                source = setup.rig.source.intrinsics((640, 480))
            self._draw_camera("camera" if setup.is_scene else "source", source, reference, MUTED, None)
            for camera in setup.rig.cameras:
                lens = camera.intrinsics(source)
                self._draw_camera(f"{CAMERAS}{camera.name}", lens, reference @ camera.pose, ACCENT, camera.name)

    def look(self) -> None:
        """Look over the shoulder of the reference camera."""
        pose = next((pose for name, pose in self._poses.items() if name in ("camera", "source")), IDENTITY)
        away = [float(np.linalg.norm(other.translation_m - pose.translation_m)) for other in self._poses.values()]
        far_m = float(np.median([way for way in away if way > NEAR_M] or [2.0]))
        eye, target = pose.apply(far_m * np.array([0.5, -0.45, -0.55])), pose.apply(far_m * np.array([0.0, 0, 0.8]))
        (x, y, z), (to_x, to_y, to_z) = TO_VIEW @ eye, TO_VIEW @ target
        self._scene.move_camera(x, y, z, to_x, to_y, to_z, 0, 0, 1, duration=0)

    def _draw(self, thing: Thing, t_s: float) -> None:
        values, pose = thing.values, pose_at(thing, t_s)
        if isinstance(values, LightSource):
            if values.kind == "point":
                self._put(thing.name, self._scene.sphere(0.06).material(ON), pose, np.eye(3))
            return
        assert isinstance(values, Object)
        x, y, z = values.size_m
        turn = np.eye(3)
        shape: Any
        if values.kind == "sphere":
            shape = self._scene.sphere(0.5).scale(x, y, z)
        elif values.kind == "cylinder":
            shape, turn = self._scene.cylinder(0.5, 0.5, 1, 24).scale(x, z, y), UPRIGHT
        else:
            shape = self._scene.box(x, y, max(z, THIN_M), wireframe=values.kind == "mesh")
        large = max(x, y, z) > LARGE_M
        self._put(thing.name, shape.material(_tone(values), 0.25 if large else 1.0), pose, turn, held=large)

    def _draw_camera(self, name: str, lens: Intrinsics, pose: Pose, colour: str, label: str | None) -> None:
        width, height = lens.size
        reach = 0.35
        corners = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
        rays = np.column_stack([(corners - lens.centre_px) / lens.focal_px, np.ones(4)]) * reach
        ends = [(TO_VIEW @ pose.apply(ray)).tolist() for ray in rays]
        start = (TO_VIEW @ pose.translation_m).tolist()
        for k, end in enumerate(ends):
            self._scene.line(start, end).material(colour)
            self._scene.line(end, ends[(k + 1) % 4]).material(colour)
        if label:
            self._put(name, self._scene.sphere(0.03).material(colour), pose, np.eye(3))
        else:
            self._poses[name] = pose

    def _put(self, name: str, shape: Any, pose: Pose, turn: np.ndarray, held: bool = False) -> None:
        self._poses[name] = pose
        shape.with_name(name).move(*(TO_VIEW @ pose.translation_m).tolist())
        shape.rotate_R((TO_VIEW @ pose.rotation @ turn).tolist()).draggable(not held)

    def _clicked(self, event: Any) -> None:
        named = [hit.object_name for hit in event.hits if hit.object_name]
        if named and time.monotonic() - self._dropped_s > CLICK_S:  # (a drop is followed by a click on what is there)
            self._select(named[0])

    def _dropped(self, event: Any) -> None:
        name = event.object_name
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
            self._session.change(lambda: setup.with_scene(moved(setup.settled(), name, way_m)))
            return
        number = [camera.name for camera in setup.rig.cameras].index(name.removeprefix(CAMERAS))
        reference = self._poses["camera" if setup.is_scene else "source"]
        seen = reference.inverse().apply(place_m)
        place_mm = tuple(round(1000 * float(part), 2) for part in seen)
        self._session.change(lambda: setup.with_camera_values(number, {"translation_mm": place_mm}))


def _tone(thing: Object) -> str:
    """A quiet colour near the thing's own."""
    shares = [min(max(part, 0.0), 1.0) for part in thing.colour]
    return "#" + "".join(f"{round(90 + 110 * share):02x}" for share in shares)
