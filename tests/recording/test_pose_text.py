"""poses.txt: nanoseconds and poses read back exactly, files of others are read, damage is one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.pose_text import HEADER, pose_lines
from vid2ev.recording.truth_files import read_poses, write_poses
from vid2ev.rig.pose import Pose

component = st.floats(-1e6, 1e6)
poses = st.tuples(st.integers(-(10**18), 10**18), st.tuples(*[component] * 3), st.tuples(*[st.floats(-180, 180)] * 3))


@given(st.lists(poses, max_size=5))
def test_poses_read_back(tmp_path_factory: pytest.TempPathFactory, drawn: list[tuple]) -> None:  # type: ignore[type-arg]
    path = tmp_path_factory.getbasetemp() / "poses.txt"
    t_ns = np.array([t for t, _, _ in drawn], np.int64)
    placed = [Pose.of(turn, where) for _, where, turn in drawn]
    where = np.array([pose.translation_m for pose in placed]).reshape(-1, 3)
    turned = np.array([pose.quaternion() for pose in placed]).reshape(-1, 4)
    write_poses(path, t_ns, where, turned)
    times, positions, quaternions = read_poses(path)
    np.testing.assert_array_equal(times, t_ns)
    np.testing.assert_array_equal(positions, where)
    np.testing.assert_allclose(quaternions, turned, atol=1e-15)


def test_the_text_is_that_of_the_benchmark(tmp_path: Path) -> None:
    turn = Pose.of((0, 90, 0), (0.015, 0, -2))
    t_ns = np.array([0, 33_333_333, -1, 1_700_000_000_123_456_789], np.int64)
    write_poses(tmp_path / "poses.txt", t_ns, np.tile(turn.translation_m, (4, 1)), np.tile(turn.quaternion(), (4, 1)))
    header, *lines = (tmp_path / "poses.txt").read_text().splitlines()
    assert header == "# timestamp tx ty tz qx qy qz qw"
    stamps = ["0.000000000", "0.033333333", "-0.000000001", "1700000000.123456789"]
    assert [line.split()[0] for line in lines] == stamps
    numbers = np.array([line.split()[1:] for line in lines], float)
    np.testing.assert_allclose(numbers, [[0.015, 0, -2, 0, 0.5**0.5, 0, 0.5**0.5]] * 4, atol=1e-15)
    assert np.loadtxt(tmp_path / "poses.txt").shape == (4, 8)


def test_a_file_may_grow(tmp_path: Path) -> None:
    t_ns, where, turned = np.arange(4) * 7, np.arange(12.0).reshape(4, 3), np.tile((0.0, 0, 0, 1), (4, 1))
    parts = [pose_lines(t_ns[part], where[part], turned[part]) for part in (slice(0, 1), slice(1, 4))]
    write_poses(tmp_path / "poses.txt", t_ns, where, turned)
    assert (tmp_path / "poses.txt").read_text() == HEADER + "".join(parts)


def test_files_of_others_are_read(tmp_path: Path) -> None:
    (tmp_path / "groundtruth.txt").write_text(
        "# ground truth trajectory\n# file: 'rgbd_dataset_freiburg1_xyz.bag'\n\n"
        "1305031098.6659 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986\n  1.5e1\t0 0 0 0 0 0 -1\n"
    )
    times, positions, quaternions = read_poses(tmp_path / "groundtruth.txt")
    assert times.tolist() == [1_305_031_098_665_900_000, 15_000_000_000]
    assert positions[0].tolist() == [1.3563, 0.6305, 1.638]
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1, atol=1e-15)


@pytest.mark.parametrize(
    "line",
    [
        "1 2 3",
        "x 0 0 0 0 0 0 1",
        "nan 0 0 0 0 0 0 1",
        "1e99 0 0 0 0 0 0 1",
        "1 0 0 0 0 0 0 0",
        "1 0 0 inf 0 0 0 1",
        "1 0 0 0 0 0 0 1 9",
        "1 0 0 0 1e300 1e300 1e300 1",
        "1 a b c 0 0 0 1",
    ],
)
def test_lines_that_are_no_poses_are_named(tmp_path: Path, line: str) -> None:
    (tmp_path / "poses.txt").write_text(f"{HEADER}0 0 0 0 0 0 0 1\n{line}\n")
    with pytest.raises(DataError, match="line 3 "):
        read_poses(tmp_path / "poses.txt")


def test_files_that_are_none_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_bytes(b"\xff\xfe")
    for path in (tmp_path / "poses.txt", tmp_path):
        with pytest.raises(DataError, match="cannot be read"):
            read_poses(path)
    with pytest.raises(UsageError, match="no such file"):
        read_poses(tmp_path / "none.txt")


def test_what_are_no_poses_is_refused(tmp_path: Path) -> None:
    one = np.array([[0.0, 0, 0, 1]])
    for t_ns, where, turned in (
        (np.array([0.5]), np.zeros((1, 3)), one),
        (np.array([0, 1]), np.zeros((1, 3)), one),
        (np.array([0]), np.zeros((1, 2)), one),
        (np.array([0]), np.zeros((2, 3)), one),
        (np.array([0]), np.zeros(3), one),
        (np.array([0]), np.full((1, 3), np.nan), one),
        (np.array([0]), np.zeros((1, 3)), 2 * one),
    ):
        with pytest.raises(UsageError, match="poses are"):
            write_poses(tmp_path / "poses.txt", t_ns, where, turned)
    assert not list(tmp_path.iterdir())
