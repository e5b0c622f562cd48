"""Noise of frame sensors: its size, its shape, and that it is a function of seed, camera, pixel and exposure."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from vid2ev.physics.random import fill_words, philox
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec

SIZE = (160, 100)
PIXELS = SIZE[0] * SIZE[1]


def spec(**keys) -> CisSpec:
    """A sensor of instants and luminance at 1000 exposures a second, without noise but what is asked for."""
    plain = CisSpec(colour=False, exposure_us=0, frame_rate_hz=1000, min_illuminance=0, noise_lsb=0)
    return CisSpec(**(plain.model_dump() | keys))


def exposures(sensor: CisSpec, light: float | np.ndarray, n: int = 1, **rest) -> np.ndarray:
    """Codes [n, H, W] of a light that stays."""
    cis = Cis(sensor, SIZE, **rest)
    plane = np.broadcast_to(np.float32(light), SIZE[::-1])
    made = cis.step(plane, 0) + (cis.step(plane, (n - 1) * 1_000_000) if n > 1 else [])
    return np.array([each.codes for each in made])


def light_of(code: float | np.ndarray, sensor: CisSpec) -> np.ndarray:
    return (code * sensor.slope + sensor.min_illuminance) / 65535


@pytest.mark.parametrize("sigma", [0.6, 2.0, 5.2, 9.9])
def test_the_noise_of_the_adc_has_its_variance_and_that_of_rounding(sigma):
    """sigma^2 + 1/12 at codes from 50 to 970, wherever between two codes the light lies; and no bias."""
    sensor = spec(noise_lsb=sigma, min_illuminance=4096)
    levels = np.linspace(50, 970, SIZE[1])
    codes = exposures(sensor, light_of(levels, sensor)[:, None], n=60).astype(float)
    want, samples = sigma**2 + 1 / 12, 60 * SIZE[0]
    assert codes.mean() - levels.mean() == pytest.approx(0, abs=5 * math.sqrt(want / codes.size))
    of_rows = np.array([codes[:, y].var() for y in range(SIZE[1])])
    assert of_rows == pytest.approx(want, rel=5 * math.sqrt(2 / samples))
    assert of_rows.mean() == pytest.approx(want, rel=5 * math.sqrt(2 / codes.size))


def test_noise_is_gaussian():
    sensor = spec(noise_lsb=5.2)
    z = (exposures(sensor, light_of(500.0, sensor), n=40) - 500.0) / math.sqrt(5.2**2 + 1 / 12)
    n = z.size
    assert (z**3).mean() == pytest.approx(0, abs=5 * math.sqrt(15 / n))
    assert (z**4).mean() == pytest.approx(3, abs=5 * math.sqrt(96 / n))


def test_black_and_white_are_noisy_and_stay_within_their_bits():
    """Noise comes after the clip: half of black shows it, and no code leaves the ADC's range."""
    sensor = spec(noise_lsb=5.2, min_illuminance=4096)
    black, white = (exposures(sensor, light, n=20) for light in (0.0, 50.0))
    above = 0.5 * math.erfc(0.5 / 5.2 / math.sqrt(2))
    for share in ((black > 0).mean(), (white < 1023).mean()):
        assert share == pytest.approx(above, abs=5 * math.sqrt(0.25 / black.size))
    assert white.max() == 1023 and black.min() == 0 and white.min() > 980 and black.max() < 40


@pytest.mark.parametrize("bits", [1, 8, 10, 12, 16])
def test_codes_have_their_bits(bits):
    top = 2**bits - 1
    sensor = spec(bits=bits, slope=65535 / top)
    assert exposures(sensor, 1.0).max() == top == exposures(sensor, 1e30).min()
    halfway = exposures(sensor, 0.5)[0, 0, 0]
    assert halfway == math.floor(top / 2 + 0.5)


@pytest.mark.parametrize("mean", [1e15, 4e15, 1e17, 1e24])
def test_of_any_number_of_electrons_the_shot_noise_is_its_root(mean):
    """Which is less than 1e-5 codes of 1e15 electrons and more: the code is that of the light."""
    sensor = spec(shot_noise=True, white_e=1e9, exposure_gain=1e9, slope=1e9, bits=16)
    light = np.float32(mean / 1e18)
    assert (exposures(sensor, light) == math.floor(min(65535 * float(light), 65535) + 0.5)).all()


