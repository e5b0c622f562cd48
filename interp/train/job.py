"""What is trained, how and with what: one frozen record, which decides every bit of the result.

`Job.of` makes it from what people ask for; a run's folder keeps it, and `Job.read` reads it back.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from interp.data.inputs import inputs_of
from interp.data.samples import SampleSettings
from interp.data.settings import PRESETS, ClipSettings
from interp.networks import spec_of
from interp.train.recipe import RECURRENT, Recipe
from interp.train.starts import WHOLE, check_frozen, digests, network_of
from vid2ev.errors import UsageError, clause, nearest, reason_of
from vid2ev.requests import setting

EVENT_FED = ("e2vid", "firenet")
SEQUENTIAL = (*EVENT_FED, "hdr")
NOTHING: Mapping[str, Path] = MappingProxyType({})
PARTS = ("recipe", "network", "clips", "samples", "window", "validation")
NETWORK, SIZE = "rrin_events_guided", "tiny"  # unless said otherwise
EXAMPLE = "rate=0.001, network.bins=5, clips.multiples=[16] or samples.size=128"


class Window(BaseModel):
    """Which of all clips samples are drawn from while training goes on (`interp.data.pool`)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    begin: int = Field(256, ge=1, description="clips that there are before the first sample")
    most: int = Field(1500, ge=1, description="clips at any time; each of 128x128 pixels takes 2.6 MB of disk")
    fresh: float = Field(0.02, ge=0, le=1e6, description="clips that join with each sample")

    @model_validator(mode="after")
    def _fits(self) -> Window:
        if self.begin > self.most:
            raise ValueError(f"begin {self.begin} and most {self.most}: expected no more in the beginning than at most")
        return self


