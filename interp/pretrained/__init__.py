"""Weights that come with the package: `NAME-SIZE.safetensors` beside this file, such as
`rrin_events_guided-tiny.safetensors`.

What is used where nothing is asked for stands first in `PREFERRED`.
"""

from __future__ import annotations

from pathlib import Path

HERE = Path(__file__).parent
PREFERRED: dict[bool, tuple[str, ...]] = {
    True: ("rrin_events_guided-small", "rrin_events_guided-tiny"),
    False: ("rrin-small", "rrin-tiny"),
}
OF_EVENTS = ("e2vid-small", "e2vid-tiny", "firenet-paper", "firenet-small", "firenet-tiny")


def default(events: bool) -> Path | None:
    """The weights to interpolate with, with events or of frames alone; None if there are none."""
    return _first(PREFERRED[events])


def of_events() -> Path | None:
    """The weights to make pictures of events alone with; None if there are none."""
    return _first(OF_EVENTS)


def _first(names: tuple[str, ...]) -> Path | None:
    paths = (HERE / f"{name}.safetensors" for name in names)
    return next((path for path in paths if path.exists()), None)
