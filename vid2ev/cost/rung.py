"""A rung of the ladder: what is asked of `convert` otherwise than by default."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel

from vid2ev.sensors.record import changed
from vid2ev.toml_text import toml_value


@dataclass(frozen=True)
class Rung:
    """A setting.

    name      what it is called in tables
    group     what it changes: light (between the frames), timing, filter, effects, size, frames (of frame cameras),
              views, several; "" for the default and the reference
    options   options of a conversion by their names in Python: upsample, subframes, max_subframes, effects, depth, size
    settings  keys of sensors and their values; those of frame sensors begin with `cis.`
    offered   whether it may be recommended: it makes the same kind of recording
    float64   lags of light are carried in float64 in every pixel, not only where float32 would not do
    coarse    pixels of the recording that each of its pixels stands for, along a row and along a column
    """

    name: str
    group: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    offered: bool = True
    float64: bool = False
    coarse: int = 1

    def applied(self, options: Mapping[str, Any]) -> dict[str, Any]:
        """The options of a conversion (those of `Recipe.of`, and effects) with what the rung changes."""
        asked = {**options, **self.options}
        for sensor, key in (("sensor", "dvs"), ("cis", "cis")):
            mine = {name: value for name, value in self.settings.items() if name.startswith("cis.") == (key == "cis")}
            if mine and isinstance(asked.get(sensor), BaseModel):
                asked[sensor] = changed(asked[sensor], {name.removeprefix("cis."): mine[name] for name in mine})
            else:
                asked["overrides"] = [*asked.get("overrides", ()), *_texts(mine)]
        return asked

    def arguments(self) -> str:
        """The same on the command line of `convert`."""
        words = [word for name, value in self.options.items() for word in (f"--{name.replace('_', '-')}", str(value))]
        words += [word for text in _texts(self.settings) for word in ("--set", text)]
        return shlex.join(words)

    def with_(self, other: Rung) -> Rung:
        """Both together; what the other asks goes before."""
        return Rung(
            self.name,
            self.group,
            {**self.options, **other.options},
            {**self.settings, **other.settings},
            self.offered and other.offered,
        )


def _texts(settings: Mapping[str, Any]) -> list[str]:
    return [f"{key}={value if isinstance(value, str) else toml_value(value)}" for key, value in settings.items()]
