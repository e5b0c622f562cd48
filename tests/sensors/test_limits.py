"""What no sensor can be is refused in a sentence that says what is expected."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vid2ev import Cis, CisSpec, Dvs, DvsSpec, UsageError, events_of, load_cis, load_sensor
from vid2ev.sensors.batch import DvsBatch
from vid2ev.views.grid import NetCounts


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


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.int16, np.uint16])
def test_a_size_may_be_of_numbers_whose_product_is_beyond_their_type(kind: type) -> None:
    width, height = (400, 300) if kind(0).nbytes == 2 else (100, 90)
    size: Any = np.array([width, height], kind)
    light = np.ones((2, height, width), np.float32) * [[[0.1]], [[0.9]]]
    dvs, cis = Dvs(load_sensor("ideal"), size), Cis(load_cis("ideal", ["colour=false", "exposure_us=0"]), size)
    assert len(dvs.steps(light, [0, 10**6])[1]) == len(
        Dvs(load_sensor("ideal"), (width, height)).steps(light, [0, 1])[1]
    )
    assert cis.step(light[0], 0)[0].codes.shape == (height, width)


@pytest.mark.parametrize("overrides", ["threshold_on=0.2", [("threshold_on", 0.2)], [1]])
def test_overrides_that_are_no_list_of_texts_are_refused(overrides: Any) -> None:
    with pytest.raises(UsageError, match=r"expected a list of texts, such as \['threshold_on="):
        load_sensor("ideal", overrides)


@pytest.mark.parametrize(
    "options", [{"seed": 1.5}, {"seed": "random"}, {"seed": None}, {"camera": 0.5}, {"threads": 2.5}, {"threads": True}]
)
def test_what_is_no_whole_number_is_refused(options: Any) -> None:
    for sensor in (lambda: Dvs(DvsSpec(), (2, 2), **options), lambda: Cis(CisSpec(), (2, 2), **options)):
        with pytest.raises(UsageError, match=f"{next(iter(options))} .*expected a whole number"):
            sensor()
    if "seed" in options:
        with pytest.raises(UsageError, match=r"seed .*expected a whole number"):
            events_of("synthetic:moving-edge", **options)


@pytest.mark.parametrize("spec", ["ideal", None, {"threshold_on": 0.2}])
def test_what_is_not_the_parameters_of_a_sensor_is_refused(spec: Any) -> None:
    with pytest.raises(UsageError, match=r"expected a DvsSpec, such as load_sensor\('ideal'\) gives"):
        Dvs(spec, (2, 2))
    with pytest.raises(UsageError, match=r"expected a CisSpec, such as load_cis\('ideal'\) gives"):
        Cis(spec, (2, 2))


@pytest.mark.parametrize(("load", "override", "expected"), [
    (load_sensor, "follower_tau_us=1e-320", "0, or at least 1e-100"), (load_cis, "white_e=5e-324", "at least 1e-100"),
])  # fmt: skip
def test_what_is_nearer_to_nothing_than_any_measure_is_refused(load: Any, override: str, expected: str) -> None:
    with pytest.raises(UsageError, match=f"{override.partition('=')[0]} .*: expected {expected}"):
        load("paper", [override])
    assert load("paper", [override.replace("e-3", "e-0")])


@pytest.mark.parametrize("transfer", ["x", "gamma:0", 3])
def test_a_transfer_that_is_none_is_refused_when_the_sensor_is_made(transfer: Any) -> None:
    with pytest.raises(UsageError, match=r"transfer '.*': expected"):
        Dvs(DvsSpec(), (2, 2), transfer=transfer)


@pytest.mark.parametrize("t_ns", ["2", None, float("nan"), float("inf"), [1, 2], 1.5, 2**63, -(2**63)])
def test_a_time_that_is_none_is_refused(t_ns: Any) -> None:
    for sensor, light in ((Dvs(DvsSpec(), (2, 2)), np.zeros((2, 2))), (Cis(CisSpec(), (2, 2)), np.zeros((2, 2, 3)))):
        sensor.step(light, 0)
        with pytest.raises(UsageError, match="expected a whole number of nanoseconds"):
            sensor.step(light, t_ns)
    with pytest.raises(UsageError, match="1 time for 1 frame of light: expected a list"):
        Dvs(DvsSpec(), (2, 2)).steps(np.zeros((1, 2, 2)), 5)  # type: ignore[arg-type]


@pytest.mark.parametrize("origin_ns", ["2", float("nan"), [1, 2], 1.5, 2**63])
def test_an_origin_that_is_no_time_is_refused_when_the_sensor_is_made(origin_ns: Any) -> None:
    with pytest.raises(UsageError, match=r"origin_ns .*: expected a whole number of nanoseconds"):
        Dvs(DvsSpec(), (2, 2), origin_ns=origin_ns)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", [np.float32, np.float64, ">f8", np.longdouble])
def test_light_beyond_float32_is_mended_of_whatever_type(kind: Any) -> None:
    light = np.full((2, 2), np.finfo(kind).max, kind)
    for sensor in (Dvs(DvsSpec(), (2, 2)), Cis(load_cis("ideal", ["colour=false"]), (2, 2))):
        sensor.step(light, 0)
        assert sensor.counts["not_finite"] == 4


def test_a_burst_is_over_whatever_times_there_are() -> None:
    """From the first to the last, which are more than 2^63 ns apart; no exposure opens, and so on without end."""
    cis = Cis(load_cis("ideal", ["colour=false", "exposure_us=0", "burst=1"]), (2, 2))
    assert [len(cis.step(np.ones((2, 2)), t_ns)) for t_ns in (1 - 2**63, 0, 2**63 - 1)] == [1, 0, 0]


@pytest.mark.parametrize("first_ns", [1 - 2**63, -(2**62), 2**62, 2**63 - 1 - 20_000_000])
@pytest.mark.parametrize("more", [[], ["delay_us=5", "frame_rate_hz=100"]])
def test_a_state_of_whatever_time_is_taken_up(first_ns: int, more: list[str]) -> None:
    spec = load_sensor("ideal", more)
    dvs, other = Dvs(spec, (1, 1)), Dvs(spec, (1, 1))
    cis, other_cis = (Cis(load_cis("ideal", ["colour=false"]), (1, 1)) for _ in range(2))
    for sensor in (dvs, cis):
        for k in range(2):
            sensor.step(np.full((1, 1), 0.1 + k), first_ns + k * 10_000_000)
    other.restore(dvs.state())
    other_cis.restore(cis.state())
    light, last_ns = np.full((1, 1), 4.0), first_ns + 20_000_000
    sent, again = dvs.step(light, last_ns), other.step(light, last_ns)
    assert len(sent) > 0 and np.array_equal(sent.t, again.t)
    assert len(cis.step(light, last_ns)) == len(other_cis.step(light, last_ns))


def test_what_is_no_state_of_the_sensor_is_refused() -> None:
    late = load_sensor("ideal", ["delay_us=5", "frame_rate_hz=100"])
    dvs, cis = (Dvs(late, (2, 2)), np.zeros((2, 2))), (Cis(CisSpec(), (2, 2)), np.zeros((2, 2, 3)))
    for sensor, light in (dvs, cis):
        sensor.step(light, 0)
        state = sensor.state()
        for wrong in ({"a": 1}, *({**state, name: "x"} for name in state)):
            with pytest.raises(UsageError, match="another sensor's state"):
                sensor.restore(wrong)
        for name in state.keys() - {"totals", "pending"}:  # (of exposures that are open)
            with pytest.raises(UsageError, match=f"state without '{name}'"):
                sensor.restore({other: array for other, array in state.items() if other != name})


@pytest.mark.parametrize("pixels", [[-1], [4], [0.0], ["a"], 1, [[0, 1]]])
def test_nobody_looks_into_pixels_that_are_not_there(pixels: Any) -> None:
    dvs = Dvs(DvsSpec(), (2, 2))
    dvs.step(np.zeros((2, 2)), 0)
    assert len(dvs.inside([0, 3]).signal) == 2  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="expected a list of whole numbers from 0 to 3"):
        dvs.inside(pixels)


@pytest.mark.parametrize(
    ("light", "sentence"),
    [
        ([np.zeros((2, 2)), np.zeros((1, 2))], r"shapes \(1, 2\), \(2, 2\): expected \(2, 2\) of each"),
        (np.zeros((2, 2)), r"shape \(2, 2\): expected \(frames, 2, 2\)"),
        (1.0, r"shape \(\): expected \(frames, 2, 2\)"),
        ([], r"shape \(0,\): expected \(frames, 2, 2\)"),
        (np.zeros((2, 3, 2)), r"shape \(3, 2\): expected \(2, 2\)"),
    ],
)
def test_frames_of_light_are_all_of_one_shape(light: Any, sentence: str) -> None:
    dvs = Dvs(DvsSpec(), (2, 2))
    for step in (lambda: dvs.steps(light, [0, 1]), lambda: dvs.fill(NetCounts((2, 2), [0, 1]), light, [0, 1])):
        with pytest.raises(UsageError, match=sentence):
            step()
    assert not dvs.state()


@pytest.mark.parametrize(
    ("specs", "seeds", "cameras", "sentence"),
    [
        (DvsSpec(), [1], None, "^specs of type DvsSpec: expected a list"),
        ([DvsSpec()], 1, None, "^seeds of type int: expected a list"),
        ([DvsSpec()], None, None, "^seeds of type NoneType: expected a list"),
        ([DvsSpec()], [1], 0, "^cameras of type int: expected a list"),
    ],
)
def test_a_batch_takes_lists(specs: Any, seeds: Any, cameras: Any, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        DvsBatch(specs, (2, 2), seeds, cameras=cameras)
