"""A real left photograph through its true disparity, against the real right photograph."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from view_rigs import psnr

from vid2ev.light.transfer import parse_transfer
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.views import Views

STEREO = Path(__file__).parents[2] / ".." / "shared" / "data" / "stereo"
FOCAL_PX, CENTRE_PX, DOFFS_PX, BASELINE_M = 994.978, (311.193, 254.877), 31.086, 0.193001


class Pair(NamedTuple):
    left: np.ndarray  # [H, W, 3] codes / 255
    right: np.ndarray
    disparity: np.ndarray  # [H, W] px of the left, NaN where unknown
    seen: np.ndarray  # [H, W] bool: pixels of the right that the left sees, too
    near_edge: np.ndarray  # [H, W] bool: pixels of the right within 2 px of a step of disparity


@pytest.fixture(scope="module")
def pair() -> Pair:
    if not (STEREO / "motorcycle_left.png").exists():
        pytest.skip("needs the motorcycle stereo pair of the shared data")
    left, right = (
        cv2.imread(str(STEREO / f"motorcycle_{side}.png"))[..., ::-1] / np.float32(255) for side in ("left", "right")
    )
    disparity = np.load(STEREO / "motorcycle_disp.npz")["arr_0"]
    disparity = np.where(np.isfinite(disparity), disparity, np.nan)
    rightwards = disparity_of_right(disparity)
    return Pair(left, right, disparity, seen_by_both(disparity, rightwards), near_steps(rightwards))


def disparity_of_right(disparity: np.ndarray) -> np.ndarray:
    """The largest disparity that lands on a pixel of the right or less than a pixel beside it; -1 where none does."""
    found = np.full(disparity.shape, -1.0)
    rows, columns = np.nonzero(np.isfinite(disparity))
    shift = disparity[rows, columns]
    for rounded in (np.floor, np.ceil):
        place = rounded(columns - shift).astype(int)
        inside = (place >= 0) & (place < disparity.shape[1])
        np.maximum.at(found, (rows[inside], place[inside]), shift[inside])
    return found


def seen_by_both(disparity: np.ndarray, rightwards: np.ndarray) -> np.ndarray:
    """Where the disparity of the right leads to a pixel of the left that has the same, to 1 px."""
    place = np.arange(disparity.shape[1]) + rightwards
    nearest = np.clip(np.rint(place), 0, disparity.shape[1] - 1).astype(int)
    back = np.take_along_axis(disparity, nearest, 1)
    return (rightwards >= 0) & (np.abs(back - rightwards) <= 1) & (place <= disparity.shape[1] - 1)


def near_steps(rightwards: np.ndarray) -> np.ndarray:
    nine = np.ones((3, 3), np.uint8)
    steps = cv2.dilate(rightwards, nine) - cv2.erode(rightwards, nine) > 2
    return cv2.dilate(steps.astype(np.uint8), nine) > 0


def right_view(left: np.ndarray, disparity: np.ndarray):  # type: ignore[no-untyped-def]
    """What the right camera sees: f = 995 px, 193 mm beside, its principal point `doffs` further right."""
    source = Intrinsics(size=(741, 500), focal_px=(FOCAL_PX, FOCAL_PX), centre_px=CENTRE_PX)
    camera = source.model_copy(update={"centre_px": (CENTRE_PX[0] + DOFFS_PX, CENTRE_PX[1])})
    depth_m = (FOCAL_PX * BASELINE_M / (disparity + DOFFS_PX)).astype(np.float32)
    return Views(source, [(camera, Pose.of((0, 0, 0), (BASELINE_M, 0, 0)))]).see(left, depth_m)[0]


@pytest.mark.parametrize("linear", [False, True], ids=["codes", "linear light"])
def test_the_right_photograph_from_the_left_one(pair: Pair, linear: bool) -> None:
    curve = parse_transfer("srgb")
    light = curve.to_light(pair.left).astype(np.float32) if linear else pair.left
    view = right_view(light, pair.disparity)
    seen = curve.to_signal(np.clip(view.light, 0, 1)) if linear else view.light
    assert 0.81 < pair.seen.mean() < 0.85
    assert np.isfinite(view.light).all()
    assert psnr(seen, pair.right, pair.seen) >= 28.8
    assert psnr(seen, pair.right, pair.seen & ~pair.near_edge) >= 30
    assert (view.valid == pair.seen).mean() >= 0.98
    assert pair.seen[view.valid].mean() > 0.98 and view.valid[pair.seen].mean() > 0.995


def test_the_view_is_right_to_a_fraction_of_a_pixel(pair: Pair) -> None:
    """Moved by 0.2 px either way it fits worse."""
    inside = pair.seen & ~pair.near_edge
    fits = [psnr(right_view(pair.left, pair.disparity + shift).light, pair.right, inside) for shift in (-0.2, 0, 0.2)]
    assert fits[1] > max(fits[0], fits[2])
