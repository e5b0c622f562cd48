"""Cuts: found between unrelated pictures, and nowhere else; nothing crosses one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from skimage import data

from vid2ev import Dvs, convert, load_sensor, open_source, read_events
from vid2ev.rig.camera import Camera, Rig
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.recipe import Recipe
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.upsample import cuts
from vid2ev.upsample.cuts import CutDetector

F = np.float32
CLIPS = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos"
NAMES = ["astronaut", "camera", "coffee", "gravel", "chelsea", "rocket"]


def photograph(name: str, shift: tuple[int, int] = (0, 0), size: tuple[int, int] = (240, 160)) -> np.ndarray:
    picture = getattr(data, name)()
    gray = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    light = (cv2.resize(gray, (300, 220), interpolation=cv2.INTER_AREA).astype(F) / 255) ** F(2.2)
    x, y = shift
    return light[30 + y : 30 + y + size[1], 30 + x : 30 + x + size[0]]


def cuts_in(pictures: list[np.ndarray]) -> list[int]:
    detector, frames = CutDetector(0.15), [Frame(light, k * 10**7) for k, light in enumerate(pictures)]
    return [k for k, pair in enumerate(pairwise(frames), 1) if detector.begins_shot(*pair)]


def test_what_is_neither_like_nor_unlike_begins_no_shot_and_ends_none(monkeypatch: pytest.MonkeyPatch) -> None:
    alike = iter([0.9, 0.3, 0.2, 0.2, 0.9, 0.2])
    monkeypatch.setattr(cuts, "likeness", lambda *_: next(alike))
    assert cuts_in([photograph("camera")] * 7) == [6]


@pytest.mark.parametrize(("one", "other"), list(combinations(NAMES, 2)))
def test_between_two_photographs_there_is_a_cut(one: str, other: str) -> None:
    assert cuts_in([photograph(one), photograph(one, (1, 0)), photograph(other), photograph(other, (0, 1))]) == [2]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("change", ["pan", "flash", "fade", "lamp", "blink"])
def test_motion_and_changes_of_light_are_no_cuts(name: str, change: str) -> None:
    steady = photograph(name)
    rng = np.random.default_rng(0)
    pictures = {
        "pan": [photograph(name, (9 * k, 5 * k)) for k in (-2, -1, 0, 1, 2)],
        "flash": [steady, 8 * steady, steady],
        "fade": [steady * F(share) for share in (1, 0.6, 0.3, 0.1, 0.01, 0)],
        "lamp": [0 * steady, steady, steady],  # the light is switched on: an event camera sees it
        "blink": [steady, np.full_like(steady, 0.9), steady],
    }[change]
    assert cuts_in([np.abs(light + rng.normal(0, 0.002, light.shape)).astype(F) for light in pictures]) == []


@pytest.mark.parametrize("shape", [(24, 24), (27, 84), (40, 84), (84, 40), (31, 200), (32, 91), (160, 240)])
def test_how_alike_two_pictures_are_does_not_depend_on_those_before(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    whole = cv2.resize(rng.uniform(0, 1, (shape[0] // 4, shape[1] // 3)).astype(F), (shape[1] + 6, shape[0]))
    pair = [cuts.reduced(np.ascontiguousarray(whole[:, x : x + shape[1]])) for x in (0, 6)]
    fresh, used = (CutDetector(0.15)._dis for _ in range(2))
    cuts.likeness(*(cuts.reduced(rng.uniform(0, 1, shape).astype(F)) for _ in range(2)), 0.15, used)
    assert cuts.likeness(*pair, 0.15, fresh) == cuts.likeness(*pair, 0.15, used) < 1


def test_what_changes_all_the_time_has_no_shots() -> None:
    rng = np.random.default_rng(0)
    assert cuts_in([rng.uniform(0, 1, (160, 240)).astype(F) for _ in range(6)]) == []
    strobe = [photograph(name) for name in NAMES]
    assert cuts_in([strobe[0], *strobe]) == [2]  # (the first is a cut after a shot that stood still)


@pytest.mark.parametrize("shape", [(1, 1), (3, 500), (23, 23), (24, 24), (27, 84), (31, 500), (500, 31)])
def test_any_size(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    cuts_in(list(rng.uniform(0, 1, (3, *shape)).astype(F)))
    cuts_in([np.full(shape, value, F) for value in (np.nan, np.inf, -1, 0)])
    assert cuts_in([np.full(shape, 0.5, F)] * 4) == []


@pytest.mark.parametrize(("name", "cuts"), [("nasa_13013.mp4", [202]), ("intel_car-detection.mp4", [])])
def test_real_clips(name: str, cuts: list[int]) -> None:
    if not CLIPS.exists():
        pytest.skip("the folder of real clips is not there")
    assert cuts_in([frame.light for frame in open_source(CLIPS / name).frames()]) == cuts


# ------------------------------------------------------------------------------------------------------- the sensor


def film(folder: Path) -> Path:
    """Two shots that stand still, 5 frames each, at 100 Hz."""
    np.save(folder / "film.npy", np.stack([photograph(name) for name in ("camera", "coffee") for _ in range(5)]))
    return folder / "film.npy"


OPTIONS = {"sensor": "ideal", "fps": 100.0, "threads": 1, "preview": False}


def test_a_recording_has_no_events_of_a_cut_and_lists_it(tmp_path: Path) -> None:
    made = convert(film(tmp_path), tmp_path / "restart", **OPTIONS)
    assert made["cuts_us"] == [50_000] and made["counts"]["events"] == 0
    assert any("1 cut" in warning for warning in made["warnings"])
    beside = convert(film(tmp_path), tmp_path / "beside", frame_camera=True, **OPTIONS)["results"]
    assert [any("1 cut" in text for text in beside[camera]["warnings"]) for camera in ("dvs", "cis")] == [True, False]
    late = Rig(cameras=(Camera(name="late", kind="dvs", clock_offset_us=7000),))
    made = convert(film(tmp_path), tmp_path / "late", rig=late, **OPTIONS)["results"]["late"]
    assert (made["start_us"], made["cuts_us"]) == (7000, [57_000])  # (all on the camera's own clock)
    kept = convert(film(tmp_path), tmp_path / "keep", cuts="keep", **OPTIONS)
    assert kept["cuts_us"] == [] and kept["counts"]["events"] > 10_000
    times = np.concatenate([events.t for events in read_events(tmp_path / "keep")])
    assert times.min() > 40_000 and times.max() <= 50_000  # the step goes straight, with no frames carried in between


@pytest.mark.parametrize("start", range(11))
def test_light_taken_up_anywhere_knows_the_cuts(tmp_path: Path, start: int) -> None:
    recipe = Recipe.of(film(tmp_path), "ideal", fps=100.0)

    def cuts(seen: Iterator[Instant]) -> list[int]:
        return [instant.t_ns for instant in seen if instant.cut]

    assert cuts(instants(recipe, start)) == [t_ns for t_ns in cuts(instants(recipe)) if t_ns > start * 10**7]


def test_a_restart_lets_event_frames_go_on() -> None:
    spec = load_sensor("ideal", ["frame_rate_hz=50"])
    dvs = Dvs(spec, (2, 1))
    dark, bright = np.full((1, 2), 0.1, F), np.full((1, 2), 0.5, F)
    dvs.step(dark, 0)
    sent = [dvs.step(bright, 15_000_000), dvs.restart(dark, 45_000_000), dvs.step(bright, 75_000_000), dvs.flush()]
    times = Events.concatenate(sent).t
    assert np.all(np.diff(times) >= 0) and set(times % 20_000) == {0}
    assert {0, 60_000} <= set(times)


def test_a_picture_of_which_a_fifth_becomes_another_is_no_cut() -> None:
    noise = [np.random.default_rng(k).uniform(0, 1, (120, 160)).astype(np.float32) for k in (0, 1)]
    wall, other = (np.clip((cv2.GaussianBlur(each, (9, 9), 2) - 0.5) * 6 + 0.5, 0.02, 1) for each in noise)

    def begins_shot(columns: int) -> bool:
        after, detector = wall.copy(), CutDetector(0.15)
        after[:, :columns] = other[:, :columns]
        detector.begins_shot(Frame(wall, 0), Frame(wall.copy(), 1))
        return detector.begins_shot(Frame(wall, 1), Frame(after, 2))

    assert begins_shot(160) and not begins_shot(32)