@pytest.mark.parametrize("mean", [0.0, 0.3, 5.0, 11.5, 12.5, 60.0, 1000.0])
def test_shot_noise_is_that_of_a_poisson_number(mean):
    """Its distribution, by chi squared: electrons are codes here."""
    sensor = spec(shot_noise=True, white_e=65535, slope=1, bits=16)
    codes = exposures(sensor, mean / 65535, n=30).ravel()
    if mean == 0:
        assert (codes == 0).all()
        return
    exact = 65535 * float(np.float32(mean / 65535))
    spread = 6 * math.sqrt(mean) + 3
    k = np.arange(max(0, math.floor(mean - spread)), math.ceil(mean + spread))
    chance = np.exp(k * math.log(exact) - exact - np.array([math.lgamma(n + 1) for n in k]))
    seen = np.bincount(codes, minlength=k[-1] + 1)[k[0] : k[-1] + 1]
    common = chance * codes.size >= 20
    terms = (seen - chance * codes.size)[common] ** 2 / (chance * codes.size)[common]
    freedom = common.sum() - 1
    assert terms.sum() < freedom + 6 * math.sqrt(2 * freedom) + 6
    assert codes.mean() == pytest.approx(exact, abs=5 * math.sqrt(exact / codes.size))
    assert codes.var() == pytest.approx(exact, rel=5 * math.sqrt((2 + 1 / exact) / codes.size))


def test_the_variance_of_shot_noise_is_the_gain_times_the_signal():
    """The photon transfer curve: a straight line, whose slope is LSB per electron."""
    sensor = spec(shot_noise=True, white_e=4300, noise_lsb=1.0, read_noise_e=3.0)
    gain = 65535 / (4300 * sensor.slope)
    levels = np.linspace(60, 900, SIZE[1])
    codes = exposures(sensor, light_of(levels, sensor)[:, None], n=60).astype(float)
    variance = np.array([codes[:, y].var() for y in range(SIZE[1])])
    want = gain * levels + (3.0 * gain) ** 2 + 1 + 1 / 12
    assert variance == pytest.approx(want, rel=5 * math.sqrt(2 / (60 * SIZE[0])))
    slope, _ = np.polyfit(levels, variance, 1)
    assert slope == pytest.approx(gain, rel=0.01)


def test_a_brighter_exposure_collects_more_electrons():
    """exposure_gain is light: twice of it, less noise for the signal; the slope is not."""
    ratios = {}
    for gain, slope in ((1.0, 60.0), (2.0, 60.0), (1.0, 30.0)):
        codes = exposures(spec(shot_noise=True, white_e=5000, exposure_gain=gain, slope=slope), 0.2, n=30)
        ratios[gain, slope] = codes.mean() / codes.std()
    assert ratios[2.0, 60.0] / ratios[1.0, 60.0] == pytest.approx(math.sqrt(2), rel=0.02)
    assert ratios[1.0, 30.0] / ratios[1.0, 60.0] == pytest.approx(1, rel=0.02)


def test_a_well_that_is_full_takes_no_more():
    sensor = spec(white_e=10_000, full_well_e=6_000)
    ramp = np.linspace(0, 2, SIZE[0])[None, :].astype(np.float32)
    want = np.floor(np.minimum(ramp.astype(float), 0.6) * 65535 / 55 + 0.5)
    assert np.array_equal(exposures(sensor, ramp)[0], np.broadcast_to(want, SIZE[::-1]))
    noisy = exposures(sensor.model_copy(update={"shot_noise": True}), 2.0)
    assert (noisy == math.floor(0.6 * 65535 / 55 + 0.5)).all()  # (a full well has no shot noise left)


def test_read_noise_is_in_electrons():
    sensor = spec(read_noise_e=20.0, white_e=2000)
    gain = 65535 / (2000 * sensor.slope)
    codes = exposures(sensor, light_of(400.0, sensor), n=30)
    assert codes.var() == pytest.approx((20 * gain) ** 2 + 1 / 12, rel=5 * math.sqrt(2 / codes.size))
    assert codes.mean() == pytest.approx(400, abs=5 * codes.std() / math.sqrt(codes.size))


def test_a_full_well_is_read_with_noise():
    """Read noise is added to what the well holds, so it goes both ways there, too."""
    sensor = spec(white_e=10_000, full_well_e=6000, read_noise_e=50.0, slope=2, bits=16)
    codes = exposures(sensor, 2.0, n=10)
    want = (50.0 * 65535 / (10_000 * 2)) ** 2 + 1 / 12
    assert codes.mean() == pytest.approx(0.6 * 65535 / 2, abs=5 * math.sqrt(want / codes.size))
    assert codes.var() == pytest.approx(want, rel=5 * math.sqrt(2 / codes.size))


def test_a_more_sensitive_pixel_has_the_shot_noise_of_its_own_electrons():
    """Sensitivity is in the mean number: the variance grows as it does, and not as its square."""
    sensor = spec(shot_noise=True, prnu=0.25, white_e=2000, slope=8, bits=16)
    codes, gain = exposures(sensor, 0.2, n=40).astype(float), Cis(sensor, SIZE).maps()["gain"]
    for pixels in (gain < 0.8, abs(gain - 1) < 0.1, gain > 1.2):
        ratios = codes.var(axis=0, ddof=1)[pixels] / (codes.mean(axis=0)[pixels] * 65535 / (2000 * 8))
        assert ratios.mean() == pytest.approx(1, abs=5 * math.sqrt(2 / 39 / ratios.size))


