"""Cis: what goes in and is refused, what it counts, and that interruptions, threads and chunks change nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from against.clips import OF_FRAMES

import vid2ev
from vid2ev.errors import UsageError
from vid2ev.light.tags import tag_of, transfer_of
from vid2ev.light.transfer import parse_transfer
from vid2ev.physics.shading import shading_map
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import EFFECTS, CisSpec
from vid2ev.sensors.presets import CIS, cis_names, load_cis, read_sensor
from vid2ev.stream.exposures import Exposure
from vid2ev.stream.frames import LUMINANCE, Frame

NAMES = cis_names()
SIZE = (20, 14)
EVERYTHING = CisSpec(frame_rate_hz=70.0, **OF_FRAMES)


def clip(n: int = 60, seed: int = 0, colour: bool = True) -> list[Frame]:
    """Frames of random light at uneven times, the twentieth a cut."""
    rng = np.random.default_rng(seed)
    t_ns = np.cumsum(rng.integers(1, 8_000_000, n))
    shape = (SIZE[1], SIZE[0], 3) if colour else SIZE[::-1]
    light = rng.random((n, *shape)).astype(np.float32)
    return [Frame(light[k], int(t_ns[k]), cut=k == 20) for k in range(n)]


def same(one: list[Exposure], other: list[Exposure]) -> bool:
    return len(one) == len(other) and all(
        (a.index, a.start_ns, a.end_ns) == (b.index, b.start_ns, b.end_ns) and np.array_equal(a.codes, b.codes)
        for a, b in zip(one, other, strict=True)
    )


def test_the_public_names_are_these():
    assert (vid2ev.Cis, vid2ev.CisSpec, vid2ev.Exposure, vid2ev.load_cis) == (Cis, CisSpec, Exposure, load_cis)


def test_the_presets_that_the_project_promises_are_there():
    assert {"paper", "ideal", "davis346-aps", "global-shutter", "rolling-shutter", "phone"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_names_the_source_of_every_number_and_makes_pictures(name):
    sensor = read_sensor(name, CIS)
    assert set(sensor.sources) == set(sensor.values) and all(len(text) > 10 for text in sensor.sources.values())
    assert sensor.about["title"] and sensor.about["sources"]
    cis = Cis(load_cis(name), SIZE)
    light = np.full((*SIZE[::-1], 3) if cis.spec.colour else SIZE[::-1], 0.5, np.float32)
    made = [each for k in range(5) for each in cis.see(Frame(light, k * 20_000_000))]
    assert made and 0.3 * cis.spec.top < made[0].codes.mean() < 0.6 * cis.spec.top


def test_the_paper_preset_is_the_default_sensor():
    assert load_cis("paper") == CisSpec()


def test_the_ideal_preset_has_no_imperfection():
    ideal = load_cis("ideal")
    assert ideal.effects() == [] and ideal == ideal.noiseless()
    (made,) = Cis(ideal, (1024, 1)).step(np.repeat(np.arange(1024, dtype=np.float32)[None, :, None] / 1023, 3, 2), 0)
    assert np.array_equal(made.codes[0, :, 0], np.arange(1024))


@pytest.mark.parametrize(
    ("override", "parts"),
    [
        ("cis.exposure=3", ["'exposure'", "did you mean", "vid2ev sensors paper"]),
        ("threshold_on=0.2", ["'threshold_on'", "unknown"]),
        ("cis.slope=0", ["slope = 0", "greater than 0", "55"]),
        ("cis.bits=17", ["bits = 17", "16"]),
        ("cis.gamma=rec", ["gamma = 'rec'"]),
        ("cis.frame_rate_hz=nan", ["frame_rate_hz = nan"]),
        ("cis.", ["cis.", "key=value"]),
    ],
)
def test_a_wrong_setting_is_refused_in_one_sentence(override, parts):
    with pytest.raises(UsageError) as refusal:
        load_cis("paper", [override])
    sentence = str(refusal.value)
    assert all(part in sentence for part in parts) and "\n" not in sentence, sentence


def test_a_setting_may_stand_bare_or_with_its_table():
    assert load_cis("phone", ["cis.line_us=3"]) == load_cis("phone", ["line_us=3"])
    assert load_cis("phone", ["shading=[]"]).shading == ()
    with pytest.raises(UsageError, match="shading"):
        load_cis("phone", ["shading=[1e300]"])


def test_interrupted_at_any_frame_it_goes_on_to_the_same_bits():
    frames = clip()
    whole = Cis(EVERYTHING, SIZE, seed=5, camera=2)
    want = list(whole.run(frames))
    assert len(want) > 8 and EVERYTHING.in_flight(SIZE[1]) >= 3
    cis, got = Cis(EVERYTHING, SIZE, seed=5, camera=2), []
    for frame in frames:
        got += cis.see(frame)
        state = {name: array.copy() for name, array in cis.state().items()}
        cis = Cis(EVERYTHING, SIZE, seed=5, camera=2)
        cis.restore(state)
    cis.flush()
    assert same(got, want) and cis.counts == whole.counts


def test_a_state_is_a_copy():
    frames, cis = clip(), Cis(EVERYTHING, SIZE)
    for frame in frames[:30]:
        cis.see(frame)
    state = cis.state()
    first = [each for frame in frames[30:] for each in cis.see(frame)]
    cis.restore(state)
    assert same([each for frame in frames[30:] for each in cis.see(frame)], first)
    cis.restore({})
    assert cis.counts == {"frames": 0, "unfinished": 0, "not_finite": 0}
    assert same(list(cis.run(frames)), list(Cis(EVERYTHING, SIZE).run(frames)))


@pytest.mark.parametrize("threads", [2, 5, 40])
def test_threads_change_nothing(threads):
    frames = clip()
    assert same(list(Cis(EVERYTHING, SIZE, threads=threads).run(frames)), list(Cis(EVERYTHING, SIZE).run(frames)))


def test_noise_does_not_depend_on_how_the_light_was_sampled():
    """Light that stays, in 3 frames or in 60: the same pictures."""
    light = np.random.default_rng(1).random((*SIZE[::-1], 3)).astype(np.float32)
    few, many = ([Frame(light, k * 600_000_000 // n) for k in range(n + 1)] for n in (2, 60))
    one, other = (list(Cis(EVERYTHING, SIZE).run(frames)) for frames in (few, many))
    assert len(one) == len(other) > 30
    for a, b in zip(one, other, strict=True):  # (sums of 2 and of 60 weights differ in their last bits)
        assert np.mean(a.codes != b.codes) < 0.002


def test_light_is_not_kept_but_copied():
    frames = clip()
    want = list(Cis(EVERYTHING, SIZE).run(frames))
    cis, buffer, got = Cis(EVERYTHING, SIZE), np.empty_like(frames[0].light), []
    for frame in frames:
        buffer[...] = frame.light
        got += cis.see(Frame(buffer, frame.t_ns, cut=frame.cut))
        buffer[...] = np.nan
    assert same(got, want)


@pytest.mark.parametrize("dtype", [np.float16, np.float64])
def test_any_floating_point_is_light(dtype):
    light = np.linspace(0, 1, 3 * SIZE[0] * SIZE[1]).reshape(*SIZE[::-1], 3).astype(dtype)
    for given_light in (light, light[::-1][::-1], np.asfortranarray(light)):
        (made,) = Cis(load_cis("ideal"), SIZE).step(given_light, 0)
        (want,) = Cis(load_cis("ideal"), SIZE).step(light.astype(np.float32), 0)
        assert np.array_equal(made.codes, want.codes)


def test_a_sensor_of_luminance_takes_colour_and_not_the_reverse():
    light = np.random.default_rng(0).random((*SIZE[::-1], 3)).astype(np.float32)
    gray = load_cis("ideal", ["colour=false"])
    (made,) = Cis(gray, SIZE, linear=True).see(Frame(light, 0))
    assert made.codes.shape == SIZE[::-1] and made.light == pytest.approx(light @ LUMINANCE, abs=1e-6)
    with pytest.raises(UsageError, match=r"\(14, 20\).*colour='rgb'.*cis\.colour=false"):
        Cis(load_cis("ideal"), SIZE).see(Frame(light[..., 0], 0))
    with pytest.raises(UsageError, match="expected"):
        Cis(gray, SIZE).step(light, 0)


ODD = np.array([np.nan, np.inf, -np.inf, -1.0, -1e-30, 3e38, -0.0, 0.5], np.float32)


def test_odd_values_are_mended_and_counted():
    cis = Cis(load_cis("ideal", ["colour=false"]), (8, 1), linear=True)
    (made,) = cis.step(ODD[None], 0)
    assert np.array_equal(made.light[0], np.array([0, 1e30, 0, 0, 0, 1e30, 0, 0.5], np.float32))
    assert made.codes[0].tolist() == [0, 1023, 0, 0, 0, 1023, 0, 512]
    assert cis.counts["not_finite"] == 6


def test_a_colour_beyond_the_primaries_lacks_one_and_is_not_odd():
    cis = Cis(load_cis("ideal"), (8, 1), linear=True)
    (made,) = cis.step(np.repeat(ODD[None, :, None], 3, axis=2), 0)
    assert made.light.min() == 0 and cis.counts["not_finite"] == 3 * 4


def test_every_effect_stands_every_light():
    rng = np.random.default_rng(2)
    for value in (0.0, 1e-45, 1e4, 1e30, np.inf):
        light = np.where(rng.random((*SIZE[::-1], 3)) < 0.5, value, 0.3).astype(np.float32)
        cis = Cis(EVERYTHING, SIZE)
        made = list(cis.run(Frame(light, k * 10_000_000) for k in range(8)))
        assert made and all(each.codes.max() <= 1023 for each in made)


def test_exposures_that_the_light_does_not_last_for_are_counted():
    light = np.full((*SIZE[::-1], 3), 0.5, np.float32)
    cis = Cis(CisSpec(frame_rate_hz=100, exposure_us=25_000), SIZE)
    made = list(cis.run(Frame(light, k * 1_000_000) for k in range(101)))
    assert [each.index for each in made] == list(range(8))  # the eighth closes at 95 ms
    assert cis.counts == {"frames": 8, "unfinished": 2, "not_finite": 0}
    assert cis.flush() == [] and cis.counts["unfinished"] == 2  # they are dropped, and counted once
    assert len(cis.state()["open"]) == 0


def test_a_burst_ends_after_as_many_exposures_wherever_it_is_interrupted():
    frames, spec = clip(), EVERYTHING.model_copy(update={"burst": 5})
    whole = list(Cis(EVERYTHING, SIZE).run(frames))
    assert len(whole) > 8
    for at in (1, 12, 40):
        cis, made = Cis(spec, SIZE), list[Exposure]()
        for frame in frames[:at]:
            made += cis.see(frame)
        rest = Cis(spec, SIZE)
        rest.restore(cis.state())
        made += rest.run(frames[at:])
        assert same(made, whole[:5]) and rest.counts == {"frames": 5, "unfinished": 0, "not_finite": 0}
    with pytest.raises(UsageError, match=r"state of a frame camera at .* before exposure 6"):
        rest.restore(rest.state() | {"clock": rest.state()["clock"] + np.array([0, 0, 1])})


def test_rows_that_sampled_are_an_exposure_begun():
    """A rolling shutter of instants: at the only frame the first row has sampled, and the others never will."""
    light = np.full((*SIZE[::-1], 3), 0.5, np.float32)
    for exposure_us, unfinished in ((0, 1), (10, 0)):
        cis = Cis(CisSpec(exposure_us=exposure_us, line_us=1000), SIZE)
        assert list(cis.run([Frame(light, 0)])) == [] and cis.counts["unfinished"] == unfinished


def test_an_exposure_says_when_it_was():
    light = np.full((*SIZE[::-1], 3), 0.5, np.float32)
    cis = Cis(CisSpec(frame_rate_hz=30, exposure_us=1234.5678, line_us=10.1), SIZE)
    made = cis.step(light, 5_000) + cis.step(light, 100_005_000)
    assert [each.start_ns for each in made] == [5_000, 33_338_333, 66_671_667]
    assert {each.end_ns - each.start_ns for each in made} == {round(13 * 10_100 + 1_234_567.8)}


def test_shading_dims_the_corners_and_the_exact_light_has_it():
    spec = load_cis("ideal", ["shading=[0, -1]"])
    (made,) = Cis(spec, SIZE, linear=True).step(np.ones((*SIZE[::-1], 3), np.float32), 0)
    want = np.repeat(shading_map((0, -1), *SIZE)[..., None], 3, axis=2)
    assert made.light == pytest.approx(want, abs=1e-7)
    assert np.array_equal(made.codes, np.floor(want.astype(float) * 1023 + 0.5))


def test_the_exact_light_has_no_noise_and_no_range():
    light = np.full((*SIZE[::-1], 3), 7.25, np.float32)
    cis = Cis(EVERYTHING.model_copy(update={"shading": ()}), SIZE, linear=True)
    made = [each for k in range(9) for each in cis.step(light, k * 10_000_000)]
    assert made and all((each.light == np.float32(7.25)).all() and each.light.dtype == np.float32 for each in made)
    assert Cis(CisSpec(), SIZE).step(light, 0) == []


@pytest.mark.parametrize("blur", [True, False])
def test_an_exposure_comes_with_the_frame_at_which_its_last_row_closes(blur: bool) -> None:
    sensor = EVERYTHING.model_copy(
        update={"exposure_us": 4000.0, "line_us": 100.0, "frame_rate_hz": 100.0, "blur": blur}
    )
    cis, light = Cis(sensor, SIZE), np.full((SIZE[1], SIZE[0], 3), 0.3, np.float32)
    closed_ns = 4_000_000 + 100_000 * (SIZE[1] - 1)
    made = [len(cis.step(light, t_ns)) for t_ns in (0, closed_ns - 1, closed_ns, closed_ns + 1)]
    assert made == [0, 0, 1, 0]


def test_the_truth_of_a_recording_samples_without_noise():
    assert EVERYTHING.effects() == [*EFFECTS]
    truth = EVERYTHING.sampling(960.0)
    assert truth.effects() == ["shading", "full_well"]
    assert (truth.exposure_us, truth.line_us, truth.frame_rate_hz) == (0, 0, 960.0)
    assert truth.noiseless() == truth and truth.shading == EVERYTHING.shading
    assert (truth.slope, truth.full_well_e) == (EVERYTHING.slope, EVERYTHING.full_well_e)


@pytest.mark.parametrize(("gamma", "middle"), [("srgb", 188), (2.2, 186), (1.0, 128)])
def test_pictures_of_eight_bits_have_the_curve(gamma, middle):
    codes = CisSpec(gamma=gamma).picture_codes()
    assert codes.dtype == np.uint8 and len(codes) == 1024 and (codes[0], codes[-1]) == (0, 255)
    assert abs(int(codes[512]) - middle) <= 1 and (np.diff(codes.astype(int)) >= 0).all()


@pytest.mark.parametrize("gamma", ["srgb", 1, 1.0, 2.2, 2.8])
def test_a_film_says_the_curve_of_its_codes_if_there_is_a_tag_for_it(gamma):
    spec = CisSpec(gamma=gamma)
    said, light = parse_transfer(transfer_of(tag_of(spec.curve), "auto")), np.arange(1024) / 1023
    np.testing.assert_array_equal(np.rint(255 * said.to_signal(light)), spec.picture_codes())


@pytest.mark.parametrize(
    "make",
    [
        lambda: Cis(CisSpec(), (0, 3)),
        lambda: Cis(CisSpec(), (70_000, 1)),
        lambda: Cis(CisSpec(), SIZE, seed=-1),
        lambda: Cis(CisSpec(), SIZE, camera=1 << 24),
        lambda: Cis(CisSpec(), SIZE, threads=0),
        lambda: Cis(CisSpec(exposure_us=1e8, frame_rate_hz=1000), (640, 480)),
        lambda: Cis(CisSpec(), SIZE).step(np.zeros((3, 3, 3), np.float32), 0),
        lambda: Cis(CisSpec(), SIZE).step(np.zeros((*SIZE[::-1], 3), np.uint8), 0),
        lambda: list(Cis(CisSpec(), SIZE).run([clip()[0], clip()[0]])),
        lambda: Cis(CisSpec(), (4, 4)).restore(_some_state()),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(make):
    with pytest.raises(UsageError) as refusal:
        make()
    assert "\n" not in str(refusal.value) and "expected" in str(refusal.value)


def _some_state() -> dict[str, np.ndarray]:
    cis = Cis(CisSpec(), SIZE)
    cis.see(clip()[0])
    return cis.state()


def test_thousands_of_exposures_between_two_frames_come_one_at_a_time():
    """A still of an hour: `run` gives its exposures without keeping them."""
    light = np.full((1, 1, 3), 0.5, np.float32)
    cis = Cis(CisSpec(frame_rate_hz=10, exposure_us=100_000), (1, 1))
    made = cis.run([Frame(light, 0), Frame(light, 3600 * 10**9)])
    assert next(made).index == 0 and len(cis._spare) + len(cis._open) <= 1
    assert sum(1 for _ in made) == 35_999
    assert math.isclose(cis.counts["frames"], 36_000)


@pytest.mark.parametrize("which", range(3))
@pytest.mark.parametrize("by", [-(10**15), -(10**9), 10**9, 10**15])
def test_a_state_of_times_that_do_not_belong_together_is_refused(which: int, by: int):
    """A first exposure long ago would have all since then made at once."""
    cis = Cis(EVERYTHING, SIZE)
    for frame in clip()[:30]:
        cis.see(frame)
    state = cis.state()
    changed = {name: array.copy() for name, array in state.items()}
    changed["clock"][which] += by
    with pytest.raises(UsageError, match="state of a frame camera"):
        cis.restore(changed)
    cis.restore(state)
