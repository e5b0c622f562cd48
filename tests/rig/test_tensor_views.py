"""Views of a tensor are those of an array."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.ndimage
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from view_rigs import pinhole

from vid2ev.rig import views as rig_views
from vid2ev.rig.bands import Bands
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.rig.sampling import sampled
from vid2ev.rig.spline import BRIGHTEST, INFINITE, MARGIN, Spline
from vid2ev.rig.tensor_spline import TensorSpline, spline_of
from vid2ev.rig.tensor_views import TensorLook
from vid2ev.rig.views import Views

SIZE = (40, 30)
LENSES = (
    {},
    {"model": "radtan", "distortion": (-0.2, 0.05, 0.002, -0.001)},
    {"model": "equidistant", "distortion": (0.03, -0.01, 0.0, 0.0)},
)
# Only the filter of the spline rounds otherwise.  On either way light is off by up to 7 units in the last place of the
# light's range, worst in a checkerboard, where weights are nine times the light; apart they were by up to 6.
ULPS = 14


def range_of(light: np.ndarray) -> float:
    known = np.nan_to_num(light, nan=0.0)
    mended = np.where(np.abs(known) < INFINITE, known, np.sign(known) * BRIGHTEST)
    return float(mended.max() - mended.min())


def assert_alike(found: Any, expected: np.ndarray, light: np.ndarray) -> None:
    assert found.dtype == torch.float32 and found.is_contiguous()
    assert found.shape == expected.shape
    assert np.abs(found.numpy() - expected).max(initial=0) <= ULPS * 2**-23 * range_of(light)


@st.composite
def lights(draw: st.DrawFn) -> np.ndarray:
    """Noise, black pixels beside white ones, or lights of all octaves; some of it no light."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = (SIZE[1], SIZE[0], *draw(st.sampled_from([(), (3,)])))
    light = {
        "noise": rng.random(shape),
        "squares": rng.integers(0, 2, shape),
        "octaves": np.exp(rng.normal(0, 3, shape)) - 0.1,
    }[draw(st.sampled_from(["noise", "squares", "octaves"]))].astype(np.float32)
    if draw(st.booleans()):
        light[rng.random(shape) < 0.01] = draw(st.sampled_from([np.nan, np.inf, -np.inf, 1e30, -3e38]))
    return light


