"""A mount: a place on the rig, and the sensor in it, with everything settled that a rig file may leave open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.spec import DvsSpec


@dataclass(frozen=True)
class Mount:
    """A camera of a recording.

    name             "" for the only one, whose files lie in the folder of the recording itself
    number           its place in the rig, from 0; cameras of one seed differ by it
    sensor, spec     what the specification was found by, and the specification
    seed             of the sensor
    intrinsics       of the view, `size` among them
    pose             where it is, from the camera to the source's camera
    clock_offset_us  what its own clock reads when that of the source reads 0
    """

    name: str
    number: int
    sensor: str
    spec: DvsSpec
    seed: int
    intrinsics: Intrinsics
    pose: Pose = IDENTITY
    clock_offset_us: int = 0

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.intrinsics.size

    @property
    def within(self) -> str:
        """The camera's part of the recording's folder, with a slash at its end."""
        return f"{self.name}/" if self.name else ""

    def dvs(self, labels: bool = False, threads: int = 1) -> Dvs:
        """The sensor, before its first frame."""
        return Dvs(self.spec, self.size, self.seed, camera=self.number, threads=threads, labels=labels)

    def describe(self) -> dict[str, Any]:
        """The sensor, ready for JSON."""
        return {
            "name": self.sensor,
            "size": list(self.size),
            "parameters": self.spec.model_dump(mode="json"),
            "effects": self.spec.effects(),
        }
