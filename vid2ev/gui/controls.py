"""Controls: what a page has to know of each parameter, from its specification alone.

A field of a pydantic model becomes a `Control`: its limits and choices are those of the field, its unit is in its
description or at the end of its name, and what it means is its description.  Nothing is written twice, so that a
parameter that is added has its control.

    number, whole   a number within limits
    switch          true or false
    choice          one of some words
    vector          as many numbers as it has places
    word            a text
    toml            anything else, as it is in a file: [0.1, -0.2], { pattern = "stripes" }, or a bare word
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from pydantic import BaseModel

from vid2ev.requests import number_of, setting
from vid2ev.toml_text import parsed_toml, toml_value

SUFFIXES = {
    "us": "us", "ms": "ms", "s": "s", "hz": "Hz", "deg": "deg", "mm": "mm", "m": "m", "px": "px", "e": "e",
    "lsb": "LSB",
}  # fmt: skip
SPAN = 4  # of a slider, in multiples of the greatest value that is in use
USUAL = {"us": 500.0, "Hz": 25.0, "e": 25.0, "electrons": 25.0, "LSB": 2.5}  # where that is 0
STEPS = 200
DIGITS = 6


@dataclass(frozen=True)
class Control:
    """A parameter as a page shows it.

    group     the effect that it is of, where the model is made of several
    unit      "" where it has none
    default   None where there is none, or where it may be left out
    low, high its limits; `above` says that `low` itself is beyond them
    choices   the words of a choice
    places    the numbers of a vector
    optional  whether it may be left out
    alike     whether the name of another differs from its own by the unit alone
    """

    key: str
    kind: Literal["number", "whole", "switch", "choice", "vector", "word", "toml"]
    group: str
    unit: str
    meaning: str
    default: Any = None
    low: float | None = None
    high: float | None = None
    above: bool = False
    choices: tuple[str, ...] = ()
    places: int = 0
    optional: bool = False
    alike: bool = False

    @property
    def label(self) -> str:
        """The name as words, without the unit unless that tells it from another."""
        return (self.key if self.alike else _stem(self.key)).replace("_", " ")

    @property
    def limits(self) -> str:
        """The limits in words; "" for none."""
        least = "" if self.low is None else f"above {self.low:g}" if self.above else f"from {self.low:g}"
        most = "" if self.high is None else f"at most {self.high:g}"
        return ", ".join(part for part in (least, most) if part)

    def parsed(self, shown: Any) -> Any:
        """The value of what a person entered.  Raises ValueError for what cannot be read as such a value."""
        if shown is None or (isinstance(shown, str) and not shown.strip()):
            if self.optional:
                return None
            raise ValueError(f"{self.key} is empty; enter a value" + (f" {self.limits}" if self.limits else ""))
        if self.kind == "toml" and isinstance(shown, str):
            return _listed(setting(f"{self.key}={shown}", f"{self.key}={toml_value(self.default)}")[1])
        if self.kind == "whole" and isinstance(shown, float) and shown.is_integer():
            return int(shown)
        return shown

    def shown(self, value: Any) -> Any:
        """How a value is shown: the inverse of `parsed`, but for digits that nobody reads."""
        if self.kind == "toml":
            return "" if value is None else value if _is_bare(value) else toml_value(value)
        if isinstance(value, float) and math.isfinite(value):
            return float(f"{value:.{DIGITS}g}")
        return [self.shown(part) for part in value] if isinstance(value, tuple) else value


def controls_of(model: type[BaseModel], without: Iterable[str] = ()) -> tuple[Control, ...]:
    """A control for each field of a model, in their order, but for those `without`."""
    schema = model.model_json_schema()
    groups = _groups(model)
    required = schema.get("required", [])
    stems = Counter(map(_stem, schema["properties"]))
    return tuple(
        replace(_control(key, said, schema.get("$defs", {}), groups[key], key in required), alike=stems[_stem(key)] > 1)
        for key, said in schema["properties"].items()
        if key not in without
    )


def reach(control: Control, seen: Iterable[Any]) -> tuple[float, float, float] | None:
    """From where to where a slider goes, and by which steps: as far as the values in use ask for, within the limits.
    None where a slider says nothing: of words, and of numbers that may be left out."""
    if control.kind not in ("number", "whole") or control.optional:
        return None
    known = [abs(float(value)) for value in seen if isinstance(value, int | float) and not isinstance(value, bool)]
    usual = USUAL.get(control.unit, 10.0 if control.kind == "whole" else 0.1)
    high = _round(SPAN * (max(known, default=0.0) or usual))
    high = high if control.high is None else min(high, control.high)
    step = _round(high / STEPS)
    step = max(step, 1.0) if control.kind == "whole" else step
    low = -high if control.low is None else max(control.low, -high)
    return (step if 0 < low < step or control.above else low), high, step


def _stem(key: str) -> str:
    stem, _, suffix = key.rpartition("_")
    return stem if stem and suffix in SUFFIXES else key


def _control(key: str, said: Mapping[str, Any], known: Mapping[str, Any], group: str, required: bool) -> Control:
    options = [_resolved(one, known) for one in said.get("anyOf", [said])]
    present = [one for one in options if one.get("type") != "null"]
    meaning = str(said.get("description", ""))
    unit = re.search(r" \[([^\]]+)\]", meaning)
    facts: dict[str, Any] = {
        "default": None if required else _listed(said.get("default")),
        "optional": len(present) < len(options),
        "unit": unit[1] if unit else SUFFIXES.get(key.rpartition("_")[2] if "_" in key else "", ""),
        "meaning": meaning.replace(unit[0], "") if unit else meaning,
    }
    return Control(key=key, group=group, **facts, **_form(present))


def _form(options: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Kind, limits and choices of a field that is one of these."""
    one = options[0]
    kind = one.get("type")
    if len(options) > 1:
        return {"kind": "toml"}
    if "enum" in one:
        return {"kind": "choice", "choices": tuple(one["enum"])}
    if kind == "boolean":
        return {"kind": "switch"}
    if kind in ("number", "integer"):
        return {"kind": "whole" if kind == "integer" else "number"} | _limits(one)
    if kind == "array" and all(place.get("type") in ("number", "integer") for place in one.get("prefixItems", [{}])):
        return {"kind": "vector", "places": len(one["prefixItems"])} | _limits(one["prefixItems"][0])
    return {"kind": "word" if kind == "string" else "toml"}


