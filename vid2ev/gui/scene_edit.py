"""Changes to a settled scene: values of its parts, and where its things are.

A part is named as in settings on the command line: `scene`, `camera`, `objects.NAME`, `lights.NAME`.  What moves along
a trajectory is moved as a whole, by a `fixed` motion before all others: that is its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel

from vid2ev.rig.pose import Pose
from vid2ev.scenes.scene import Camera, LightSource, Object, Scene, Setting
from vid2ev.scenes.scene_file import scene_of_tables
from vid2ev.scenes.trajectory import Fixed, pose_of

PLACE = ("position_m", "rotation_deg")  # of the fixed motion that comes first
NOWHERE = (0.0, 0.0, 0.0)


class Thing(NamedTuple):
    """A part of a scene: its name, the model of its parameters, and its values."""

    name: str
    model: type[BaseModel]
    values: Any

    @property
    def has_place(self) -> bool:
        """Whether it is somewhere."""
        return self.model is not Setting


def things_of(scene: Scene) -> list[Thing]:
    """The parts of a scene, in the order of its file."""
    return [
        Thing("scene", Setting, scene.scene),
        Thing("camera", Camera, scene.camera),
        *(Thing(f"objects.{each.name}", Object, each) for each in scene.objects),
        *(Thing(f"lights.{each.name}", LightSource, each) for each in scene.lights),
    ]


def thing_named(scene: Scene, name: str) -> Thing:
    """A part by its name; the first part if there is none of that name."""
    things = things_of(scene)
    return next((thing for thing in things if thing.name == name), things[0])


def with_values(scene: Scene, name: str, values: Mapping[str, Any]) -> Scene:
    """The scene with values of a part, its place among them; None takes a value back.

    Raises UsageError, in a sentence, for what cannot be.
    """
    tables = scene.tables()
    table = _table(tables, name)
    for key in values.keys() - {*PLACE}:
        if values[key] is None:
            table.pop(key, None)
        else:
            table[key] = values[key]
    if here := {key: values[key] for key in PLACE if key in values}:
        _put_first(table, _first(thing_named(scene, name)) | here)
    return scene_of_tables(tables, "scene")


def value_of(scene: Scene, name: str, key: str) -> Any:
    """A value of a part, or a half of its place."""
    thing = thing_named(scene, name)
    if key in PLACE:
        return _first(thing)[key]
    value = getattr(thing.values, key)
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_unset=True)
    if isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
        return tuple(each.model_dump(mode="json", exclude_unset=True) for each in value)
    return value


def with_place(scene: Scene, name: str, position_m: Any, rotation_deg: Any) -> Scene:
    """The scene with a part in another place.  Raises UsageError for what is none."""
    return with_values(scene, name, {"position_m": position_m, "rotation_deg": rotation_deg})


def moved(scene: Scene, name: str, way_m: Any) -> Scene:
    """The scene with a part moved by a way in the world [m]."""
    place = _first(thing_named(scene, name))
    position = [round(here + step, 6) for here, step in zip(place["position_m"], way_m, strict=True)]
    return with_place(scene, name, position, place["rotation_deg"])


def pose_at(thing: Thing, t_s: float) -> Pose:
    """Where a part is at an instant [s]."""
    return pose_of(thing.values.trajectory, t_s)


def _first(thing: Thing) -> dict[str, Any]:
    motions = thing.values.trajectory
    if motions and isinstance(motions[0], Fixed):
        return {"position_m": motions[0].position_m, "rotation_deg": motions[0].rotation_deg}
    return dict.fromkeys(PLACE, NOWHERE)


def _put_first(table: dict[str, Any], place: Mapping[str, Any]) -> None:
    motions = table.get("trajectory", [])
    later = motions[1:] if motions and motions[0]["kind"] == "fixed" else motions
    fixed = [{"kind": "fixed", **place}] if any(map(any, place.values())) else []
    table["trajectory"] = [*fixed, *later]


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    kind, _, own = name.partition(".")
    if not own:
        return tables.setdefault(kind, {})
    return next(table for table in tables[kind] if table["name"] == own)
