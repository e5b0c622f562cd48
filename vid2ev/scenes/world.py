"""A world: a scene that can be looked at, at any instant and from anywhere.

What is seen at t is a function of scene, seed and t alone: nothing is kept from one instant to the next but textures
and meshes, which do not change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Self

import numpy as np

from vid2ev.rig.camera import Viewpoint
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.rig.rig_file import read_rig
from vid2ev.scenes.flow import Flow, flow
from vid2ev.scenes.mesh_files import load_mesh
from vid2ev.scenes.render import Picture, render
from vid2ev.scenes.scene import Flicker, LightSource, Object, Scene
from vid2ev.scenes.scene import Picture as Look
from vid2ev.scenes.scene_file import SceneFile, read_scene
from vid2ev.scenes.snapshot import Lamp, Mesh, Shape, Snapshot, Surface, Texture, Thing
from vid2ev.scenes.textures import pixels_of
from vid2ev.scenes.trajectory import Fixed, pose_of

Renderer = Callable[[Snapshot, Intrinsics, Pose], Picture]  # of a camera with a pose (camera to world)


class World:
    """A scene, ready to be rendered; `seed` settles the ranges of a scene file.

    threads     that render; None for all cores.  They change nothing but the time it takes
    renderer    what makes pictures, such as `blender.renderer.Cycles`; the embedded renderer if there is none
    afresh      whether all of each picture is rendered, also what cannot have changed since the last one (`reel`)
    viewpoints  the cameras of the scene's rig, in the coordinates of the reference camera; none without a rig

    Raises UsageError for a scene that cannot be, DataError for a texture, a mesh or a rig that cannot be read.
    """

    def __init__(
        self, scene: Scene | SceneFile, seed: int = 0, *, threads: int | None = None, renderer: Renderer | None = None
    ):
        self.scene = scene if isinstance(scene, Scene) else scene.resolved(seed)
        self.threads, self.renderer, self.afresh = threads, renderer, False
        self._textures: dict[Look, Texture] = {}
        self._looks = [(thing, self._shape(thing), self._surface(thing)) for thing in self.scene.objects]
        self._still = {id(thing): pose_of(thing.trajectory, 0.0) for thing in self.scene.objects if is_still(thing)}
        self._environment = self._around()
        self.viewpoints = self._rig()

    @classmethod
    def of(cls, name_or_path: str | Path, seed: int = 0, settings: Sequence[str] = ()) -> Self:
        """The world of a predefined scene, or of a scene file, changed by `key=value` texts."""
        return cls(read_scene(name_or_path, settings), seed)

    @property
    def duration_ns(self) -> int:
        """From the first instant, 0, to the last [ns]."""
        return round(self.scene.scene.duration_s * 1e9)

    @property
    def intrinsics(self) -> Intrinsics:
        """Those of the reference camera."""
        return self.scene.camera.intrinsics

    def camera_pose(self, t_ns: int) -> Pose:
        """The reference camera in the world."""
        return pose_of(self.scene.camera.trajectory, 1e-9 * t_ns)

    def snapshot(self, t_ns: int, lamps_at_ns: int | None = None) -> Snapshot:
        """What there is at an instant; `lamps_at_ns` takes the lamps of another."""
        t_s, lamps_s = 1e-9 * t_ns, 1e-9 * (t_ns if lamps_at_ns is None else lamps_at_ns)
        setting = self.scene.scene
        return Snapshot(
            things=[self._thing(*look, t_s) for look in self._looks],
            lamps=[Lamp("ambient", setting.ambient), *(_lamp(light, lamps_s) for light in self.scene.lights)],
            environment=self._environment,
            environment_gain=1.0 if setting.environment is None else setting.environment_gain,
            environment_pose=Pose.of(setting.environment_rotation_deg),
        )

    def render(self, t_ns: int, intrinsics: Intrinsics | None = None, pose_in_rig: Pose = IDENTITY) -> Picture:
        """What a camera sees: by default the reference camera, otherwise one with a pose in its coordinates."""
        snapshot, pose = self.snapshot(t_ns), self.camera_pose(t_ns) @ pose_in_rig
        if self.renderer:
            return self.renderer(snapshot, intrinsics or self.intrinsics, pose)
        samples = self.scene.scene.samples
        return render(snapshot, intrinsics or self.intrinsics, pose, samples=samples, threads=self.threads)

    def flow(
        self,
        t0_ns: int,
        t1_ns: int,
        picture: Picture,
        intrinsics: Intrinsics | None = None,
        pose_in_rig: Pose = IDENTITY,
    ) -> Flow:
        """Where the pixels of the picture at t0 are at t1 [H, W, 2 px], and which of them are still seen [H, W]."""
        poses = [self.camera_pose(t_ns) @ pose_in_rig for t_ns in (t0_ns, t1_ns)]
        snapshots = [self.snapshot(t_ns) for t_ns in (t0_ns, t1_ns)]
        return flow(snapshots[0], poses[0], snapshots[1], poses[1], intrinsics or self.intrinsics, picture)

    def _thing(self, thing: Object, shape: Shape, surface: Surface, t_s: float) -> Thing:
        if thing.flicker:
            surface = _lit(surface, thing.emission * thing.flicker.gain(t_s))
        pose = self._still.get(id(thing))
        return Thing(thing.name, shape, surface, pose_of(thing.trajectory, t_s) if pose is None else pose)

    def _shape(self, thing: Object) -> Shape:
        if thing.file is None:
            return Shape(thing.kind, thing.size_m)
        mesh = load_mesh(Path(thing.file))
        return Shape("mesh", mesh=_sized(mesh, max(thing.size_m)) if "size_m" in thing.model_fields_set else mesh)

    def _surface(self, thing: Object) -> Surface:
        return Surface(
            texture=None if thing.texture is None else self._texture(thing.texture),
            colour=thing.colour,
            repeat=thing.repeat,
            specular=thing.specular,
            shininess=thing.shininess,
            emission=thing.emission,
        )

    def _texture(self, look: Look) -> Texture:
        if look not in self._textures:
            self._textures[look] = Texture(pixels_of(look))
        return self._textures[look]

    def _rig(self) -> tuple[Viewpoint, ...]:
        rig = self.scene.scene.rig
        cameras = () if rig is None else read_rig(rig).cameras
        return tuple(Viewpoint(camera, camera.intrinsics(self.intrinsics), camera.pose) for camera in cameras)

    def _around(self) -> Texture | None:
        setting = self.scene.scene
        if setting.environment is not None:
            return self._texture(setting.environment)
        return Texture(np.array([[setting.background]], np.float32)) if any(setting.background) else None


def is_still(thing: Object | LightSource) -> bool:
    """Whether a thing stays where it is."""
    return all(isinstance(motion, Fixed) for motion in thing.trajectory)


def _lamp(light: LightSource, t_s: float) -> Lamp:
    pose = pose_of(light.trajectory, t_s)
    gain = _gain(light.flicker, t_s)
    place, direction = pose.translation_m, pose.rotation @ np.array(light.direction)
    return Lamp(
        light.kind,
        (gain * light.colour[0], gain * light.colour[1], gain * light.colour[2]),
        position_m=(float(place[0]), float(place[1]), float(place[2])),
        direction=(float(direction[0]), float(direction[1]), float(direction[2])),
        reach_m=light.reach_m,
        shadows=light.shadows,
    )


def _gain(flicker: Flicker | None, t_s: float) -> float:
    return 1.0 if flicker is None else flicker.gain(t_s)


def _lit(surface: Surface, emission: float) -> Surface:
    return Surface(
        surface.texture, surface.colour, surface.repeat, surface.specular, surface.shininess, emission=emission
    )


def _sized(mesh: Mesh, longest_m: float) -> Mesh:
    """The mesh around its middle, its longest side so long."""
    low, high = mesh.box
    scale = longest_m / max(float((high - low).max()), 1e-12)
    vertices = (mesh.vertices - (low + high) / 2) * scale
    return Mesh(vertices, mesh.triangles, mesh.uv, mesh.normals, mesh.colours, mesh.texture)
