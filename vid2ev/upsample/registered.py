"""Upsamplers of other packages, which they name in the entry points of the group `vid2ev.upsamplers`.

    [project.entry-points."vid2ev.upsamplers"]
    net = "interp.upsampler:make"

makes `--upsample net` and `--upsample net:ANYTHING` call `make("ANYTHING", subframes, max_subframes, threshold,
upload)`, with None where nothing is said; `upload` takes light to the device, if there is one.  It returns an
`Upsampler`, whose light may be on the CPU whatever the device, and raises UsageError for what cannot be meant.  An
attribute `about`, ready for JSON, goes into the manifest.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

GROUP = "vid2ev.upsamplers"


def others() -> list[str]:
    """The names of those that are installed."""
    return sorted(entry_points(group=GROUP).names)


def other(method: str) -> tuple[Any, str | None] | None:
    """What makes the upsampler of a name, and what the name says after a colon; None if it is nobody's."""
    name, colon, rest = method.partition(":")
    found = next(iter(entry_points(group=GROUP, name=name)), None)
    return None if found is None else (found.load(), rest if colon else None)
