"""Damaged AEDAT files and bags are read or refused in a sentence: no crash, no hang, no hunger for memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from container_recordings import EVENT_FILES, START_US, events_at, pictures_at, recording_of, times_us
from test_aedat3 import file_of, frame, packet

from vid2ev.formats import format_named

ROOT = Path(__file__).parents[2]
PROGRAM = Path(__file__).parent / "container_damage.py"


def read_damaged(source: Path, folder: Path, copies: int, seed: int = 1) -> None:
    command = [sys.executable, str(PROGRAM), str(source), str(folder), str(copies), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env={"PYTHONPATH": str(ROOT)})
    assert (done.returncode, done.stderr) == (0, "")
    read, refused = map(int, done.stdout.split())
    assert read + refused == copies and min(read, refused) > 0


def made(folder: Path, name: str) -> Path:
    path, events = folder / "made", events_at(times_us()["sparse"][::3])
    if name == "aedat3":
        pictures = np.random.default_rng(0).integers(0, 1 << 16, (2, 30, 40, 1))
        frames = packet(2, 36 + 2400, 0, [frame(5, pixels, 1200) for pixels in pictures])
        path.write_bytes(file_of(events) + frames)
    else:
        write = format_named(name).write
        assert write
        write(path, recording_of(events, 0, pictures_at(START_US + 9_973 * np.arange(3), 30, 40)))
    return path


@pytest.mark.parametrize("name", ["aedat3", "aedat4", "ros1", "ros2"])
def test_a_few_hundred_damaged_copies(tmp_path: Path, name: str) -> None:
    read_damaged(made(tmp_path, name), tmp_path, 200)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", ["aedat3", "aedat4", "ros1", "ros2"])
def test_ten_thousand_damaged_copies(tmp_path: Path, name: str) -> None:
    read_damaged(made(tmp_path, name), tmp_path, 10_000, seed=2)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", ["evt3_vga_legs.bag", "evt3_vga_legs_ros2/test_events_1.db3"])
def test_ten_thousand_damaged_copies_of_what_a_camera_recorded(tmp_path: Path, name: str) -> None:
    if not (EVENT_FILES / name).exists():
        pytest.skip(f"needs {name} of the shared data")
    read_damaged(EVENT_FILES / name, tmp_path, 10_000, seed=3)


FULL_DISK = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from container_recordings import events_at, recording_of, times_us
from vid2ev.formats import format_named
recording, write = recording_of(events_at(times_us()["dense"]), 0), format_named(sys.argv[1]).write
write(Path(sys.argv[3]), recording)
for limit in (0, 1, 100, 5000, 100_000, 1_000_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        write(Path(sys.argv[3]), recording)
    except OSError as error:
        print(error.errno)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
@pytest.mark.parametrize("name", ["aedat4", "ros1", "ros2"])
def test_a_full_disk_is_an_error_and_not_a_crash(tmp_path: Path, name: str) -> None:
    command = [sys.executable, "-c", FULL_DISK, name, str(PROGRAM.parent), str(tmp_path / "full")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env={"PYTHONPATH": str(ROOT)})
    assert (done.returncode, done.stderr, done.stdout.split()) == (0, "", ["27"] * 6)  # EFBIG, as ENOSPC would be
    assert [path.name for path in tmp_path.iterdir()] == ["full"]  # and nothing beside it
