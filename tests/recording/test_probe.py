"""probe.csv tells the truth about single pixels, and noise_maps.npz about all of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vid2ev import Dvs, Events, UsageError, convert, load_sensor, read_events
from vid2ev.recording.probe import HEADER, Probe, merged, read_probe, stepped
from vid2ev.stream.frames import Frame
from vid2ev.tracks.outputs import Outputs

F = np.float32
CLIP = "synthetic:moving-edge,size=48x32,fps=200,duration_s=0.3"
PIXEL = (24, 16)


@pytest.mark.parametrize(
    ("sensor", "overrides"),
    [
        ("ideal", []),
        ("paper", ["refractory_us=0"]),
        ("v2e-clean", []),
        pytest.param("v2e-noisy", ["shot_rate_hz=0", "refractory_us=0"], marks=pytest.mark.slow),
        pytest.param(
            "paper", ["photoreceptor_noise=0.02", "refractory_us=0", "leak_rate_hz=5"], marks=pytest.mark.slow
        ),
    ],
)
def test_the_signal_stays_between_the_levels_and_events_are_those_of_the_pixel(
    tmp_path: Path, sensor: str, overrides: list[str]
) -> None:
    options = {"subframes": 2, "threads": 1, "preview": False, "probe": ["24,16", (3, 5)], "upsample": "linear"}
    convert(CLIP, tmp_path / "out", sensor, overrides, **options)
    found = read_probe(tmp_path / "out" / "probe.csv")
    events = Events.concatenate(read_events(tmp_path / "out"))
    assert set(found) == {PIXEL, (3, 5)} and (tmp_path / "out" / "probe.png").stat().st_size > 10_000
    for (x, y), columns in found.items():
        mine = events.select((events.x == x) & (events.y == y))
        for p, name in enumerate(("OFF", "ON")):
            assert columns[name].tolist() == mine.t[mine.p == p].tolist()
        slack = 1e-5 if "photoreceptor_noise=0.02" not in overrides else 0.2  # (its path between frames is not told)
        assert np.all(columns["signal_nat"] < columns["level_on_nat"] + slack)
        assert np.all(columns["signal_nat"] > columns["level_off_nat"] - slack)
    assert len(found[PIXEL]["ON"]) + len(found[PIXEL]["OFF"]) > 0


def test_without_effects_the_signal_is_the_log_of_the_light(tmp_path: Path) -> None:
    convert(CLIP, tmp_path / "out", "ideal", preview=False, probe=["24,16"], upsample="none", threads=1)
    columns = read_probe(tmp_path / "out" / "probe.csv")[PIXEL]
    np.testing.assert_allclose(columns["signal_nat"], np.log(columns["light"] + 1e-3), atol=2e-6)
    assert len(columns["t_us"]) == 61 and np.all(np.diff(columns["t_us"]) == 5000)


@pytest.mark.parametrize(("sensor", "overrides"), [("ideal", []), ("ideal", ["mismatch=0.03"])])
def test_levels_step_at_events_and_the_signal_stays_between_them(
    tmp_path: Path, sensor: str, overrides: list[str]
) -> None:
    """Light is a straight line from frame to frame, so that the signal is known at the events, too."""
    events = 0
    convert(CLIP, tmp_path / "out", sensor, overrides, preview=False, probe=["24,16", (3, 5)], upsample="none")
    for columns in read_probe(tmp_path / "out" / "probe.csv").values():
        t_us, low, high = columns["band"].T
        instants = t_us + np.array([[-1], [0], [1]])  # (times of events are rounded)
        signal = np.log(np.interp(instants, columns["t_us"], columns["light"]) + 1e-3)
        assert not np.isnan(low).any()
        assert np.all((low < signal.max(axis=0) + 2e-6) & (signal.min(axis=0) < high + 2e-6))
        on, off = (np.isin(t_us, columns[name]) for name in ("ON", "OFF"))
        middle = 0.5 * (low + high)
        assert np.all(np.diff(middle)[on[1:]] > 0.1) and np.all(np.diff(middle)[off[1:]] < -0.1)
        events += on.sum() + off.sum()
    assert events > 5


def test_late_events_have_no_levels(tmp_path: Path) -> None:
    convert(CLIP, tmp_path / "out", "ideal", ["delay_us=7000"], preview=False, probe=["24,16"], upsample="none")
    columns = read_probe(tmp_path / "out" / "probe.csv")[PIXEL]
    assert np.isnan(columns["band"]).any(axis=1).sum() == len(columns["ON"]) + len(columns["OFF"]) > 0


def test_levels_that_the_thresholds_do_not_lead_to_are_not_told_and_drawn_in_equal_steps() -> None:
    events = Events(np.array([1, 2]), np.ones(2, np.uint16), np.zeros(2, np.uint16), np.array([1, 1], np.uint8))
    thresholds, frame = (np.full((1, 2), 0.25), np.full((1, 2), 0.5)), Frame(np.zeros((1, 2), F), 4000)

    def levels(on: float) -> list[list[str]]:
        states = [[np.array([value]) for value in (0, 0, level, level - 0.75)] for level in (0.25, on)]
        lines = Probe([(1, 0)], 2, thresholds).lines(frame, events, states[1], states[0]).decode().splitlines()
        return [line.split(",")[-2:] for line in lines]

    assert levels(0.75) == [["0.5", "-0.25"], ["0.75", "0"], ["0.75", "0"]]
    assert levels(0.85) == [["", ""], ["", ""], ["0.85", "0.1"]]
    gaps = np.array([[0, 0, 0.25], [1, np.nan, np.nan], [2, np.nan, np.nan], [4, 0.3, 0.55]])
    np.testing.assert_allclose(stepped(gaps)[1:3, 1:], [[0.15, 0.4], [0.3, 0.55]])


def test_times_before_zero_are_told_as_they_are() -> None:
    light, nothing = np.full((2, 3), 0.5, F), Events.empty(False)
    inside = [np.zeros(1, F)] * 4
    for t_ns, said in ((-966_666_667, "-966666.667"), (-1, "-0.001"), (0, "0.000"), (5_000_001, "5000.001")):
        line = Probe([(1, 1)], 3).lines(Frame(light, t_ns), nothing, inside).decode()
        assert line.split(",")[0] == said


def test_tables_of_some_pixels_each_make_the_table_of_all(tmp_path: Path) -> None:
    """Events of one microsecond in the order of their rows and columns, frames in that in which pixels were named."""
    rng, pixels = np.random.default_rng(0), [(5, 0), (0, 1), (7, 3), (1, 1), (2, 3)]
    steps = []
    for k in range(6):
        order = rng.integers(0, 8 * 4 * 3, 60 if k else 0)
        t, place = np.sort(order) // 32 + 3 * k - 2, np.sort(order) % 32
        events = Events(t, (place % 8).astype(np.uint16), (place // 8).astype(np.uint16), (order % 2).astype(np.uint8))
        steps.append((Frame(rng.uniform(0, 1, (4, 8)).astype(F), 3000 * k), events))

    def table(name: str, some: list[tuple[int, int]]) -> Path:
        probe = Probe(some, 8)
        inside = [np.array([10 * x + y for x, y in some], float)] * 4
        lines = [probe.lines(frame, events, inside) for frame, events in steps]
        (tmp_path / name).write_bytes(b"".join([HEADER, *lines]))
        return tmp_path / name

    whole = table("whole.csv", pixels)
    parts = [table("one.csv", [pixels[0], pixels[3]]), table("other.csv", [pixels[1], pixels[2], pixels[4]])]
    assert b"".join(merged(parts, pixels)) == whole.read_bytes()
    assert whole.read_bytes().count(b"ON") > 20


@pytest.mark.parametrize(("t_ns", "t_us"), [(1_005, "1.005"), (2_050_000, "2050.000"), (7_120, "7.120"), (0, "0.000")])
def test_frames_have_their_nanosecond(t_ns: int, t_us: str) -> None:
    lines = Probe([(1, 0)], 2).lines(Frame(np.zeros((1, 2), F), t_ns), Events.empty(), [np.zeros(1)] * 4)
    assert lines.decode().split(",")[0] == t_us


def test_leak_lifts_the_signal_above_what_is_filtered() -> None:
    dvs = Dvs(load_sensor("ideal", ["leak_rate_hz=1"]), (2, 1))
    light = np.full((1, 2), 0.5, F)
    for k in range(3):
        dvs.step(light, k * 10**8)
    state = dvs.inside(np.array([0, 1]))
    np.testing.assert_allclose(state.signal - state.filtered, 0.2 * dvs.spec.threshold_on, rtol=1e-6)


def test_maps_are_what_the_pixels_do(tmp_path: Path) -> None:
    """Light that rises by one e-fold in each pixel: events come at multiples of the threshold of the map."""
    overrides = ["mismatch=0.03", "hot_probability=0.01", "hot_rate_hz=0", "cold_probability=0.02"]
    spec = load_sensor("ideal", overrides)
    dvs = Dvs(spec, (40, 30), seed=5)
    maps = dvs.maps()
    assert maps["threshold_on"].std() == pytest.approx(0.03, rel=0.1)
    dvs.step(np.full((30, 40), 1.0, F), 0)
    events = dvs.step(np.full((30, 40), np.e, F), 10**9)
    sent = np.zeros((30, 40), int)
    np.add.at(sent, (events.y, events.x), 1)
    rise = np.log(np.e + 1e-3) - np.log(1.001)
    good = ~maps["hot"] & ~maps["cold"]
    np.testing.assert_array_equal(sent[good], np.floor(rise / maps["threshold_on"][good]).astype(int))
    assert maps["cold"].any() and not sent[maps["cold"]].any()
    convert("synthetic:moving-edge,size=40x30", tmp_path / "out", spec, seed=5, noise_maps=True, preview=False)
    with np.load(tmp_path / "out" / "noise_maps.npz") as written:
        for name, plane in maps.items():
            np.testing.assert_array_equal(written[name], plane)


def test_shading_is_in_the_maps() -> None:
    maps = Dvs(load_sensor("ideal", ["shading=[-0.5]"]), (9, 5)).maps()
    assert maps["shading"][2, 4] == pytest.approx(1) and maps["shading"].min() < 1 and maps["shading"].shape == (5, 9)


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", "-1,2", "", "1.5,2"])
def test_what_is_no_pixel_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="160,120"):
        Outputs.of(probe=[text])


def test_a_pixel_that_is_named_twice_is_probed_once() -> None:
    assert Outputs.of(probe=["5,6", (5, 6), "1,2", " 5 , 6 "]).probe == ((5, 6), (1, 2))


def test_a_pixel_outside_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="48x32"):
        convert(CLIP, tmp_path / "out", probe=["48,0"])
    assert not any(tmp_path.iterdir())
