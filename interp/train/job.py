"""What is trained, how and with what: one frozen record, which decides every bit of the result.

`Job.of` makes it from what people ask for; a run's folder keeps it, and `Job.read` reads it back.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from interp.data.samples import SampleSettings
from interp.data.settings import PRESETS, ClipSettings
from interp.networks import spec_of
from interp.train.recipe import RECURRENT, Recipe
from vid2ev.errors import UsageError, clause, nearest
from vid2ev.requests import setting

EVENT_FED = ("e2vid", "firenet")
SEQUENTIAL = (*EVENT_FED, "hdr")
UNTRAINABLE = {"flow": "it learns from the true flow of scenes, which samples do not have"}
PARTS = ("recipe", "network", "clips", "samples", "window", "validation")
EXAMPLE = "rate=0.001, network.bins=5, clips.multiples=[16] or samples.size=128"


class Window(BaseModel):
    """Which of all clips samples are drawn from while training goes on (`interp.data.pool`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    begin: int = Field(256, ge=1, description="clips that there are before the first sample")
    most: int = Field(1500, ge=1, description="clips at any time; each of 128x128 pixels takes 1.6 MB of disk")
    fresh: float = Field(0.02, ge=0, description="clips that join with each sample")


class Validation(BaseModel):
    """Clips that training never sees."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    clips: int = Field(8, ge=1, description="of scenes, for each of two event sensors")
    videos: tuple[str, ...] = Field((), description="real ones, with frames left out; four clips of each")


class Job(BaseModel):
    """All that decides a run.  `options` are those of the network that are not its defaults."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    network: str
    size: str
    options: dict[str, Any]
    recipe: Recipe
    clips: ClipSettings
    samples: SampleSettings
    window: Window
    validation: Validation

    @property
    def sequences(self) -> bool:
        """Whether the network learns from frames one after the other."""
        return self.network in SEQUENTIAL

    @classmethod
    def of(
        cls,
        network: str,
        size: str = "tiny",
        settings: Sequence[str] = (),
        videos: Sequence[str] = (),
        recordings: Sequence[str] = (),
        validation_videos: Sequence[str] = (),
    ) -> Self:
        """The job for a network, with `key=value` settings.

        settings   of the recipe, or of `network.`, `clips.`, `samples.`, `window.`, `validation.`
        videos, recordings   to train with, instead of what is made on the fly
        Raises UsageError for what cannot be meant.
        """
        network = network.replace("-", "_")
        if network in UNTRAINABLE:
            raise UsageError(f"network '{network}' cannot be trained: {UNTRAINABLE[network]}; choose another")
        asked = _by_part(settings)
        spec_of(network, size, **asked["network"])
        clips = _clip_defaults(network, videos, recordings) | asked["clips"]
        recipe = (RECURRENT if network in SEQUENTIAL else {}) | asked["recipe"]
        parts = {
            "recipe": _valid(Recipe, recipe, ""),
            "clips": _valid(ClipSettings, clips, "clips."),
            "samples": _valid(SampleSettings, asked["samples"], "samples."),
            "window": _valid(Window, asked["window"], "window."),
            "validation": _valid(Validation, {"videos": tuple(validation_videos)} | asked["validation"], "validation."),
        }
        named = {"network": network, "size": size, "options": asked["network"]}
        return _valid(cls, named | parts, "")


def _clip_defaults(network: str, videos: Sequence[str], recordings: Sequence[str]) -> dict[str, Any]:
    preset = PRESETS["hdr" if network == "hdr" else "default"]
    chosen = preset.model_dump()
    if videos or recordings:
        chosen |= {"scenes": 0.0, "photographs": 0.0}
    if videos:
        chosen |= {"videos": float(len(videos)), "video_files": tuple(videos)}
    if recordings:
        chosen |= {"recordings": float(len(recordings)), "recording_folders": tuple(recordings)}
    return chosen


def _by_part(settings: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The values asked for, by what they are settings of."""
    parts: dict[str, dict[str, Any]] = {part: {} for part in PARTS}
    for text in settings:
        key, value = setting(text, EXAMPLE)
        part, dot, rest = key.partition(".")
        if dot and part not in parts:
            raise UsageError(
                f"setting '{text}': '{part}' has no settings{nearest(part, parts)}; write for example {EXAMPLE}"
            )
        parts[part if dot else "recipe"][rest if dot else key] = value
    return parts


def _valid(model: type[Any], values: dict[str, Any], prefix: str) -> Any:
    """The record of values; raises UsageError for those that cannot be."""
    try:
        return model(**values)
    except ValidationError as error:
        complaint = error.errors()[0]
        if not complaint["loc"]:
            raise UsageError(f"settings of {prefix.rstrip('.') or 'the recipe'}: {clause(complaint['msg'])}") from error
        key = ".".join(map(str, complaint["loc"]))
        if complaint["type"] == "extra_forbidden":
            hint = nearest(key, model.model_fields)
            raise UsageError(
                f"setting '{prefix}{key}' is unknown{hint}; expected one of {', '.join(model.model_fields)}"
            ) from error
        raise UsageError(
            f"setting {prefix}{key} = {complaint['input']!r} is impossible: {clause(complaint['msg'])}"
        ) from error
