"""Weights that come with the package: `NAME-SIZE.safetensors` beside this file, such as
`rrin_events_light-tiny.safetensors`.

What is used where nothing is asked for stands first in `PREFERRED`.
"""

from __future__ import annotations

from pathlib import Path

HERE = Path(__file__).parent
PREFERRED: dict[bool, tuple[str, ...]] = {
    True: ("rrin_events_light-small", "rrin_events_light-tiny"),
    False: ("rrin-small", "rrin-tiny"),
}


def default(events: bool) -> Path | None:
    """The weights to interpolate with, with events or of frames alone; None if there are none."""
    paths = (HERE / f"{name}.safetensors" for name in PREFERRED[events])
    return next((path for path in paths if path.exists()), None)


def named(name: str) -> Path | None:
    """The weights of a name, such as firenet-tiny; None if there are none."""
    path = HERE / f"{name}.safetensors"
    return path if path.exists() else None
