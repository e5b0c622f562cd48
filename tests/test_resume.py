"""A conversion killed at any instant goes on with --resume to the very same bytes.

`RUN` is a program that converts and is killed, as by `kill -9`, at the n-th thing it does that lasts: a frame done, a
file brought to the disk, renamed or removed.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from forked import forks_of

from vid2ev.recording.destination import partial_of

CLIP = "synthetic:moving-edge,size=48x32,fps=100,duration_s=0.16"
RUN = """
import json, os, shutil, signal, sys
from pathlib import Path
from vid2ev import convert

steps, last = 0, int(sys.argv[1])

def counted(function):
    def count(*arguments, **options):
        global steps
        steps += 1
        if steps == last:
            os.kill(os.getpid(), signal.SIGKILL)
        return function(*arguments, **options)
    return count

os.fsync, shutil.rmtree = counted(os.fsync), counted(shutil.rmtree)
for name in ("rename", "replace", "unlink"):
    setattr(Path, name, counted(getattr(Path, name)))
clip, directory, options = sys.argv[2], sys.argv[3], json.loads(sys.argv[4])
convert(clip, directory, report=counted(lambda *_: None), **options)
print(steps)
"""
OPTIONS = {
    "overrides": ["shot_rate_hz=20", "hot_probability=0.01", "frame_rate_hz=900"],
    "upsample": "linear",
    "subframes": 2,
    "labels": True,
    "piece": 3 << 18,
    "threads": 1,
    "probe": ["20,16"],
    "formats": ["hdf5", "evt3"],
    "frames": "npz",
}

WARM = f"""
import tempfile
from vid2ev import convert
with tempfile.TemporaryDirectory() as folder:
    convert({CLIP!r}, folder + "/out", **{OPTIONS!r})
"""

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")]


def run(directory: Path, killed_at: int = 0, **changed: object) -> subprocess.CompletedProcess[str]:
    return forks_of(WARM).run(RUN, str(killed_at), CLIP, str(directory), json.dumps(OPTIONS | changed))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A recording made in one go, and how many steps it took."""
    directory = tmp_path_factory.mktemp("resume") / "whole"
    done = run(directory)
    assert done.returncode == 0, done.stderr
    return directory, int(done.stdout)


FILES = {"events.h5", "events.raw", "preview.mp4", "probe.csv", "probe.png", "frames.npz"}


def assert_same(one: Path, other: Path) -> None:
    for name in FILES:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    manifests = [json.loads((directory / "manifest.json").read_text()) for directory in (one, other)]
    for manifest in manifests:
        del manifest["run"]
    assert manifests[0] == manifests[1]


def kill_and_resume(whole: Path, out: Path, killed_at: int) -> None:
    """Kill at a step, look at what is left, go on, compare."""
    killed = run(out, killed_at)
    assert killed.returncode == -signal.SIGKILL, (killed_at, killed.stdout, killed.stderr)
    assert not out.exists() or {path.name for path in out.iterdir()} == FILES | {"manifest.json"}
    done = run(out, resume=True)
    assert done.returncode == 0, done.stderr
    assert_same(whole, out)
    assert not partial_of(out).exists()


def test_killed_here_and_there_it_goes_on_to_the_same_bytes(whole: tuple[Path, int], tmp_path: Path) -> None:
    directory, steps = whole
    among = random.Random(0).sample(range(2, steps - 12), 3)  # somewhere on the way, and where the files come together
    for killed_at in (*among, steps - 7, steps - 3, steps - 1, steps):
        kill_and_resume(directory, tmp_path / f"killed_{killed_at}", killed_at)


@pytest.mark.slow
def test_killed_anywhere_it_goes_on_to_the_same_bytes(whole: tuple[Path, int], tmp_path: Path) -> None:
    directory, steps = whole
    for killed_at in range(1, steps + 1):
        kill_and_resume(directory, tmp_path / f"killed_{killed_at}", killed_at)


