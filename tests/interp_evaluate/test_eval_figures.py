"""Figures of an evaluation: of its first gaps, with all methods that lack nothing, the same bytes each time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from footage_made import SIZE, pictures, write_film, write_hsergb, write_predictions

from interp.evaluate.figures import of_evaluation
from interp.evaluate.figures.four_panels import write_four_panels
from interp.evaluate.figures.of_evaluation import FILM_PX, film_panels, patch_of
from interp.evaluate.group import Cameras, Group
from interp.evaluate.protocol import Protocol
from interp.evaluate.run import evaluate
from interp.representation.event_counts import EventCounts
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.recording.exposures import write_codes


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(of_evaluation, "SEQUENCES", 2)
    monkeypatch.setattr(of_evaluation, "GAPS", 2)
    for seed, name in enumerate("abc"):
        write_hsergb(tmp_path / "data" / name, pictures(14, seed))
    write_predictions(tmp_path / "theirs" / "a", pictures(12, 0))
    return tmp_path


def options(data: Path) -> dict[str, Any]:
    return {"baselines": ["linear", "bridge"], "predictions": [data / "theirs"], "protocol": Protocol(3, 3)}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_figures_are_of_the_first_gaps_and_the_same_each_time(data: Path) -> None:
    folder = data / "report"
    evaluate([str(data / "data")], folder, **options(data))
    assert not (folder / "figures").exists()
    report = (folder / "report.html").read_bytes()
    evaluate([str(data / "data")], folder, resume=True, figures=True, **options(data))
    made = contents(folder / "figures")
    assert sorted(made) == sorted(
        f"{name}/{file}"
        for name in "ab"  # (nobody has predicted b)
        for file in ("bridge.mp4", "linear.mp4", "moments.png", "errors.png", *["theirs.mp4"] * (name == "a"))
    )
    with av.open(str(folder / "figures" / "a" / "bridge.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(frames) == 3 * 2 and frames[0].shape[1] >= 2 * FILM_PX[0]
    evaluate([str(data / "data")], folder, resume=True, figures=True, **options(data))
    assert contents(folder / "figures") == made and (folder / "report.html").read_bytes() == report


def test_figures_of_a_film_are_of_the_gaps_that_have_scores(tmp_path: Path) -> None:
    """Predictions of the second gap and the third, of a film that is scored up to there."""
    truth = pictures(21)
    write_film(tmp_path / "film.npz", truth)
    folder = tmp_path / "ours" / "film"
    folder.mkdir(parents=True)
    for k in (5, 6, 7, 9, 10, 11):
        write_codes(folder / f"{k}.png", srgb_codes(truth[k] / 255))
    options = {"baselines": [], "predictions": [tmp_path / "ours"], "protocol": Protocol(3, 3), "limit": 3}
    found = evaluate([str(tmp_path / "film.npz")], tmp_path / "report", figures=True, **options)
    assert {row.group for row in found.rows} == {1, 2} and {row.psnr_255 for row in found.rows} == {100.0}
    made = contents(tmp_path / "report" / "figures")
    assert sorted(made) == ["film/errors.png", "film/moments.png", "film/ours.mp4"]
    with av.open(str(tmp_path / "report" / "figures" / "film" / "ours.mp4")) as film:
        assert len(list(film.decode(video=0))) == 6


def test_panels_hold_the_events_since_the_frame_before(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = EventCounts.none(1, SIZE[::-1], 32)
    counts.off_on[0, 1, :, 3, 5] = 1
    frames = pictures(5)
    times = np.array([0, 8_000, 14_000, 26_000, 32_000])  # (unevenly)
    group = Group(0, 0, frames[[0, 4]], (1, 2, 3), frames[1:4], times, counts, Cameras())
    seen: list[np.ndarray] = []
    monkeypatch.setattr(of_evaluation, "four_panels", lambda *asked: seen.append(asked[1]))
    film_panels(group, "bridge", list(frames[1:4]))
    assert [int(off_on[1, 3, 5]) for off_on in seen] == [8, 6, 12] and [int(each.sum()) for each in seen] == [8, 6, 12]


@pytest.mark.parametrize("size", [(2, 150), (150, 2)])
def test_films_of_what_a_line_camera_sees_are_read_by_a_player(size: tuple[int, int], tmp_path: Path) -> None:
    frames = np.zeros((3, *size[::-1], 3), np.uint8)
    counts = EventCounts.none(1, size[::-1], 32)
    group = Group(0, 0, frames[[0, 2]], (1,), frames[1:2], np.array([0, 1000, 2000]), counts, Cameras())
    write_four_panels(tmp_path / "film.mp4", film_panels(group, "linear", [frames[1]]), 10)
    with av.open(str(tmp_path / "film.mp4")) as film:
        assert len(list(film.decode(video=0))) == 1


@pytest.mark.parametrize("size", [(40, 24), (320, 180), (1, 1)])
def test_patches_lie_within_the_picture(size: tuple[int, int]) -> None:
    left, top, wide, high = patch_of([], size[1], size[0])
    assert 0 <= left < left + wide <= size[0] and 0 <= top < top + high <= size[1]
