"""Ranges of sensors: what is accepted gives sensors, whatever is drawn, and what gives none is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from interp.data.chance import chance, log_uniform, one_of, uniform
from interp.data.sensor_ranges import SENSORS, SensorRanges
from vid2ev.sensors.spec import DvsSpec

NUMBERS = st.sampled_from(
    [-1.0, 0.0, 5e-324, 1e-200, 1e-12, 1e-9, 1e-6, 1e-3, 0.01, 0.5, 1.0, 10.0, 100.0, 5e4, 65535.0, 1e6, 1e9, 1e308]
) | st.floats(-1, 2) | st.floats(0, 1e9)  # fmt: skip
FIELDS = SensorRanges.model_fields
OF_RANGES = {name for name, field in FIELDS.items() if isinstance(field.default, tuple) and name != "kinds"}


class Ends(np.random.Generator):
    """Draws that lie at one end of every range."""

    def __init__(self, at: float):
        super().__init__(np.random.PCG64(0))
        self._at = at

    def random(self, *_: Any) -> Any:
        return self._at

    def uniform(self, low: Any = 0.0, high: Any = 1.0, *_: Any) -> Any:
        return low + (high - low) * self._at


@st.composite
def ranges(draw: st.DrawFn) -> SensorRanges:
    """Ranges that are accepted, near and at their limits and far from what anybody means."""
    said: dict[str, Any] = {}
    for name in FIELDS:
        if name == "kinds":
            value: Any = tuple(draw(st.lists(NUMBERS, min_size=3, max_size=3)))
        elif name in OF_RANGES:
            value = tuple(sorted(draw(st.lists(NUMBERS, min_size=2, max_size=2))))
        else:
            value = draw(st.floats(0, 1))
        if accepted({name: value}):
            said[name] = value
    assume(accepted(said))
    return SensorRanges(**said)


def accepted(said: dict[str, Any]) -> bool:
    try:
        SensorRanges(**said)
    except ValidationError:
        return False
    return True


@given(ranges(), st.sampled_from([0.0, 1e-16, 0.5, 1 - 2**-53]), st.integers(0, 1 << 32), st.integers(4, 10**8))
def test_whatever_ranges_are_accepted_sensors_come_of_them(
    asked: SensorRanges, at: float, seed: int, gap_us: int
) -> None:
    for draw in (np.random.default_rng(seed), Ends(at)):
        dvs = asked.dvs(draw)
        assert asked.threshold[0] <= dvs.threshold_on <= asked.threshold[1]
        assert asked.refractory_us[0] <= dvs.refractory_us <= asked.refractory_us[1]
        asked.cis(draw, gap_us, uniform(draw, asked.exposure) * gap_us)


@pytest.mark.parametrize("kind", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1e6, 1e-12, 0)])
def test_only_kinds_with_a_share_are_drawn(kind: tuple[float, float, float]) -> None:
    for at in (0.0, 1 - 2**-53):
        assert kind[one_of(Ends(at), SensorRanges(kinds=kind).kinds)] > 0


@given(st.floats(1e-9, 1), st.floats(1, 1e9), st.floats(0, 1, exclude_max=True))
def test_what_is_drawn_in_the_logarithm_lies_in_its_range(low: float, high: float, at: float) -> None:
    assert low <= log_uniform(Ends(at), (low, high)) <= high


@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8])
def test_draws_are_those_of_a_number_whatever_its_type(kind: type) -> None:
    assert chance(kind(5), "sample", kind(3)).random() == chance(5, "sample", 3).random()
    assert chance(5, "sample", 3).random() != chance(5, "sample", "3").random()


@pytest.mark.parametrize("name", SENSORS)
def test_the_presets_are_accepted_as_they_are_written_down(name: str) -> None:
    asked = SENSORS[name]
    assert SensorRanges.model_validate_json(asked.model_dump_json()) == asked
    assert isinstance(asked.dvs(np.random.default_rng(0)), DvsSpec)
