"""Trajectories: where they lead, how smooth they are, and what other programs say of them."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import Rotation

from vid2ev.rig.pose import Pose
from vid2ev.scenes.scene_file import frozen
from vid2ev.scenes.trajectory import Trajectory, pose_of

PARTS = TypeAdapter(Trajectory)


def trajectory(*motions: dict[str, Any]) -> Any:
    return PARTS.validate_python(frozen(list(motions)))


def derivatives(path: Any, t_s: float, step_s: float = 1e-3) -> list[np.ndarray]:
    """Speed and acceleration of place and rotation matrix, by central differences."""
    values = [pose_of(path, t_s + k * step_s) for k in (-1, 0, 1)]
    flat = [np.concatenate([pose.rotation.ravel(), pose.translation_m]) for pose in values]
    return [(flat[2] - flat[0]) / (2 * step_s), (flat[2] - 2 * flat[1] + flat[0]) / step_s**2]


def is_rotation(pose: Pose) -> bool:
    return (
        bool(np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-12)) and np.linalg.det(pose.rotation) > 0
    )


KEYS = {
    "kind": "keyframes",
    "times_s": [0.0, 0.7, 1.0, 2.2],
    "positions_m": [[0, 0, 0], [1, 0.5, 0], [1, 2, -1], [0, 0, 3]],
    "rotations_deg": [[0, 0, 0], [0, 60, 0], [30, 60, 0], [0, -20, 80]],
}


@pytest.mark.parametrize("path", ["spline", "linear"])
def test_keyframes_are_passed_through(path: str) -> None:
    motion = trajectory(KEYS | {"path": path})
    for t_s, place, turn in zip(KEYS["times_s"], KEYS["positions_m"], KEYS["rotations_deg"], strict=True):
        pose = pose_of(motion, t_s)
        assert np.allclose(pose.translation_m, place, atol=1e-12)
        assert np.allclose(pose.rotation, Rotation.from_rotvec(turn, degrees=True).as_matrix(), atol=1e-12)


def test_linear_keyframes_turn_as_slerp_does() -> None:
    from scipy.spatial.transform import Slerp

    motion = trajectory(KEYS | {"path": "linear"})
    slerp = Slerp(KEYS["times_s"], Rotation.from_rotvec(KEYS["rotations_deg"], degrees=True))
    for t_s in np.linspace(0, 2.2, 23):
        assert np.allclose(pose_of(motion, t_s).rotation, slerp(t_s).as_matrix(), atol=1e-9)
    assert np.allclose(pose_of(motion, 0.35).translation_m, [0.5, 0.25, 0])
    assert np.allclose(pose_of(motion, -1).translation_m, [0, 0, 0])  # (it stands still beyond its ends)
    assert np.allclose(pose_of(motion, 9).translation_m, [0, 0, 3])


def test_splines_have_no_kink_in_speed_or_acceleration() -> None:
    motion = trajectory(KEYS)
    for t_s in (0.0, 0.7, 1.0, 2.2):  # (inside, and where the spline ends)
        for order, limit in ((0, 0.3), (1, 3.0)):
            before, after = (derivatives(motion, t_s + side * 2e-3)[order] for side in (-1, 1))
            assert np.abs(after - before).max() < limit  # (the third derivative may be some 500 a second cubed)
    linear = trajectory(KEYS | {"path": "linear"})
    before, after = (derivatives(linear, 0.7 + side * 2e-3)[0] for side in (-1, 1))
    assert np.abs(after - before).max() > 1  # (the measure tells a kink)


@pytest.mark.parametrize("ends_s", [(-3.0, -1.0), (3.0, 5.0)])
def test_beyond_its_ends_a_spline_goes_straight_on(ends_s: tuple[float, float]) -> None:
    places = [pose_of(trajectory(KEYS), t_s).translation_m for t_s in np.linspace(*ends_s, 5)]
    speeds = np.diff(places, axis=0)
    assert np.linalg.norm(speeds[0]) > 0.1
    np.testing.assert_allclose(speeds, np.tile(speeds[0], (4, 1)), atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_a_spline_turns_by_the_shorter_way(axis: int) -> None:
    """From 170 degrees to -170 it is 20 degrees, over the back."""
    along = np.eye(3)[axis]
    turns = [(degrees * along).tolist() for degrees in (170, -170)]
    motion = trajectory({"kind": "keyframes", "times_s": [0, 1], "rotations_deg": turns})
    assert np.allclose(pose_of(motion, 0.5).rotation, np.diag(2 * along - 1), atol=1e-12)


@pytest.mark.parametrize("path", ["spline", "linear"])
@pytest.mark.parametrize("t_s", [-0.3, 0.0, 0.4, 2.2])
def test_keyframes_without_places_stay_where_they_are_and_without_turns_are_not_turned(path: str, t_s: float) -> None:
    whole = pose_of(trajectory(KEYS | {"path": path}), t_s)
    one, other = (
        {key: value for key, value in KEYS.items() if key != left} for left in ("positions_m", "rotations_deg")
    )
    turned, placed = (pose_of(trajectory(motion | {"path": path}), t_s) for motion in (one, other))
    assert np.array_equal(turned.translation_m, np.zeros(3))
    assert np.allclose(turned.rotation, whole.rotation, atol=1e-12)
    assert np.allclose(placed.rotation, np.eye(3), atol=1e-12)
    assert np.allclose(placed.translation_m, whole.translation_m, atol=1e-12)


@settings(max_examples=60)
@given(
    st.lists(st.lists(st.floats(-180, 180), min_size=3, max_size=3), min_size=2, max_size=6),
    st.floats(-5, 20),
)
def test_turns_between_any_keyframes_are_turns(turns: list[list[float]], t_s: float) -> None:
    motion = trajectory({"kind": "keyframes", "times_s": [float(k) for k in range(len(turns))], "rotations_deg": turns})
    assert is_rotation(pose_of(motion, t_s))


def test_spin_turns_at_its_rate_for_any_time() -> None:
    motion = trajectory({"kind": "spin", "axis": [0, 0, 2], "rate_deg_s": 90, "phase_deg": 30})
    for t_s in (0.0, 1.0, 1e5 + 0.5):
        angle = math.radians((30 + 90 * t_s) % 360)
        assert np.allclose(pose_of(motion, t_s).rotation[:2, 0], [math.cos(angle), math.sin(angle)], atol=1e-7)


@pytest.mark.parametrize("along", [(1, 1, 0), (1, 2, 3), (-3, 1, 0.5)])
def test_orbits_are_circles_without_a_turn(along: tuple[float, float, float]) -> None:
    motion = trajectory({"kind": "orbit", "centre_m": [1, 2, 3], "axis": along, "radius_m": 2, "period_s": 4})
    centre, axis = np.array([1, 2, 3]), np.array(along) / np.linalg.norm(along)
    ways = np.array([pose_of(motion, t).translation_m - centre for t in np.linspace(0, 4, 9)])
    assert np.allclose(np.linalg.norm(ways, axis=1), 2) and np.allclose(ways @ axis, 0)
    assert np.allclose(ways[0], ways[-1]) and np.allclose(ways[0], -ways[4])
    assert ways[0] @ np.cross(axis, ways[0]) == pytest.approx(0) and ways[2] @ np.cross(axis, ways[0]) > 3.9
    assert np.array_equal(pose_of(motion, 1.3).rotation, np.eye(3))


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1)])
def test_the_phase_of_an_orbit_is_where_it_begins(axis: tuple[int, int, int]) -> None:
    orbit = {"kind": "orbit", "axis": axis, "radius_m": 2, "period_s": 4}
    ahead, behind = (pose_of(trajectory(orbit | {"phase_deg": deg}), 0.5).translation_m for deg in (90, 0))
    np.testing.assert_allclose(ahead, pose_of(trajectory(orbit), 1.5).translation_m, atol=1e-12)
    np.testing.assert_allclose(ahead, np.cross(axis, behind), atol=1e-12)
    assert np.linalg.norm(ahead) == pytest.approx(2)


def test_motions_follow_each_other_in_the_coordinates_of_those_before() -> None:
    flight = {
        "kind": "straight",
        "position_m": [1, 0, 0],
        "velocity_m_s": [0, 1, 0],
        "at_s": 1,
        "rotation_deg": [0, 0, 90],
    }
    pose = pose_of(trajectory(flight, {"kind": "fixed", "position_m": [2, 0, 0]}), 3.0)
    assert np.allclose(pose.translation_m, [1, 2 + 2, 0])


@given(st.lists(st.floats(-10, 10), min_size=3, max_size=3), st.lists(st.floats(-10, 10), min_size=3, max_size=3))
def test_look_at_points_z_to_the_target_and_leaves_the_place(place: list[float], target: list[float]) -> None:
    pose = pose_of(trajectory({"kind": "fixed", "position_m": place}, {"kind": "look-at", "target_m": target}), 0.0)
    assert is_rotation(pose) and np.allclose(pose.translation_m, place)
    way = np.array(target) - place
    if np.linalg.norm(way) > 1e-6:
        assert np.allclose(pose.rotation[:, 2] * np.linalg.norm(way), way, atol=1e-9)
    if np.hypot(way[0], way[2]) > 1e-3:
        assert abs(pose.rotation[1, 0]) < 1e-9 and pose.rotation[1, 1] >= 0  # (level, and upright: y is down)


def test_only_the_direction_of_up_counts() -> None:
    """In the picture it is where y, which goes down, comes from."""
    for length in (1e-7, 1, 1e6):
        pose = pose_of(trajectory({"kind": "look-at", "target_m": [0, 0, 1], "up": [0, length, 0]}), 0.0)
        assert np.allclose(pose.rotation[:, 1], (0, -1, 0))


def test_shake_has_its_root_mean_square_and_stays_in_its_band() -> None:
    motion = trajectory({"kind": "shake", "rms_mm": 5, "rms_deg": 0, "low_hz": 1, "high_hz": 10, "seed": 3})
    rate, seconds = 100, 200
    places = np.array([pose_of(motion, k / rate).translation_m for k in range(rate * seconds)])
    assert np.allclose(1e3 * places.std(axis=0), 5, rtol=0.05)
    power = np.abs(np.fft.rfft(places[:, 0])) ** 2
    frequency = np.fft.rfftfreq(rate * seconds, 1 / rate)
    assert power[(frequency < 0.9) | (frequency > 10.1)].sum() < 0.01 * power.sum()
    windowed = np.abs(np.fft.rfft(places * np.hanning(len(places))[:, None], axis=0)) ** 2
    for low, high in pairwise(10 ** (np.arange(17) / 16)):  # (each of its 16 sines has a band of its own)
        band = windowed[(frequency >= low) & (frequency < high)].sum(axis=0) / windowed.sum(axis=0)
        assert np.all((band > 0.5 / 16) & (band < 1.5 / 16))
    others = [pose_of(trajectory({"kind": "shake", "seed": seed}), 0.3).translation_m[0] for seed in range(5)]
    assert len(set(others)) == 5


def test_a_shake_turns_by_its_root_mean_square_apart_from_where_it_goes() -> None:
    motion = trajectory({"kind": "shake", "rms_mm": 5, "rms_deg": 0.3, "seed": 3})
    poses = [pose_of(motion, k / 50) for k in range(2000)]
    turns = np.array([Rotation.from_matrix(pose.rotation).as_rotvec(degrees=True) for pose in poses])
    assert np.allclose(turns.std(axis=0), 0.3, rtol=0.1)
    places = np.array([pose.translation_m for pose in poses])
    assert np.abs(np.corrcoef(turns, places, rowvar=False)[:3, 3:]).max() < 0.3


@pytest.mark.parametrize(
    "motion",
    [
        {"kind": "spin", "axis": [0, 0, 0], "rate_deg_s": 1},
        {"kind": "orbit", "radius_m": 1, "period_s": 0},
        {"kind": "keyframes", "times_s": [0, 0], "positions_m": [[0, 0, 0]] * 2},
        {"kind": "keyframes", "times_s": [2, 1], "positions_m": [[0, 0, 0]] * 2},
        {"kind": "keyframes", "times_s": [0, 1], "positions_m": [[0, 0, 0]]},
        {"kind": "shake", "low_hz": 5, "high_hz": 1},
        {"kind": "straight", "velocity_m_s": [math.inf, 0, 0]},
        {"kind": "fixed", "position_m": ["1", 0, 0]},
        {"kind": "look-at", "target_m": [0, 0, 1], "up": [0, 1e300, 0]},
        {"kind": "hover"},
    ],
)
def test_what_is_no_motion_is_refused(motion: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        trajectory(motion)
