"""The networks, by name.

A new network is a module with a specification and a class, and a line in `NETWORKS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from vid2ev.errors import UsageError, nearest, reason_of

if TYPE_CHECKING:
    from torch import nn

    from interp.networks.spec import NetworkSpec


@dataclass(frozen=True, slots=True)
class Entry:
    """Where a network is: its module, its class, whose specification is called `...Spec`, and its own defaults."""

    module: str
    network: str
    defaults: Mapping[str, Any] = field(default_factory=dict)


NETWORKS = {
    "superslomo": Entry("superslomo", "SuperSlomo", {"events": "none"}),
    "slomo_events": Entry("superslomo", "SuperSlomo"),
    "rrin": Entry("rrin_events", "RrinEvents", {"depths": (5, 4, 4, 4), "bins": 0}),
    "rrin_light": Entry(
        "rrin_events", "RrinEvents", {"bins": 0, "coarse": True, "first_flow": "dis", "depths": (4, 4, 4, 4)}
    ),
    "rrin_events": Entry("rrin_events", "RrinEvents"),
    "rrin_events_light": Entry(
        "rrin_events",
        "RrinEvents",
        {"coarse": True, "candidate": "mixed", "events_into_residue": True, "gate": True, "depths": (5, 4, 4, 4)},
    ),
    "rrin_events_guided": Entry("rrin_events_guided", "RrinEventsGuided"),
    "rrin_slomo_events": Entry("rrin_slomo_events", "RrinSlomoEvents"),
    "timelens": Entry("timelens", "TimeLens"),
    "flow": Entry("flow", "FlowNetwork"),
    "e2vid": Entry("e2vid", "E2vid"),
    "firenet": Entry("firenet", "FireNet"),
    "hdr": Entry("hdr", "Hdr"),
}


def names() -> list[str]:
    """The names of the networks."""
    return list(NETWORKS)


def make(name: str, /, size: str = "tiny", **options: Any) -> nn.Module:
    """A network with fresh weights, from torch's generator.

    size      tiny, small or paper
    options   fields of its specification; see `spec_of`
    Raises UsageError for a name, size or option that cannot be.
    """
    entry = _entry(name)
    return getattr(_module(entry), entry.network)(spec_of(name, size, **options))


def spec_of(name: str, /, size: str = "tiny", **options: Any) -> NetworkSpec:
    """The specification of a network; raises as `make` does."""
    entry = _entry(name)
    model = getattr(_module(entry), f"{entry.network}Spec")
    for key, value in options.items():
        field = model.model_fields.get(key)
        if isinstance(value, bool) and field is not None and field.annotation is not bool:  # (pydantic: 1 or 0)
            raise UsageError(f"{name}: {key} = {value!r} is impossible: it must not be true or false")
    try:
        return model(**{**entry.defaults, "size": size, **options})
    except ValidationError as error:
        complaint = error.errors()[0]
        key = str(complaint["loc"][0]) if complaint["loc"] else "options"
        if complaint["type"] == "extra_forbidden":
            hint = nearest(key, model.model_fields)
            raise UsageError(f"{name} has no option '{key}'{hint}; it has {', '.join(model.model_fields)}") from error
        what = f"{key} = {complaint['input']!r}"
        raise UsageError(f"{name}: {what} is impossible: {reason_of(complaint)}") from error


def _entry(name: str) -> Entry:
    if not isinstance(name, str) or name not in NETWORKS:
        raise UsageError(f"network '{name}'{nearest(str(name), NETWORKS)}: expected one of {', '.join(NETWORKS)}")
    return NETWORKS[name]


def _module(entry: Entry) -> Any:
    return import_module(f"interp.networks.{entry.module}")
