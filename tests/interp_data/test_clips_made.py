"""A clip is a function of settings, seed and number; its counts are the simulator's events."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pydantic import ValidationError

from interp.data import alter
from interp.data.cameras import Cameras, cameras_of, steps_for
from interp.data.clip import Clip
from interp.data.inputs import known_by
from interp.data.making import looked_at, made, wanted
from interp.data.sensor_ranges import SENSORS, SensorRanges, frame_sensor
from interp.data.settings import PRESETS, ClipSettings
from interp.data.shot import SAME, Beside
from interp.data.simulate import Light, simulated
from interp.representation.dead_time import DeadTime
from interp.representation.event_counts import count_events
from vid2ev import Dvs, DvsSpec, Events, load_cis, load_sensor
from vid2ev.stream.frames import LUMINANCE

pytestmark = pytest.mark.long

GAP_US = 32_000
SMALL = ClipSettings(size=(48, 32), sensors=SENSORS["clean"], scene_names=("spinning-shapes",))
# (phases and noise are functions of the pixel's number: without them the world may be turned around)
IDEAL = SENSORS["exact"].dvs(np.random.default_rng(0)).model_copy(update={"random_phase": False})


class Drift:
    """Soft clouds that drift across and get brighter, seen from left to right or the other way, as time runs or not."""

    exposed = True
    moved_px = 30.0

    def __init__(self, size=(48, 32), mirrored=False, backwards=False):
        self.about = {}
        self.size, self.mirrored, self.backwards = size, mirrored, backwards

    def light(self, u: float) -> np.ndarray:
        y, x = np.indices(self.size[::-1]) / 16.0
        place = x + 1.3 * u
        light = 0.45 + 0.2 * np.sin(2 * np.pi * place) * np.cos(5 * y) + 0.2 * np.sin(3 * place + 7 * y + u)
        return np.stack([light, 0.9 * light, 0.5 + 0.1 * np.cos(place)], axis=-1).astype(np.float32)

    def pictures(self, steps: int, first: int, last: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for j in range(first, last + 1):
            u = j / steps
            light = self.light(1 - u if self.backwards else u)
            light = light[:, ::-1].copy() if self.mirrored else light
            yield light, light @ LUMINANCE


def seen(shot: Drift, dvs: DvsSpec = IDEAL, steps: int = 32) -> Clip:
    """A clip of a shot by an event sensor and an ideal frame sensor."""
    cis = frame_sensor(GAP_US, 0.0, 0.0, 65535 / 1023, 0.0)
    light = Light(Cameras(cis, dvs, 0, None, SMALL.size, SAME, GAP_US, 8, steps), SMALL)
    for j, (frame, luminance) in zip(range(-4, steps + 1), shot.pictures(steps, -4, steps), strict=True):
        light.add(j, frame, luminance)
    return light.clip({})


def nats(clip: Clip) -> np.ndarray:
    """What all events of a clip stand for, [h, w]."""
    off, on = clip.off_on.sum(axis=1, dtype=np.float64)
    return clip.contrast[1] * on - clip.contrast[0] * off


def log_change(shot: Drift) -> np.ndarray:
    return np.log(shot.light(1.0) @ LUMINANCE + 1e-3) - np.log(shot.light(0.0) @ LUMINANCE + 1e-3)


PROGRAM = """
import hashlib, sys
from interp.data.making import looked_at, made, wanted
from interp.data.sensor_ranges import SENSORS
from interp.data.settings import ClipSettings
settings = ClipSettings.model_validate_json(sys.argv[1])
for number in map(int, sys.argv[2:]):
    clip = made(settings, 3, number)
    parts = b"".join(each.tobytes() for each in (clip.truth, clip.keys, clip.off_on))
    print(hashlib.sha256(parts + repr((clip.contrast, clip.gap_us, clip.about)).encode()).hexdigest())
