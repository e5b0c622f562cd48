"""Clips measured as a whole, as plans are made of them."""

from __future__ import annotations

from collections.abc import Iterable

from vid2ev.bounds.scene import Scene
from vid2ev.plan.measure import Measure
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream import Frame


def scene_of(spec: DvsSpec, size: tuple[int, int], frames: Iterable[Frame]) -> Scene:
    """The scene of all frames."""
    measure = Measure(spec, size)
    for frame in frames:
        measure.see(frame)
    return measure.scene()
