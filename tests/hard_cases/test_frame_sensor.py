"""Frame sensors at the edge: every combination of their effects, any light, any clock."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.stream.exposures import Exposure

SIZE = (5, 4)
AXES: dict[str, tuple[dict, ...]] = {
    "colour": ({"colour": False}, {"colour": True}),
    "exposure": ({"exposure_us": 0.0}, {"exposure_us": 1700.0}, {"exposure_us": 250_000.0}),
    "lines": ({"line_us": 0.0}, {"line_us": 930.0}),
    "pattern": ({"prnu": 0.0}, {"prnu": 0.4, "dsnu": 30.0}),
    "shot noise": ({"shot_noise": False}, {"shot_noise": True}),
    "well": ({"full_well_e": 0.0}, {"full_well_e": 6000.0}),
    "read noise": ({"read_noise_e": 0.0}, {"read_noise_e": 9.0}),
    "shading": ({"shading": ()}, {"shading": (-0.2, -0.9)}),
    "noise": ({"noise_lsb": 0.0}, {"noise_lsb": 5.2}),
    "bits": ({"bits": 10}, {"bits": 1, "slope": 65535.0}, {"bits": 16, "slope": 1.0}),
}
EVERY = [  # all 2304
    CisSpec(frame_rate_hz=90.0, **{key: value for choice in choices for key, value in choice.items()})
    for choices in itertools.product(*AXES.values())
]
lights = st.one_of(
    st.sampled_from([0.0, 1.0, np.nan, np.inf, -np.inf, -1.0, 3e38, 1e-45, 65504.0]), st.floats(0, 10, width=32)
)
steps = st.lists(st.floats(0, 8).map(lambda e: int(10**e)), min_size=1, max_size=6)


def run(cis: Cis, t_ns: list[int], light: np.ndarray) -> list[Exposure]:
    return [each for t, frame in zip(t_ns, light, strict=True) for each in cis.step(frame, t)]


def check(spec: CisSpec, made: list[Exposure], first_ns: int, last_ns: int) -> None:
    """Codes have their bits, exposures follow each other, and each has closed when it comes."""
    window_ns = 1e3 * spec.window_us(SIZE[1])
    assert [each.index for each in made] == list(range(len(made)))
    for each in made:
        assert each.codes.dtype == np.uint16 and each.codes.max() <= spec.top
        assert each.light is not None and np.isfinite(each.light).all() and each.light.min() >= 0
        assert first_ns <= each.start_ns <= each.end_ns <= last_ns + 1
        assert abs(each.end_ns - each.start_ns - window_ns) <= 1
    # Each that the light lasted for is there.
    period_ns = 1e9 / spec.frame_rate_hz
    assert abs(len(made) - max(0.0, (last_ns - first_ns - window_ns) / period_ns + 1)) <= 1


@settings(max_examples=200, derandomize=True)
@given(
    st.sampled_from(EVERY), st.integers(-(10**17), 10**17), steps, st.lists(lights, min_size=5, max_size=5),
    st.integers(1, 6), st.integers(0, 2**64 - 1),
)  # fmt: skip
def test_every_frame_sensor_stays_finite_ordered_and_the_same_to_the_bit(spec, start_ns, steps, values, cut, seed):
    """Whole, in threads, and cut in two: the same codes of any light at any times."""
    t_ns = np.cumsum([start_ns, *steps]).tolist()
    shape = (len(t_ns), *SIZE[::-1], 3) if spec.colour else (len(t_ns), *SIZE[::-1])
    light = np.array(values, np.float32)[np.random.default_rng(seed).integers(0, 5, shape)]
    whole = Cis(spec, SIZE, seed, linear=True)
    made = run(whole, t_ns, light)
    check(spec, made, t_ns[0], t_ns[-1])
    before, after = Cis(spec, SIZE, seed, threads=3), Cis(spec, SIZE, seed)
    again = run(before, t_ns[:cut], light[:cut])
    after.restore(before.state())
    again += run(after, t_ns[cut:], light[cut:])
    assert len(made) == len(again) and after.counts == whole.counts
    assert all(np.array_equal(a.codes, b.codes) for a, b in zip(made, again, strict=True))
    for name, plane in whole.state().items():
        assert not np.isnan(np.asarray(plane, np.float64)).any(), name


CLEAN = [spec for spec in EVERY if spec == spec.noiseless()]


@settings(max_examples=80, derandomize=True)
@given(st.sampled_from(CLEAN), st.integers(0, 2**32 - 1), st.floats(1, 1e6))
def test_more_light_never_gives_a_lower_code(spec, seed, gain):
    """Without noise, in every pixel of every exposure."""
    rng = np.random.default_rng(seed)
    light = (10 ** rng.uniform(-4, 2, (8, *SIZE[::-1]))).astype(np.float32)
    light = np.repeat(light[..., None], 3, -1) if spec.colour else light
    t_ns = np.cumsum(rng.integers(1, 60_000_000, 8)).tolist()
    dim, bright = (run(Cis(spec, SIZE), t_ns, frames) for frames in (light, light * np.float32(gain)))
    assert len(dim) == len(bright)
    assert all((a.codes <= b.codes).all() for a, b in zip(dim, bright, strict=True))


@pytest.mark.parametrize("exposure_us", [1.0, 900.0, 33_333.0, 1e6])
def test_a_frame_more_on_the_line_between_two_changes_nothing(exposure_us):
    """One step of dt is two of dt / 2: the exact light of an exposure, to 1e-7 of it."""
    rng = np.random.default_rng(2)
    light = (rng.integers(1, 4096, (30, *SIZE[::-1])) / 4096).astype(np.float32)
    t_ns = np.arange(30) * 80_000_000
    fine = np.empty((59, *SIZE[::-1]), np.float32)
    fine[::2], fine[1::2] = light, (light[1:] + light[:-1]) / 2
    spec = CisSpec(colour=False, exposure_us=exposure_us, line_us=77.0, frame_rate_hz=9.0).noiseless()
    coarse = run(Cis(spec, SIZE, linear=True), t_ns.tolist(), light)
    halves = run(Cis(spec, SIZE, linear=True), (np.arange(59) * 40_000_000).tolist(), fine)
    assert len(coarse) == len(halves) > 8
    for one, other in zip(coarse, halves, strict=True):
        np.testing.assert_allclose(one.light, other.light, rtol=2e-7)


def test_a_flash_of_36_decades_leaves_nothing_behind():
    """1e30 within an exposure: that one is white, all others are those of the light before and after, to the bit."""
    light = np.full((60, *SIZE[::-1]), 1e-6, np.float32)
    light[20] = 1e30
    spec = CisSpec(colour=False, exposure_us=5000, frame_rate_hz=50.0).noiseless()
    made = run(Cis(spec, SIZE, linear=True), (np.arange(60) * 10_000_000).tolist(), light)
    white = [each.index for each in made if (each.codes == spec.top).all()]
    assert white == [10] and len(made) == 30
    assert all((each.light == np.float32(1e-6)).all() for each in made if each.index != 10)


def test_a_row_of_8k_has_the_light_of_its_own_instant():
    """4320 rows, each 7.4 us after the one above: the last opens 32 ms late, to the nanosecond."""
    spec = CisSpec(colour=False, exposure_us=100.0, line_us=7.4, frame_rate_hz=10.0).noiseless()
    t_ns = (np.arange(12) * 4_000_000).tolist()
    light = np.broadcast_to((np.arange(12) / 16).astype(np.float32)[:, None, None], (12, 4320, 2))
    made = run_of(spec, (2, 4320), t_ns, light)
    middle_ms = (np.arange(4320) * 7.4 + 50.0) / 1e3
    assert len(made) == 1
    np.testing.assert_allclose(made[0].light[:, 0], middle_ms / 4 / 16, rtol=3e-7)


def run_of(spec: CisSpec, size: tuple[int, int], t_ns: list[int], light: np.ndarray) -> list[Exposure]:
    return run(Cis(spec, size, linear=True), t_ns, light)
