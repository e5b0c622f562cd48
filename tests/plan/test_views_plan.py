"""Views in plans: what a homography in place of depth is off stays within its bound, in every pixel that is seen."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from vid2ev.commands.plan import plan as plan_command
from vid2ev.plan.recordings import plans_of
from vid2ev.plan.views import DepthRange, homography_error_px
from vid2ev.rig.homography import places_on_plane
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.views import Views
from vid2ev.seen.recipe import Recipe

CLIP = "synthetic:moving-edge,size=48x32,duration_s=0.05"
SOURCE = Intrinsics.of_field((96, 72), 60.0)
BESIDE = Pose.of((0, 0, 0), (0.05, -0.02, 0.0))
POSES = {
    "beside": BESIDE,
    "ahead": Pose.of((0, 0, 0), (0.01, 0.0, 0.1)),
    "behind": Pose.of((1, -2, 0), (0.03, 0.02, -0.1)),
    "turned": Pose.of((2, 4, -3), (-0.06, 0.01, 0.0)),
}


def depth_map(kind: str, seed: int) -> np.ndarray:
    """Depth [m] of all kinds: ramps, hills, steps, and what is not known or infinitely far."""
    draws = np.random.default_rng(seed)
    height, width = SOURCE.size[::-1]
    hills = cv2.GaussianBlur(draws.random((height, width)).astype(np.float32), (0, 0), 6)
    hills = 1.2 + 4 * (hills - hills.min()) / np.ptp(hills)
    if kind == "ramp":
        return np.broadcast_to(np.linspace(1.5, 6, width, dtype=np.float32), (height, width)).copy()
    if kind == "step":
        return np.where(hills > 3, np.float32(4), np.float32(1.5))
    if kind == "unknown":
        hills[draws.random(hills.shape) < 0.05] = np.nan
        hills[:3] = np.inf
        hills[-3:] = 0
    return hills


def seen_range(*maps: np.ndarray) -> DepthRange:
    found = DepthRange()
    for each in maps:
        found.see(each)
    return found


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("kind", ["ramp", "hills", "step", "unknown"])
def test_a_homography_is_off_by_no_more_than_its_bound(kind: str, pose: str) -> None:
    depth = depth_map(kind, 1)
    found = seen_range(depth)
    bound = homography_error_px(SOURCE, SOURCE, POSES[pose], found)
    look = Views(SOURCE, [(SOURCE, POSES[pose])]).looks(depth)[0]
    flat = places_on_plane(SOURCE, SOURCE, POSES[pose], 2 / (found.near + found.far))
    off = np.hypot(look.places.x - flat.x, look.places.y - flat.y)[look.places.seen]
    assert off.size > 500
    assert off.max() <= bound + 0.01
    assert bound <= 10 * off.max()


def test_the_bound_is_the_formula_beside_the_source() -> None:
    """f |t| (1/Z_min - 1/Z_max) / 2 for a camera that moved across."""
    found = seen_range(np.array([[2.0, 5.0]], np.float32))
    expected = SOURCE.focal_px[0] * np.hypot(0.05, 0.02) * (1 / 2 - 1 / 5) / 2
    assert homography_error_px(SOURCE, SOURCE, BESIDE, found) == pytest.approx(expected, rel=1e-4)
    assert homography_error_px(SOURCE, SOURCE, POSES["ahead"], seen_range(np.array([[0.05, 9.0]]))) == np.inf


def test_the_range_is_that_of_all_frames_where_depth_is_known() -> None:
    maps = [np.array([[np.nan, 0, -3, 1e-9, 2.0]]), np.array([[np.inf, 4.0]]), np.array([[np.nan]]), np.array([[8.0]])]
    found = seen_range(*maps)
    found.see(None)
    assert (found.near, found.far) == (0.5, 0.0)
    found = seen_range(*maps[::2], *maps[3:], maps[0])
    assert (found.near, found.far) == (0.5, 0.125)


def test_of_what_is_infinitely_far_a_homography_is_exact() -> None:
    found = seen_range(np.full((2, 2), np.inf))
    assert homography_error_px(SOURCE, SOURCE, POSES["ahead"], found) == 0.0


def rig(folder: Path) -> Path:
    path = folder / "rig.toml"
    path.write_text(
        '[[camera]]\nname = "here"\nkind = "dvs"\nsensor = "ideal"\n'
        '[[camera]]\nname = "turned"\nkind = "cis"\nrotation_deg = [0, 2, 0]\n'
        '[[camera]]\nname = "beside"\nkind = "cis"\ntranslation_mm = [40, 0, 0]\n'
    )
    return path


def rows_of_views(recipe: Recipe) -> dict[str, tuple[str, str, str]]:
    found = {}
    for name, plan in plans_of(recipe).items():
        (row,) = (row for row in plan.rows if row.effect == "view")
        assert row.omission.distance in (None, 0.0) and (row.fate == "kept") == (row.omission.distance is None)
        found[name] = row.fate, row.omission.kind, row.omission.figure
    return found


def test_a_view_takes_no_more_than_it_needs(tmp_path: Path) -> None:
    """The very picture, a homography for a turn and for a plane, depth where there is a map of it."""
    plane = rows_of_views(Recipe.of(CLIP, rig=rig(tmp_path), depth="plane:2"))
    assert plane["here"] == ("dropped", "exact", "the source's picture")
    assert plane["turned"][:2] == plane["beside"][:2] == ("replaced", "exact")
    focal_px = Recipe.of(CLIP, rig=rig(tmp_path), depth="plane:2").rig.source.focal_px[0]
    assert plane["beside"][2] == f"a homography, up to {focal_px * 0.04 / 2:.2g} px from the source's"
    np.save(tmp_path / "depth.npy", np.linspace(2, 4, 32 * 48, dtype=np.float32).reshape(32, 48))
    recipe = Recipe.of(CLIP, rig=rig(tmp_path), depth=tmp_path / "depth.npy")
    mapped = rows_of_views(recipe)
    assert mapped["here"] == plane["here"] and mapped["turned"][:2] == ("replaced", "exact")
    expected = focal_px * 0.04 * (1 / 2 - 1 / 4) / 2
    assert mapped["beside"] == ("kept", "bound", f"{expected:.2g} px")
    bent, own = rig(tmp_path), rig(tmp_path).read_text()
    lens = 'distortion_model = "radtan"\ndistortion = [-0.1, 0, 0, 0]\n'
    for text, kind in ((f"[source]\nfov_deg = 60\n{lens}{own}", "estimate"), (f"{own}{lens}", "bound")):
        bent.write_text(text)
        assert rows_of_views(Recipe.of(CLIP, rig=bent, depth=tmp_path / "depth.npy"))["beside"][1] == kind


def test_how_far_pixels_are_from_those_of_the_source_is_not_said_where_they_are_fewer(tmp_path: Path) -> None:
    coarse = rig(tmp_path)
    coarse.write_text(f"{coarse.read_text()}size = [24, 16]\n")
    found = rows_of_views(Recipe.of(CLIP, rig=coarse, depth="plane:2"))
    assert found["beside"] == ("replaced", "exact", "a homography")


def test_cameras_of_a_scene_have_pictures_of_their_own(tmp_path: Path) -> None:
    """Rendered ones, which neither a homography nor light between frames could take the place of."""
    plans = plans_of(Recipe.of("scene:parallax,size=48x36", rig=rig(tmp_path), stop=0.02))
    for name in ("turned", "beside"):
        row = plans[name].rows[0]
        assert (row.effect, row.fate, row.omission.figure) == ("view", "kept", "a picture of its own")
        assert row.ns_per_pixel == 0 and "subframes" not in [each.effect for each in plans[name].rows]


def test_one_table_for_each_camera(tmp_path: Path) -> None:
    arguments = [CLIP, "--rig", str(rig(tmp_path)), "--depth", "plane:2"]
    table = CliRunner().invoke(plan_command, arguments)
    found = CliRunner().invoke(plan_command, [*arguments, "--json"])
    assert table.exit_code == found.exit_code == 0, table.output + found.output
    plans = json.loads(found.output)
    assert list(plans) == ["here", "turned", "beside"]
    tables = dict(zip(plans, table.output.split("\n\n"), strict=True))
    for name, plan in plans.items():
        lines = tables[name].strip().splitlines()
        assert lines[0] == name and len(lines) == len(plan["rows"]) + 3
        assert [row["effect"] for row in plan["rows"]][:2] == ["view", "subframes"]
    assert plans["beside"]["rows"][2]["effect"] == "exposure" and plans["beside"]["rows"][2]["max_lsb"] > 0


def test_frames_without_a_rig_are_planned() -> None:
    said = CliRunner().invoke(plan_command, [CLIP, "--frames", "--sensor", "ideal", "--cis", "phone"])
    assert said.exit_code == 0 and "rolling_shutter" in said.output and "LSB" in said.output, said.output
