"""The conditions that scores are held against, those that are known and vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from interp.evaluate.published import FASTEST_PX, FASTEST_PX_PER_S
from interp.evaluate.row import Row
from interp.evaluate.tables import edges_of, values


@dataclass(frozen=True, slots=True)
class Condition:
    """A column of rows; `axis` and `unit` name it.

    `harder` if frames get harder the more there is of it; `limit` is where the paper's network ends.
    """

    field: str
    title: str
    axis: str
    unit: str
    harder: bool = False
    limit: float | None = None


CONDITIONS = (
    Condition(
        "motion_px", "motion between the key frames", "motion, 95th percentile", "px per key frame", True, FASTEST_PX
    ),
    Condition("motion_px_per_s", "speed", "speed, 95th percentile", "px/s", True, FASTEST_PX_PER_S),
    Condition("events_per_px", "events", "events of the gap", "per pixel"),
    Condition("disparity_px", "disparity of the cameras", "disparity", "px", True),
    Condition("offset_us", "clock offset", "events late by", "µs"),
    Condition("blur_px", "blur of the key frames", "motion during an exposure", "px", True),
    Condition("contrast", "contrast", "standard deviation of log light", "nat"),
)


def varying(rows: Sequence[Row]) -> list[tuple[Condition, list[float]]]:
    """Conditions that are known and vary, with the edges of their bins, which are the same for all methods."""
    found = ((condition, edges_of(values(rows, condition.field))) for condition in CONDITIONS)
    return [(condition, edges) for condition, edges in found if edges]