def _limits(said: Mapping[str, Any]) -> dict[str, Any]:
    above = "exclusiveMinimum" in said
    return {"low": said.get("exclusiveMinimum", said.get("minimum")), "high": said.get("maximum"), "above": above}


def _resolved(said: Mapping[str, Any], known: Mapping[str, Any]) -> Mapping[str, Any]:
    return known[said["$ref"].rpartition("/")[2]] if "$ref" in said else said


def _groups(model: type[BaseModel]) -> dict[str, str]:
    """The base class that each field comes from, as words."""
    own = {key: model for key in model.model_fields}
    for base in model.__mro__:
        if issubclass(base, BaseModel) and base is not BaseModel:
            own |= {key: base for key in vars(base).get("__annotations__", {}) if key in own}
    return {
        key: re.sub(r"(?<=.)([A-Z])", lambda found: f" {found[1].lower()}", base.__name__) for key, base in own.items()
    }


def _listed(value: Any) -> Any:
    return tuple(map(_listed, value)) if isinstance(value, list) else value


def _is_bare(value: Any) -> bool:
    """Whether a value is a text that can stand without quotes."""
    if not isinstance(value, str) or not value.strip():
        return False
    try:
        parsed_toml(f"value = {value}")
    except ValueError:
        return math.isnan(number_of(value))
    return False


def _round(number: float) -> float:
    """The next number of 1, 2, 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(number))
    return next(part * power for part in (1, 2, 5, 10) if part * power >= number * (1 - 1e-9))