def test_killed_again_and_again_it_ends_with_the_same_bytes(whole: tuple[Path, int], tmp_path: Path) -> None:
    directory, steps = whole
    for _ in range(steps // 4):
        # (late enough for a checkpoint, or for all that is done after the last one)
        done = run(tmp_path / "out", killed_at=24, resume=True)
        if done.returncode == 0:
            break
        assert done.returncode == -signal.SIGKILL, done.stderr
    assert done.returncode == 0
    assert_same(directory, tmp_path / "out")


def test_killed_while_it_replaces_a_recording(whole: tuple[Path, int], tmp_path: Path) -> None:
    directory, steps = whole
    assert run(tmp_path / "out", seed=9).returncode == 0
    old = (tmp_path / "out" / "events.h5").read_bytes()
    for killed_at in (steps // 2, steps - 3, steps - 1):
        assert run(tmp_path / "out", killed_at, overwrite=True).returncode == -signal.SIGKILL
        if (tmp_path / "out").exists():
            content = (tmp_path / "out" / "events.h5").read_bytes()
            assert content in (old, (directory / "events.h5").read_bytes())
    assert run(tmp_path / "out", resume=True).returncode == 0
    assert_same(directory, tmp_path / "out")


def test_other_settings_are_not_mixed_in(tmp_path: Path) -> None:
    assert run(tmp_path / "out", killed_at=30).returncode == -signal.SIGKILL
    kept = partial_of(tmp_path / "out") / "checkpoint.npz"
    before = kept.read_bytes()
    for changed in ({"seed": 1}, {"overrides": []}, {"subframes": 3}, {"preview": False}):
        done = run(tmp_path / "out", resume=True, **changed)
        assert done.returncode == 1 and "was begun with" in done.stderr
    assert kept.read_bytes() == before


RIG = """
[[camera]]
name = "left"
kind = "dvs"
[[camera]]
name = "right"
kind = "dvs"
translation_mm = [30, 0, 0]
size = [40, 30]
[[camera]]
name = "aps"
kind = "cis"
set = { frame_rate_hz = 90, exposure_us = 15000, line_us = 50 }
"""


def test_a_rig_killed_here_and_there_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    rig = {"rig": str(tmp_path / "rig.toml"), "depth": "plane:1", "truth": "depth,poses", "truth_rate_hz": 50}
    rig |= {
        "probe": [],
        "labels": False,
        "formats": ["evt3"],
        "pictures": ["raw", "png", "mp4"],
        "frames": None,
        "piece": 9 << 18,
    }
    done = run(tmp_path / "whole", **rig)
    assert done.returncode == 0, done.stderr
    steps = int(done.stdout)
    files = {path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*") if path.is_file()}
    assert {str(path.parent) for path in files} == {".", *("left", "right", "aps", "aps/raw", "aps/frames")} | {
        f"{camera}/truth{part}" for camera in ("left", "right", "aps") for part in ("", "/depth")
    }
    for killed_at in (*random.Random(1).sample(range(2, steps - 12), 3), steps - 5, steps - 1):
        out = tmp_path / f"killed_{killed_at}"
        assert run(out, killed_at, **rig).returncode == -signal.SIGKILL
        done = run(out, resume=True, **rig)
        assert done.returncode == 0, done.stderr
        assert {path.relative_to(out) for path in out.rglob("*") if path.is_file()} == files
        for path in files:
            if path.name != "manifest.json":
                assert (out / path).read_bytes() == (tmp_path / "whole" / path).read_bytes(), (killed_at, path)


@pytest.mark.slow
def test_killed_by_the_clock_it_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    video = Path(__file__).parents[1] / ".." / "shared" / "data" / "videos" / "nasa_13013.mp4"
    if not video.exists():
        pytest.skip("../shared/data is not here")
    program = f"from vid2ev import convert; convert({str(video)!r}, %r, max_subframes=4, piece=1 << 22, resume=True)"
    began = time.monotonic()
    subprocess.run([sys.executable, "-c", program % str(tmp_path / "whole")], check=True)
    seconds = time.monotonic() - began
    clock = random.Random(1)
    kills = 0
    while kills < 100:
        child = subprocess.Popen([sys.executable, "-c", program % str(tmp_path / "out")])
        time.sleep(clock.uniform(0.2, 0.8) * seconds)
        if child.poll() is not None:
            break
        child.kill()
        child.wait()
        kills += 1
    assert child.returncode == 0 and kills
    assert_same(tmp_path / "whole", tmp_path / "out")