@st.composite
def depths(draw: st.DrawFn) -> np.ndarray:
    """Cards before a wall, some of it unknown."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    depth_m = np.full(SIZE[::-1], draw(st.sampled_from([4.0, 50.0, np.inf])), np.float32)
    for _ in range(draw(st.integers(0, 3))):
        x, y = rng.integers(0, SIZE[0] - 4), rng.integers(0, SIZE[1] - 4)
        depth_m[y : y + rng.integers(2, 20), x : x + rng.integers(2, 20)] = rng.uniform(0.3, 3)
    depth_m[rng.random(depth_m.shape) < draw(st.sampled_from([0, 0.02]))] = draw(st.sampled_from([0, np.nan, -1]))
    return depth_m


@st.composite
def cameras(draw: st.DrawFn) -> tuple[Intrinsics, Pose]:
    size = draw(st.sampled_from([SIZE, (17, 12), (61, 44)]))
    camera = pinhole(size, draw(st.sampled_from([0.6, 1.0, 1.7])) * size[0]).model_copy(
        update=draw(st.sampled_from(LENSES))
    )
    turn = draw(st.tuples(*[st.sampled_from([0, 3, -20, 170])] * 3))
    return camera, Pose.of(turn, draw(st.tuples(*[st.sampled_from([0.0, 0.05, -0.3])] * 3)))


@settings(max_examples=50)
@given(st.data())
def test_a_view_of_a_tensor_is_that_of_an_array(data: st.DataObject) -> None:
    light, source = data.draw(lights()), pinhole(SIZE, 40).model_copy(update=data.draw(st.sampled_from(LENSES)))
    some = data.draw(st.lists(cameras(), min_size=1, max_size=2))
    plane_m = data.draw(st.sampled_from([None, 2.0]))
    views = Views(source, some, plane_m, samples=data.draw(st.sampled_from([1, 2])))
    depth_m = data.draw(depths()) if views.needs_depth() or data.draw(st.booleans()) else None
    expected = views.see(light, depth_m)
    for found, view in zip(views.see(torch.from_numpy(light), depth_m), expected, strict=True):
        assert_alike(found.light, view.light, light)
        np.testing.assert_array_equal(found.valid, view.valid)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (2, 2), (3, 2), (33, 29), (20, 30, 3)])
def test_a_spline_is_that_of_scipy(shape: tuple[int, ...]) -> None:
    light = np.random.default_rng(2).random(shape, np.float32)
    there, here = spline_of(torch.from_numpy(light)), Spline(light, Bands(1))
    for found, expected in ((there.pixels, here.pixels), (there.least, here.limits[..., 0])):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(there.most, here.limits[..., 1])
    inside = there.weights[:, MARGIN:-MARGIN, MARGIN:-MARGIN].numpy()
    for weights, plane in zip(inside, here.pixels.astype(float), strict=True):
        exact = scipy.ndimage.spline_filter(plane, mode="mirror")
        assert np.abs(weights - exact).max() < ULPS * 2**-23 * np.abs(exact).max()


def test_with_the_same_spline_it_is_the_same_light_to_the_bit() -> None:
    rng = np.random.default_rng(3)
    light, (x, y) = rng.random((30, 40, 3), np.float32), rng.uniform(-3, 43, (2, 50, 60)).astype(np.float32)
    spline = Spline(light, Bands(1))
    arrays = (spline.pixels, spline.weights, *np.moveaxis(spline.limits, -1, 0))
    there = TensorSpline(*(torch.from_numpy(array.copy()) for array in arrays))
    inverse = np.where(rng.random((30, 40)) < 0.8, 0.25, 1).astype(np.float32)
    for cuts in ((), (rng.random((30, 40)) < 0.5, inverse, 0.1)):
        found = TensorLook(SIZE, x, y, 1, None, cuts, "cpu").light(there, 0)
        np.testing.assert_array_equal(found, sampled(spline, x, y, Bands(1), *cuts))


def test_the_source_s_own_camera_gets_its_very_tensor() -> None:
    light = torch.rand(30, 40, 3)
    source = pinhole(SIZE)
    for beside in ([], [(source, Pose.of((0, 5, 0), (0, 0, 0)))]):
        view = Views(source, [(source, IDENTITY), *beside]).see(light)[0]
        assert view.light is light and view.valid.all()


def test_places_go_to_the_device_once_while_depth_stays_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    monkeypatch.setattr(rig_views, "TensorLook", lambda *given: made.append(1) or TensorLook(*given))
    views = Views(pinhole(SIZE), [(pinhole(SIZE), Pose.of((0, 0, 0), (0.1, 0, 0)))])
    depth_m, light = np.full((30, 40), 2, np.float32), torch.rand(30, 40)
    first = views.see(light, depth_m)[0].light
    assert torch.equal(first, views.see(light, depth_m.copy())[0].light) and len(made) == 1
    depth_m[10:20, 10:20] = 1
    assert not torch.equal(first, views.see(light, depth_m)[0].light) and len(made) == 2


def test_everything_is_on_the_device_of_the_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tensor of another device is refused by torch, also on the device that has no numbers."""
    from torch.fx.experimental import _config

    monkeypatch.setattr(_config, "meta_nonzero_assume_all_nonzero", True)
    depth_m = np.full((30, 40), 4, np.float32)
    depth_m[10:20, 10:20] = 1
    camera = pinhole((17, 12), 17.0)
    views = Views(pinhole(SIZE), [(camera, Pose.of((0, 0, 0), (0.1, 0, 0)))])
    view = views.see(torch.rand(30, 40, 3, device="meta"), depth_m)[0]
    assert view.light.device.type == "meta" and view.light.shape == (12, 17, 3)
    look = views.looks(depth_m)[0]
    assert look.cuts and look.fill is not None and look.fill.holes.size and len(look.places.x) > 12
