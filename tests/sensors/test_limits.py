"""What no sensor can be is refused in a sentence that says what is expected."""

from __future__ import annotations

from typing import Any

import pytest

from vid2ev import Cis, CisSpec, Dvs, DvsSpec, UsageError, events_of, load_sensor


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ((0, 5), "33554432 pixels in all, and 65535 a side"),
        ((100_000, 1), "33554432 pixels in all, and 65535 a side"),
        ((8000, 8000), "33554432 pixels in all, and 65535 a side"),
        ((2,), "two whole numbers"),
        ((1.5, 2), "two whole numbers"),
        ("ab", "two whole numbers"),
        (5, "two whole numbers"),
    ],
)
def test_a_size_that_cannot_be_is_refused(size: Any, expected: str) -> None:
    with pytest.raises(UsageError, match=expected) as error:
        Dvs(DvsSpec(), size)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("overrides", ["threshold_on=0.2", [("threshold_on", 0.2)], [1]])
def test_overrides_that_are_no_list_of_texts_are_refused(overrides: Any) -> None:
    with pytest.raises(UsageError, match=r"expected a list of texts, such as \['threshold_on="):
        load_sensor("ideal", overrides)


@pytest.mark.parametrize(
    "options", [{"seed": 1.5}, {"seed": "random"}, {"seed": None}, {"camera": 0.5}, {"threads": 2.5}]
)
def test_what_is_no_whole_number_is_refused(options: Any) -> None:
    for sensor in (lambda: Dvs(DvsSpec(), (2, 2), **options), lambda: Cis(CisSpec(), (2, 2), **options)):
        with pytest.raises(UsageError, match=f"{next(iter(options))} .*expected a whole number"):
            sensor()
    if "seed" in options:
        with pytest.raises(UsageError, match=r"seed .*expected a whole number"):
            events_of("synthetic:moving-edge", **options)
