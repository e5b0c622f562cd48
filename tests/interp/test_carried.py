"""Events of another sensor in the geometry of the frames: where they belong, and as many as a pixel there sends."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pairs import counts
from scipy.ndimage import map_coordinates

from interp.representation.carried import at_places, carried, footprint_of, footprint_over, over, places_of, places_over
from interp.representation.event_counts import EventCounts
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose

HERE = Pose.of()


def here(size: tuple[int, int]) -> torch.Tensor:
    down, across = torch.meshgrid(torch.arange(float(size[0])), torch.arange(float(size[1])), indexing="ij")
    return torch.stack([across, down], -1)


def one_event(size: tuple[int, int], row: int, column: int) -> EventCounts:
    off_on = torch.zeros(1, 2, 3, *size)
    off_on[0, 1, 1, row, column] = 1
    return EventCounts(off_on, torch.full((1, 2), 0.15))


def test_the_same_place_gives_the_same_counts() -> None:
    some = counts(2, (7, 9))
    assert torch.equal(carried(some, here((7, 9))).off_on, some.off_on.float())
    assert over(some, (7, 9)) is some


def test_what_is_not_seen_and_not_known_sends_nothing() -> None:
    some = EventCounts(torch.ones(1, 2, 3, 7, 9), torch.full((1, 2), 0.15))
    places = here((7, 9))
    places[0, 0], places[1, 1, 0], places[2, 2, 1] = float("nan"), -0.6, 6.6
    found = carried(some, places).off_on[0, 0, 0]
    expected = torch.ones(7, 9)
    expected[0, 0] = expected[1, 1] = expected[2, 2] = 0
    torch.testing.assert_close(found, expected)
    assert (carried(some, torch.full((4, 5, 2), float("nan"))).off_on == 0).all()


@pytest.mark.parametrize("size", [(21, 27), (14, 18), (7, 9), (4, 5), (1, 1)])
def test_even_counts_stay_even_at_any_resolution(size: tuple[int, int]) -> None:
    # a count belongs to a place: pixels of another size send as many
    some = EventCounts(torch.full((1, 2, 3, 7, 9), 2.0), torch.full((1, 2), 0.15))
    torch.testing.assert_close(over(some, size).off_on, torch.full((1, 2, 3, *size), 2.0))


def test_nine_pixels_of_a_frame_share_one_of_the_sensor() -> None:
    found = over(one_event((5, 6), 2, 3), (15, 18)).off_on[0, 1, 1]
    assert float(found.max()) == 1 and torch.nonzero(found == 1).tolist() == [[7, 10]]  # the middle one of 3 x 3
    assert float(found[6:9, 9:12].min()) > 0.4 and float(found[:4].sum()) == 0


def test_a_coarser_frame_takes_means() -> None:
    some = counts(1, (12, 18))
    torch.testing.assert_close(over(some, (4, 6)).off_on, some.pooled(3).off_on)


@pytest.mark.parametrize("size", [(4, 1), (1, 6), (4, 2)])
def test_a_coarser_frame_of_one_row_or_column_takes_means_too(size: tuple[int, int]) -> None:
    some = counts(1, (3 * size[0], 3 * size[1]))
    torch.testing.assert_close(over(some, size).off_on, some.pooled(3).off_on)


def by_the_book(plane: np.ndarray, places: np.ndarray) -> np.ndarray:
    """A plane of counts at places [H, W, 2] px: means over as many pixels as those of the frame are wide, in the middle
    of all, then between four of these; 0 beyond the sensor, and where a place is not known."""
    height, width = plane.shape
    with np.errstate(invalid="ignore"):
        seen = ((places > -0.5) & (places < np.array([width, height]) - 0.5)).all(-1)
    both = seen[:, 1:] & seen[:, :-1]
    steps = np.hypot(*np.moveaxis(np.diff(places, axis=1), -1, 0))[both]
    k = max(1, round(float(np.quantile(steps, 0.5, method="lower")))) if steps.size else 1
    means = np.array([[plane[y : y + k, x : x + k].mean() for x in range(0, width, k)] for y in range(0, height, k)])
    x, y = np.moveaxis((np.where(seen[..., None], places, 0) + 0.5) / k - 0.5, -1, 0)
    return np.where(seen, map_coordinates(means, [y, x], order=1, mode="nearest"), 0)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(0.2, 4.3), st.floats(-3, 3))
def test_counts_are_means_between_pixels_as_large_as_the_frame_s(seed: int, wide: float, turned: float) -> None:
    """Of a frame that is turned, hangs over the sensor, and whose pixels are not all as wide as each other."""
    assume(abs(wide % 1 - 0.5) > 1e-3)  # (halfway either number will do)
    draw = np.random.default_rng(seed)
    rows, columns = draw.integers(5, 12, 2)
    plane, (y, x) = draw.poisson(1.0, (11, 14)).astype(np.float64), np.mgrid[:rows, :columns]
    x = x + 2.0 * (x > columns - 2)  # (the last column is far off)
    way = np.stack([x * np.cos(turned) - y * np.sin(turned), x * np.sin(turned) + y * np.cos(turned)], -1)
    places = (wide * way + draw.uniform(0, 9, 2)).astype(np.float32)
    places[draw.random((rows, columns)) < 0.1] = np.nan
    some = EventCounts(torch.from_numpy(plane).expand(1, 2, 3, -1, -1), torch.full((1, 2), 0.15))
    found = carried(some, torch.from_numpy(places))
    np.testing.assert_allclose(found.off_on[0, 1, 2], by_the_book(plane, places), atol=1e-4)
    part = slice(1, 4), slice(2, 5)
    several = at_places(some, torch.from_numpy(places)[None])
    for cut in (carried(some, torch.from_numpy(places), part), over(several, (int(rows), int(columns)), part)):
        torch.testing.assert_close(cut.off_on, found.off_on[..., 1:4, 2:5], atol=1e-5, rtol=0)
    assert over(several, (int(rows), int(columns))).footprint == footprint_over(several, (int(rows), int(columns)))


@settings(max_examples=60)
@given(st.integers(2, 700), st.sampled_from([0.4, 0.9, 1.0, 1.4, 1.5, 2.4, 2.5, 3.5, 3.9]))
def test_a_pixel_of_the_sensor_is_as_many_of_the_frame_s_wide_as_is_nearest(columns: int, times: float) -> None:
    """However that is found: by the sizes, of counts laid over frames, and of places; halfway, too."""
    some, size = counts(1, (1, 2 * columns), steps=1), (1, round(2 * columns * times))
    wide = max(1, round(size[1] / (2 * columns)))
    laid, looked = over(some, size), at_places(some, places_over(some, size)[None])
    assert laid.footprint == footprint_of((size[1], 1), (2 * columns, 1)) == wide
    assert [footprint_over(each, size) for each in (some, laid, looked)] == [wide] * 3


def test_events_of_a_calibrated_sensor_are_where_the_frame_sees_them() -> None:
    frame_camera, event_camera = Intrinsics.of_field((64, 48), 50), Intrinsics.of_field((40, 30), 60)
    beside = Pose.of((0.0, 2.0, 0.0), (0.015, 0.0, 0.0))  # the paper's 15 mm
    depth_m = np.full((48, 64), 0.8)
    places = places_of(frame_camera, HERE, event_camera, beside, depth_m)
    row, column = 20, 33
    x, y = places[row, column].tolist()
    point = np.array([(column - 31.5) / frame_camera.focal_px[0], (row - 23.5) / frame_camera.focal_px[1], 1]) * 0.8
    seen = beside.inverse().apply(point)
    expected = seen[:2] / seen[2] * event_camera.focal_px + event_camera.centre_px
    np.testing.assert_allclose([x, y], expected, atol=1e-3)
    found = carried(one_event((30, 40), round(y), round(x)), places).off_on[0, 1, 1]
    brightest = np.unravel_index(int(found.argmax()), found.shape)
    assert abs(brightest[0] - row) <= 1 and abs(brightest[1] - column) <= 1


def test_without_depth_the_infinitely_far_is_rectified() -> None:
    camera = Intrinsics.of_field((16, 12), 50)
    places = places_of(camera, HERE, camera, Pose.of((0, 0, 0), (0.1, 0, 0)))
    np.testing.assert_allclose(places, here((12, 16)), atol=1e-4)