class Validation(BaseModel):
    """Clips that training never sees."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    clips: int = Field(8, ge=1, description="of scenes, for each of two event sensors")
    videos: tuple[str, ...] = Field((), description="real ones, with frames left out; four clips of each")


class Job(BaseModel):
    """All that decides a run, with the files that it names.

    options   those of the network that are not its defaults
    starts    digests of the weights that it begins with, by part (`starts.py`)
    inputs    digests of the files that it is trained and validated with, as they were when it was begun
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    network: str
    size: str
    options: dict[str, Any]
    recipe: Recipe
    clips: ClipSettings
    samples: SampleSettings
    window: Window
    validation: Validation
    starts: dict[str, str] = {}
    inputs: dict[str, str] = {}

    @property
    def sequences(self) -> bool:
        """Whether the network learns from frames one after the other."""
        return self.network in SEQUENTIAL

    @property
    def colours(self) -> int:
        """Of the frames that the network learns from; of those that take none, of what is made of clips."""
        return getattr(spec_of(self.network, self.size, **self.options), "colours", 3)

    @classmethod
    def of(
        cls,
        network: str | None = None,
        size: str | None = None,
        settings: Sequence[str] = (),
        videos: Sequence[str] = (),
        recordings: Sequence[str] = (),
        validation_videos: Sequence[str] = (),
        starts: Mapping[str, Path] = NOTHING,
    ) -> Self:
        """The job for a network, with `key=value` settings.

        network, size   those of the weights that it starts with; else rrin-events-guided, tiny
        settings   of the recipe, or of `network.`, `clips.`, `samples.`, `window.`, `validation.`
        videos, recordings   to train with, instead of what is made on the fly
        starts     files of weights to begin with, by part (`starts.parsed`)
        Raises UsageError for what cannot be meant.
        """
        asked = by_part(settings)
        if "size" in asked["network"]:
            said = asked["network"]["size"]
            raise UsageError(f"setting network.size = {said!r}: it is none of a network's settings; give --size")
        network, size = network_and_size(network, size, starts)
        options = (network_of(starts[WHOLE])[2] if WHOLE in starts else {}) | asked["network"]
        coded = getattr(spec_of(network, size, **options), "transfer", "srgb")  # (raises for what cannot be)
        if coded != "srgb":
            raise UsageError(f"network.transfer = '{coded}': frames to learn from are sRGB codes; leave it out")
        check_frozen(network, size, options, starts)
        clips = _clip_defaults(network, videos, recordings) | asked["clips"]
        recipe = (RECURRENT if network in SEQUENTIAL else {}) | asked["recipe"]
        parts = {
            "recipe": _valid(Recipe, recipe, ""),
            "clips": _valid(ClipSettings, clips, "clips."),
            "samples": _valid(SampleSettings, asked["samples"], "samples."),
            "window": _valid(Window, asked["window"], "window."),
            "validation": _valid(Validation, {"videos": tuple(validation_videos)} | asked["validation"], "validation."),
        }
        if (network == "hdr") != (parts["clips"].light == "linear"):
            other, wanted = ("srgb", "linear") if network == "hdr" else ("linear", "srgb")
            raise UsageError(f"clips.light = '{other}' for {network}, which learns from '{wanted}'; leave it out")
        named = {"network": network, "size": size, "options": options, "starts": digests(starts)}
        return _valid(cls, named | parts, "")

    def trained_by(self, processes: int) -> Self:
        """The same by so many processes, without a GPU: that decides the last bits."""
        return self.model_copy(update={"recipe": self.recipe.model_copy(update={"processes": processes})})

    def kept(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """It as JSON, as a run's folder keeps it, with what is in the files that it names now; `besides` are folders
        that are no part of these, wherever they are."""
        now = {"starts": self.starts, "inputs": inputs_of(self.clips, self.validation.videos, besides)}
        return self.model_dump(mode="json", exclude=set(now)) | {name: known for name, known in now.items() if known}


def network_and_size(network: str | None, size: str | None, starts: Mapping[str, Path]) -> tuple[str, str]:
    """Those asked for, or of the weights that training starts with.  Raises UsageError where they contradict."""
    name = network.replace("-", "_") if network else None
    if WHOLE in starts:
        found = network_of(starts[WHOLE])[:2]
        if (name or found[0], size or found[1]) != found:
            asked = ", ".join(filter(None, [name, size]))
            raise UsageError(
                f"{starts[WHOLE]} holds weights of {', '.join(found)}, not of {asked}; leave --network and --size out"
            )
        return found
    return name or NETWORK, size or SIZE


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


def by_part(settings: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The values asked for, by what they are settings of."""
    parts: dict[str, dict[str, Any]] = {part: {} for part in PARTS}
    for text in settings:
        key, value = setting(text, EXAMPLE)
        part, dot, rest = key.partition(".")
        if dot and part not in parts:
            raise UsageError(
                f"setting '{text}': '{part}' has no settings{nearest(part, parts)}; write for example {EXAMPLE}"
            )
        if part != "network" and _has_truth(value):  # (pydantic: 1 or 0)
            raise UsageError(f"setting {text} is impossible: true and false are no numbers")
        *above, last = (rest if dot else key).split(".")
        values = parts[part if dot else "recipe"]
        for name in above:  # (clips.sensors.threshold: of a record within)
            within = values.get(name)
            values[name] = values = dict(within) if isinstance(within, dict) else {}
        values[last] = value
    return parts


def _has_truth(value: Any) -> bool:
    """Whether a value is true or false, or has one within."""
    within = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return isinstance(value, bool) or any(map(_has_truth, within))


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
            *above, last = map(str, complaint["loc"])
            for name in above:
                model, prefix = model.model_fields[name].annotation, f"{prefix}{name}."
            hint, known = nearest(last, model.model_fields), ", ".join(model.model_fields)
            raise UsageError(f"setting '{prefix}{last}' is unknown{hint}; expected one of {known}") from error
        raise UsageError(
            f"setting {prefix}{key} = {complaint['input']!r} is impossible: {reason_of(complaint)}"
        ) from error
