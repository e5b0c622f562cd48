"""The data card of a data set: what is in it, in the form of the paper's Table I, and what has to be known of it."""

from __future__ import annotations

from typing import Any

from vid2ev.sources import SYNTHETIC_PREFIX, is_scene
from vid2ev.terminal import counted

KNOWN = """\
* Frames of the truth are the light of an instant, without exposure and noise.{exposures}
* Events are simulated from the very light that the truth is made of. That is kinder to every method that uses events
  than a real recording is, to those that add them up most of all.
* {scenes}"""
RENDERED = "Scenes are independent of each other but for textures: the same photographs come again."
CUT = "Scenes that are parts of one film are not independent of each other."
EXPOSED = " The frame camera's exposures have their\n  middles at such instants."
KEYS = " So are those that\n  stand for frames of the camera."
FILMED = """\
* {filmed} Frames of the truth between filmed ones are made along the estimated motion, so where a film has fewer than
  {interpolated:g} frames a second after the slowdown, they are no more true than that.
* Films have been exposed, developed and compressed before; the cameras look at the result."""


def card_text(facts: dict[str, Any]) -> str:
    """The card of a data set's facts, in Markdown."""
    spec, videos = facts["spec"], facts["spec"]["videos"]
    rows = {
        "Source": f"{_used(facts)}, {_pace(spec['slowdown'])}" if videos else "simulator",
        "Scenes": facts["scenes"],
        "CIS fps": f"{facts['cis_fps']:g}",
        "Interpolated fps": f"{facts['interpolated_fps']:g}",
        "Samples": f"{facts['samples']} ({_keys(facts)} CIS frames a scene)",
        "DVS/CIS disparity": f"<= {facts['disparity_mm']:g} mm" if facts["disparity_mm"] else "0 mm",
        "Events": facts["events"],
        "Sensors": sensors_of(spec),
        "Layout": spec["layout"],
        "Seed": spec["seed"],
    }
    table = "\n".join(f"| {name} | {value} |" for name, value in rows.items())
    exposures = EXPOSED if spec["layout"] == "own" else KEYS
    known = KNOWN.format(exposures=exposures, scenes=CUT if videos else RENDERED)
    if films := [video for video in videos if not (is_scene(video) or video.startswith(SYNTHETIC_PREFIX))]:
        filmed = "They are real films." if len(films) == len(videos) else "Some of the videos are real films."
        known += "\n" + FILMED.format(filmed=filmed, interpolated=facts["interpolated_fps"])
    left_out = "\n".join(f"* {name}: {reason}" for name, reason in facts["left_out"].items())
    return (
        f"# Data card\n\nMade by vid2ev {facts['versions']['vid2ev']}; `dataset.json` has the same and each scene.\n\n"
        f"| | |\n| --- | --- |\n{table}\n\n## What has to be known\n\n{known}\n"
        + (f"\n## Left out\n\n{left_out}\n" if left_out else "")
    )


def sensors_of(spec: dict[str, Any]) -> str:
    """Whose sensors they are; parts of one film are seen by the same."""
    if spec["preset"] == "paper":
        return "those of the paper"
    return f"drawn anew for every {'video' if spec['videos'] else 'scene'}"


def _pace(slowdown: float) -> str:
    return "as fast as the world" if slowdown == 1 else f"{slowdown:g} times slower than the world"


def _keys(facts: dict[str, Any]) -> str:
    """How many frames scenes have of their frame camera; fewer where frames of a film are missing."""
    least, most = (extreme(scene["key_frames"] for scene in facts["of_scenes"].values()) for extreme in (min, max))
    return f"{least} to {most}" if least < most else str(least)


def _used(facts: dict[str, Any]) -> str:
    """How many of the videos that were given there are scenes of, by the beginnings of their names."""
    given = len(facts["spec"]["videos"])
    used = len({name.rpartition("-")[0] for name in facts["of_scenes"]})
    return counted(given, "video") if used == given else f"{used} of {given} videos"
