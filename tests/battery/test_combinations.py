"""The battery leaves out no parameter, and `EVERYTHING` no effect: what is added to a sensor is added to them."""

from __future__ import annotations

from against.clips import EVERYTHING

from vid2ev.plan.plan import ASKED_FOR, EFFECTS
from vid2ev.sensors.spec import DvsSpec

from .combinations import FREE, KERNEL


def test_every_parameter_is_on_some_axis() -> None:
    choices = [keys for axis in (KERNEL | FREE).values() for keys in axis.values()]
    assert {key for keys in choices for key in keys} == {*DvsSpec.model_fields}


def test_everything_has_every_effect_that_makes_events_what_they_are() -> None:
    assert EVERYTHING.effects() == [name for name in EFFECTS if name not in ASKED_FOR]