def test_the_fixed_pattern_is_a_gain_and_an_offset_that_stay():
    """Spatial variance: dsnu^2 in the dark, and prnu^2 signal^2 more in light; the same in all exposures."""
    sensor = spec(prnu=0.02, dsnu=15.0, white_e=65535, slope=1, bits=16)
    at = {light: exposures(sensor, light, n=3) for light in (0.1, 0.5)}
    for light, codes in at.items():
        assert (codes == codes[0]).all()
        want = (0.02 * 65535 * light) ** 2 + 15.0**2 + 1 / 12
        assert codes[0].var() == pytest.approx(want, rel=5 * math.sqrt(2 / PIXELS))
        assert codes[0].mean() == pytest.approx(65535 * light, abs=5 * math.sqrt(want / PIXELS))
    maps = Cis(sensor, SIZE).maps()
    predicted = 65535 * 0.5 * maps["gain"].astype(float) + maps["dark"]
    assert at[0.5][0] == pytest.approx(predicted, abs=0.51)
    assert abs(np.corrcoef(maps["gain"].ravel(), maps["dark"].ravel())[0, 1]) < 5 / math.sqrt(PIXELS)


@pytest.mark.parametrize(("prnu", "dsnu"), [(0.02, 0.0), (0.0, 15.0)])
def test_gain_and_offset_are_those_of_the_pixel_each_without_the_other_too(prnu, dsnu):
    sensor = spec(prnu=prnu, dsnu=dsnu, white_e=65535, slope=1, bits=16)
    both = Cis(sensor.model_copy(update={"prnu": 0.02, "dsnu": 15.0}), SIZE).maps()
    maps = {name: both[name].astype(float) if own else at_rest for name, own, at_rest in (
        ("gain", prnu, 1.0), ("dark", dsnu, 0.0),
    )}  # fmt: skip
    assert exposures(sensor, 0.5)[0] == pytest.approx(65535 * 0.5 * maps["gain"] + maps["dark"], abs=0.51)


@pytest.mark.parametrize("prnu", [0.3, 1.0])
def test_no_pixel_answers_light_with_its_opposite(prnu):
    gain = Cis(spec(prnu=prnu), SIZE).maps()["gain"]
    assert gain.min() >= 0 and gain.mean() == pytest.approx(1, abs=5 * prnu / math.sqrt(PIXELS))


def test_draws_of_other_seeds_cameras_exposures_pixels_and_kinds_are_independent():
    strong = {"noise": {"noise_lsb": 20.0}, "read": {"read_noise_e": 200.0}, "shot": {"shot_noise": True}}
    strong["pattern"] = {"prnu": 0.1}
    planes = {}
    for kind, keys in strong.items():
        sensor = spec(white_e=2000, **keys)
        for seed, camera in ((0, 0), (1, 0), (0, 1), (2**40, 0)):
            codes = exposures(sensor, 0.5, n=2, seed=seed, camera=camera).astype(float)
            planes |= {(kind, seed, camera, k): codes[k] for k in range(1 if kind == "pattern" else 2)}
    assert len({plane.tobytes() for plane in planes.values()}) == len(planes)
    pairs = [
        np.corrcoef(one.ravel(), other.ravel())[0, 1] * math.sqrt(PIXELS)
        for one, other in itertools.combinations(planes.values(), 2)
    ]
    assert np.abs(pairs).max() < 5 and np.mean(np.abs(pairs) < 2) > 0.9
    for plane in planes.values():
        for a, b in ((plane[:, :-1], plane[:, 1:]), (plane[:-1], plane[1:]), (plane[:, :-4], plane[:, 4:])):
            assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 5 / math.sqrt(a.size)


def test_words_in_rows_are_the_words_of_their_pixels():
    words = np.empty((4, 300), np.uint32)
    for seed, stream, first, tick in ((7, 8, 0, 0), (2**64 - 1, 8 + 256 * 77, 2**31, 2**40 + 3)):
        fill_words(words, np.uint64(seed), stream, first, tick)
        one_by_one = np.array([philox(np.uint64(seed), stream, first + i, tick) for i in range(300)]).T
        assert np.array_equal(words, one_by_one)


def test_noise_and_picture_codes_are_not_changed_by_what_else_is_on():
    """The noise of the ADC is the same draw beside any other effect."""
    sensor = spec(noise_lsb=5.2)
    alone = exposures(sensor, 0.4).astype(int)
    beside = exposures(sensor.model_copy(update={"dsnu": 1e-9, "shading": (-1e-12,)}), 0.4).astype(int)
    assert np.abs(alone - beside).max() <= 1 and np.mean(alone != beside) < 0.001