"""


def hashes(settings: ClipSettings, *numbers: int) -> list[str]:
    """Of clips that another process made."""
    arguments = [sys.executable, "-c", PROGRAM, settings.model_dump_json(), *map(str, numbers)]
    return subprocess.run(arguments, capture_output=True, text=True, check=True).stdout.split()


def test_a_clip_is_the_same_in_any_process_and_order() -> None:
    forwards, reverse = hashes(SMALL, 0, 1, 2, 3), hashes(SMALL, 3, 2, 1, 0)
    assert forwards == reverse[::-1]
    assert len(set(forwards)) == 4


@pytest.mark.parametrize("source", ["scenes", "photographs"])
def test_clips_have_what_they_say(source: str) -> None:
    shares = {"scenes": 0.0, "photographs": 0.0} | {source: 1.0}
    settings = SMALL.model_copy(update=shares | {"sensors": SENSORS["default"], "multiples": (4, 16)})
    multiples = set()
    for number in range(6):
        clip = made(settings, 1, number)
        multiples.add(clip.multiple)
        assert clip.truth.shape == (clip.multiple + 1, 32, 48, 3) and clip.truth.dtype == np.uint8
        assert clip.keys.shape == (2, 32, 48, 3) and clip.off_on.shape == (2, 32, 32, 48)
        assert clip.gap_us % settings.bins == 0 and 0.05 < min(clip.contrast) <= max(clip.contrast) < 0.6
        if source == "photographs":  # (scenes have a longest time, and may not reach the motion that is wanted)
            assert 0.5 <= clip.about["moved_px"] <= 60
    assert multiples == {4, 16}


def test_an_ideal_frame_sensor_gives_the_ends_of_the_truth() -> None:
    clip = seen(Drift())
    np.testing.assert_array_equal(clip.keys, clip.truth[[0, -1]])


def test_counts_are_all_events_of_the_gap() -> None:
    from vid2ev import Dvs

    shot, sensor, total = Drift(), Dvs(IDEAL, (48, 32), 0), np.zeros((2, 32, 48), np.int64)
    for j, (_, luminance) in zip(range(-4, 33), shot.pictures(32, -4, 32), strict=True):
        events = sensor.step(luminance, 1000 * GAP_US * (j + 32) // 32)
        if j > 0:
            np.add.at(total, (events.p, events.y, events.x), 1)
    counted = seen(shot).off_on.astype(np.int64).sum(axis=1)
    assert total.sum() > 3000
    np.testing.assert_array_equal(counted, total)


def test_events_stand_for_the_change_of_log_light() -> None:
    # The level that a pixel holds is within a threshold of its light, at both ends.
    assert np.abs(nats(seen(Drift())) - log_change(Drift())).max() <= 2 * 0.15


def test_events_stand_for_what_dead_time_hid_too() -> None:
    blind = IDEAL.model_copy(update={"refractory_us": 1000.0, "refractory": "track"})
    change = log_change(Drift())
    told = (nats(seen(Drift(), blind)) / change)[np.abs(change) > 0.6].mean()
    assert told == pytest.approx(1, abs=0.15)  # (half of it without)


def test_the_mirrored_world_gives_the_mirrored_clip() -> None:
    ours, theirs = alter.mirrored(seen(Drift())), seen(Drift(mirrored=True))
    for name in ("truth", "keys", "off_on"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


def test_a_part_of_the_world_gives_the_part_of_the_clip() -> None:
    ours, theirs = alter.cropped(seen(Drift()), 0, 0, (32, 16)), seen_small()
    for name in ("truth", "keys", "off_on"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


def seen_small() -> Clip:
    cis = frame_sensor(GAP_US, 0.0, 0.0, 65535 / 1023, 0.0)
    light = Light(Cameras(cis, IDEAL, 0, None, (32, 16), SAME, GAP_US, 8, 32), SMALL)
    for j, (frame, luminance) in zip(range(-4, 33), Drift((32, 16)).pictures(32, -4, 32), strict=True):
        light.add(j, frame, luminance)
    return light.clip({})


def test_the_world_backwards_gives_the_clip_backwards() -> None:
    """Frames to the bit; events as far as levels allow: both sums are within two thresholds of the change (above)."""
    ours, theirs = alter.backwards(seen(Drift())), seen(Drift(backwards=True))
    np.testing.assert_array_equal(ours.truth, theirs.truth)
    np.testing.assert_array_equal(ours.keys, theirs.keys)
    assert np.abs(nats(ours) - nats(theirs)).max() < 4 * 0.15
    halves = [clip.off_on.astype(np.int64)[:, :16].sum() for clip in (ours, theirs)]
    assert halves[0] == pytest.approx(halves[1], rel=0.1)  # (a tenth of the events is at turns and ends)


def test_backwards_exchanges_the_thresholds() -> None:
    unlike = IDEAL.model_copy(update={"threshold_on": 0.1, "threshold_off": 0.25})
    clip = alter.backwards(seen(Drift(), unlike))
    assert clip.contrast == (0.1, 0.25)
    # What is backwards stands for the change backwards; with the thresholds left alone it is far off.
    assert np.abs(nats(clip) + log_change(Drift())).max() <= 0.1 + 0.25


def test_coarser_sensors_see_means() -> None:
    shot = Drift()
    settings = SMALL.model_copy(update={"rigs": 1.0, "sensors": SENSORS["exact"]})

    class Halved(Drift):
        def pictures(self, steps, first, last):
            for frame, luminance in super().pictures(steps, first, last):
                yield frame, luminance.reshape(16, 2, 24, 2).mean(axis=(1, 3))

    clip = simulated(Halved(), cameras_of(Halved(), settings, 0, 0, 8, GAP_US, Beside(coarser=2)), settings)
    assert clip.coarser == 2 and clip.off_on.shape == (2, 32, 16, 24)
    ends = [shot.light(u) @ LUMINANCE for u in (0.0, 1.0)]
    before, after = (np.log(end.reshape(16, 2, 24, 2).mean(axis=(1, 3)) + 1e-3) for end in ends)
    assert np.abs(nats(clip) - (after - before)).max() <= 2 * 0.15


@pytest.mark.parametrize(("moved_px", "steps"), [(0.0, 8), (12.0, 8), (12.1, 16), (25.0, 32), (500.0, 32)])
def test_pictures_are_as_many_as_motion_asks_for(moved_px: float, steps: int) -> None:
    assert steps_for(moved_px, ClipSettings(), 8) == steps


def test_linear_truth_goes_on_above_white() -> None:
    settings = PRESETS["hdr"].model_copy(
        update={"size": (48, 32), "sensors": SENSORS["clean"], "scene_names": ("low-light",), "photographs": 0.0}
    )
    clip = made(settings, 2, 1)
    assert clip.truth.dtype == np.float16 and np.isfinite(clip.truth).all() and (clip.truth >= 0).all()
    assert max(made(settings, 2, number).truth.max() for number in range(4)) > 1.0


def test_the_papers_sensors_are_the_presets() -> None:
    draw = np.random.default_rng(0)
    ours, theirs = SENSORS["paper"].dvs(draw).model_dump(), load_sensor("paper").model_dump()
    numbers = {key for key in theirs if isinstance(theirs[key], float)}
    assert all(ours[key] == pytest.approx(theirs[key], rel=1e-9) for key in numbers)
    ours, theirs = SENSORS["paper"].cis(draw, GAP_US, 0.0).model_dump(), load_cis("paper").model_dump()
    for key in ("min_illuminance", "slope", "noise_lsb", "bits"):
        assert ours[key] == pytest.approx(theirs[key], rel=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"multiples": (5,)},
        {"bins": 12},
        {"scenes": 0, "photographs": 0},
        {"videos": 1.0},
        {"rigs": 1.0, "size": (50, 50)},
    ],
)
def test_settings_that_do_not_go_together_are_refused(wrong: dict) -> None:
    with pytest.raises(ValidationError):
        ClipSettings(**wrong)


def test_settings_that_differ_have_other_names() -> None:
    assert known_by(ClipSettings()) == known_by(ClipSettings())
    assert known_by(ClipSettings()) != known_by(ClipSettings(step_px=1.0))


def test_what_dead_time_hid_is_missed_by_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of sensors as they come, against the same that are never blind: in the mean by a tenth at least, in none by much
    more (a smooth one, of which hardly anything was hidden)."""
    sensors = SensorRanges(refractory_us=(300.0, 1000.0), kinds=(0.5, 0.5, 0))
    clips = ClipSettings(size=(64, 64), scenes=0, gap_ms=(8, 30), sensors=sensors)
    left = []
    for number in range(10):
        shot, cameras = looked_at(wanted(clips, 7, number), clips, 7, number)
        ideal = replace(cameras, dvs=cameras.dvs.model_copy(update={"refractory_us": 0.0}))
        true, made_good = nats(simulated(shot, ideal, clips)), nats(simulated(shot, cameras, clips))
        with monkeypatch.context() as without:
            without.setattr(Cameras, "dead_time", None)
            plain = nats(simulated(shot, cameras, clips))
        missed, before = (float(np.sqrt(((one - true) ** 2).mean())) for one in (made_good, plain))
        if before > 0.01:
            left.append(missed / before)
    assert len(left) >= 5 and np.exp(np.log(left).mean()) < 0.9 and max(left) < 1.3


def test_what_the_first_events_of_a_gap_hid_is_told_by_those_before_it() -> None:
    """As where recordings are cut: counts of a clip are those of one stream that begins before its first key frame."""
    blind = IDEAL.model_copy(update={"refractory_us": 500.0})
    camera, begin, end = Dvs(blind, SMALL.size, 0), GAP_US, 2 * GAP_US
    sent = [
        camera.step(luminance, 1000 * GAP_US * (32 + j) // 32)
        for j, (_, luminance) in enumerate(Drift().pictures(32, -4, 32), -4)
    ]
    stream = Events.concatenate([*sent, camera.flush()])
    counts = partial(
        count_events, size=SMALL.size, start_us=begin, stop_us=end, dead_time=DeadTime.of(blind.model_dump())
    )
    whole, cut = counts(stream).off_on[0].numpy(), counts(stream.select(stream.t > begin)).off_on[0].numpy()
    assert np.abs(whole.astype(float) - cut).sum() > 10  # (so that it matters here)
    np.testing.assert_array_equal(seen(Drift(), blind).off_on, whole.astype(np.float16))
