"""Figures: sizes, places and colours that can be worked out; films that a player reads."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from interp.evaluate.figures import four_panels, heat_map, moments, worst_patch
from interp.evaluate.figures.layout import FRAME_PX, GAP_PX, LONGEST
from interp.evaluate.figures.lettering import ACCENT, GROUND, INK, STRIP_PX, letters, strip
from interp.evaluate.figures.png import write_png
from vid2ev.errors import DataError, UsageError
from vid2ev.pictures.colours import OFF, ON, strength

WIDTH, HEIGHT = 64, 48


def plain(level: int, height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    return np.full((height, width, 3), level, np.uint8)


def test_four_panels_are_where_they_belong() -> None:
    off_on = np.zeros((2, HEIGHT // 2, WIDTH // 2))
    off_on[1, 0, 0], off_on[0, -1, -1] = 100, 1
    made = four_panels.panel(plain(50), off_on, plain(100), plain(200))
    assert made.dtype == np.uint8 and made.shape == (2 * (STRIP_PX + HEIGHT) + GAP_PX, 2 * WIDTH + GAP_PX, 3)
    below, right = STRIP_PX + HEIGHT + GAP_PX, WIDTH + GAP_PX
    assert (made[STRIP_PX : STRIP_PX + HEIGHT, :WIDTH] == 50).all()
    assert (made[below + STRIP_PX :, :WIDTH] == 100).all() and (made[below + STRIP_PX :, right:] == 200).all()
    events = made[STRIP_PX : STRIP_PX + HEIGHT, right:]
    assert np.abs(events[:2, :2] - 255 * ON).max() < 1, "many ON events have the full colour, in 2x2 pixels each"
    one = np.array(GROUND) + strength(np.array(1)) * (255 * OFF - np.array(GROUND))
    assert np.abs(events[-2:, -2:] - one).max() < 1 and (events[2:-2] == GROUND).all()


def test_a_film_of_panels_is_read_by_a_player(tmp_path: Path) -> None:
    levels = (40, 120, 220)
    panels = (four_panels.panel(plain(k), np.zeros((2, 9, 9)), plain(k), plain(k)) for k in levels)
    assert four_panels.write_four_panels(tmp_path / "f.mp4", panels, 30) == 3
    with av.open(str(tmp_path / "f.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert [frame.shape for frame in frames] == [(2 * (STRIP_PX + HEIGHT) + GAP_PX, 2 * WIDTH + GAP_PX, 3)] * 3
    for level, frame in zip(levels, frames, strict=True):
        assert abs(float(frame[STRIP_PX + 4 : STRIP_PX + HEIGHT - 4, 4 : WIDTH - 4].mean()) - level) < 3
    assert [file.name for file in tmp_path.iterdir()] == ["f.mp4"]


def test_a_film_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected at least one"):
        four_panels.write_four_panels(tmp_path / "f.mp4", [], 30)
    assert not list(tmp_path.iterdir())


def test_a_film_that_stops_leaves_nothing(tmp_path: Path) -> None:
    def broken():  # type: ignore[no-untyped-def]
        yield four_panels.panel(plain(1), np.zeros((2, 9, 9)), plain(1), plain(1))
        raise DataError("gone")

    with pytest.raises(DataError, match="gone"):
        four_panels.write_four_panels(tmp_path / "f.mp4", broken(), 30)
    assert not list(tmp_path.iterdir())


def test_a_sheet_has_lines_and_columns_and_patches() -> None:
    pictures = {name: [plain(level), plain(level + 10)] for name, level in (("truth", 50), ("bridge", 150))}
    pictures["truth"][1][10:20, 30:40] = 255
    made = moments.panel(pictures, ["1/2", "7/8"], (30, 10, 10, 10), height=2 * HEIGHT)
    column = 2 * WIDTH + GAP_PX + 2 * HEIGHT
    assert made.shape[0] == STRIP_PX + 2 * (2 * HEIGHT + GAP_PX)
    names = made.shape[1] - 2 * (column + GAP_PX)
    assert 0 < names < 2 * WIDTH
    second = made[STRIP_PX + GAP_PX :, names + GAP_PX + column + GAP_PX :]
    assert (second[: 2 * HEIGHT, 2 * WIDTH + GAP_PX :] == 255).all(), "the patch, as high as the picture"
    assert (second[20 : 20 + FRAME_PX, 60:80] == ACCENT).all() and (second[22:38, 62:78] == 255).all()
    assert (second[2 * HEIGHT + GAP_PX :, 2 * WIDTH + GAP_PX :] == 160).all()


@pytest.mark.parametrize(
    ("lines", "patch", "said"),
    [
        ({"a": [plain(1)]}, (60, 0, 10, 10), "expected one within 64x48"),
        ({"a": [plain(1), plain(1)]}, (0, 0, 9, 9), "expected 1, one for each moment"),
        ({"a": [plain(1)], "b": [plain(1, 40)]}, (0, 0, 9, 9), "pictures of one size"),
        ({}, (0, 0, 9, 9), "at least one of each"),
    ],
)
def test_sheets_that_do_not_fit_are_refused(lines: dict, patch: tuple[int, int, int, int], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        moments.panel(lines, ["1/2"], patch)


def test_errors_are_root_mean_squares_over_the_channels() -> None:
    truth, rebuilt = plain(100), plain(100)
    rebuilt[3, 5] = (103, 96, 100)
    found = heat_map.error_codes(truth, rebuilt)
    assert found[3, 5] == pytest.approx(np.sqrt((9 + 16 + 0) / 3)) and np.count_nonzero(found) == 1


@pytest.mark.parametrize(("most", "top"), [(0, 5), (7, 10), (12, 20), (180, 200), (255, 500)])
def test_scales_end_at_round_numbers(most: float, top: float) -> None:
    assert heat_map.top_of(np.full((9, 9), float(most))) == top


def test_a_heat_map_is_brighter_where_the_error_is_larger_and_has_its_scale() -> None:
    values = np.linspace(0, 50, HEIGHT)[:, None].repeat(WIDTH, axis=1)
    values[0, 0] = np.nan
    made = heat_map.panel(values)
    luma = made[:, 10].astype(float) @ [0.2126, 0.7152, 0.0722]
    assert made.shape[:1] == (HEIGHT,) and made.shape[1] > WIDTH and (np.diff(luma) > -1).all() and luma[-1] > 200
    bar = made[:, WIDTH + heat_map.MARGIN_PX]
    assert (bar[::-1] == made[:, 10]).all(), "the scale is the same colours, the other way up"
    assert (made[0, 0] == GROUND).all(), "what is not known is ground"


def test_similarity_is_brightest_where_it_is_worst() -> None:
    made = heat_map.coloured(np.array([1.0, 0.5, 0.0]), low=1.0, high=0.0)
    assert made.sum(axis=1).tolist() == sorted(made.sum(axis=1).tolist()) and made[0].sum() < 10


def test_the_worst_patch_is_shown_larger() -> None:
    truth, rebuilt = plain(100, 120, 160), plain(100, 120, 160)
    rebuilt[10:109, 40:139] = 180
    made = worst_patch.panel(truth, rebuilt, (40, 10), width=198)
    tall = round(120 * 198 / 160)
    patches = made[STRIP_PX + tall + GAP_PX + STRIP_PX :]
    assert patches.shape[0] == 198
    assert (patches[:, :198] == 100).all() and (patches[:, 198 + GAP_PX : 2 * 198 + GAP_PX] == 180).all()


def test_a_map_of_similarity_is_one_column_more() -> None:
    truth, map_ = plain(100, 120, 160), np.full((120, 160), np.nan)
    map_[5:-5, 5:-5] = 1.0
    without, made = worst_patch.panel(truth, truth, (0, 0)), worst_patch.panel(truth, truth, (0, 0), map_)
    assert made.shape[0] == without.shape[0] and made.shape[1] > without.shape[1] + worst_patch.WIDTH_PX
    assert (made[:, : without.shape[1]] == without).all()
    with pytest.raises(UsageError, match="as large as the pictures"):
        worst_patch.panel(truth, truth, (0, 0), map_[5:-5, 5:-5])


def test_a_picture_smaller_than_a_patch_is_its_own() -> None:
    assert worst_patch.panel(plain(10), plain(20), (0, 0), width=64).dtype == np.uint8


def test_pictures_are_written_as_they_are(tmp_path: Path) -> None:
    values = np.random.default_rng(0).uniform(0, 99, (HEIGHT, WIDTH))
    write_png(tmp_path / "new" / "map.png", heat_map.panel(values))
    read = cv2.imread(str(tmp_path / "new" / "map.png"))[..., ::-1]
    assert (read == heat_map.panel(values)).all()


def test_letters_stand_on_one_line_and_are_cut_at_the_edge() -> None:
    assert letters("x").shape[0] == letters("gÄ|").shape[0]
    assert np.flatnonzero(letters("x").sum(1))[-1] == np.flatnonzero(letters("Hx").sum(1))[-1]
    assert letters(" ").shape[1] == 0 and letters("街").max() > 0
    narrow = strip("a very long name of a method", 20)
    assert narrow.shape == (STRIP_PX, 20, 3) and (narrow[0] == GROUND).all() and narrow.max() <= max(INK)


@pytest.mark.parametrize("width", [60, 160, 400])
def test_names_that_are_too_long_for_a_strip_are_told_apart_by_their_ends(width: int) -> None:
    names = [f"{'a very long name of a method ' * 3}{k}" for k in range(3)]
    strips = [strip(name, width) for name in names]
    assert len({each.tobytes() for each in strips}) == 3
    assert all((each[:, -1] == GROUND).all() for each in strips), "no letter is cut"
    assert (
        strip("short", width)[:, : letters("short").shape[1] + 4]
        == strip("short", 500)[:, : letters("short").shape[1] + 4]
    ).all()


@pytest.mark.parametrize(("width", "height"), [(1, 300), (300, 1), (2, 200)])
def test_what_a_line_camera_sees_fits_on_sheets(width: int, height: int) -> None:
    """A sheet is no larger than so many times what its pictures are meant to be."""
    true, made = plain(40, height, width), plain(60, height, width)
    worst = worst_patch.panel(true, made, (0, 0), width=100)
    sheet = moments.panel({"truth": [true], "linear": [made]}, ["1/2"], (0, 0, 1, 1), height=40)
    assert worst.shape[0] <= 2 * (STRIP_PX + LONGEST * 100) + GAP_PX
    assert sheet.shape[1] <= 200 + (LONGEST + 1) * 40 + 2 * GAP_PX
