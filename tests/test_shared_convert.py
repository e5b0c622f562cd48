"""Many videos shared out: the same bytes by one worker and by two, in one process, and after a kill."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from vid2ev.commands import main
from vid2ev.commands.live import Live
from vid2ev.sources import many

QUICK = ["--upsample", "none", "--fps", "100"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """clips/: four arrays and a broken video; list.txt, which names them; by_one/: their recordings, one by one."""
    folder = tmp_path_factory.mktemp("shared")
    (folder / "clips").mkdir()
    rng = np.random.default_rng(0)
    for k in range(4):
        np.save(folder / f"clips/c{k}.npy", rng.uniform(0.1, 1, (12, 24, 32)).astype(np.float32))
    (folder / "clips/broken.mp4").write_bytes(rng.bytes(5000))
    lines = ["# four, one of which is broken", "", "clips/c0.npy", "clips/c1.npy", "clips/broken.mp4", "clips/c2.npy"]
    (folder / "list.txt").write_text("\n".join(lines) + "\n")
    before = Path.cwd()
    os.chdir(folder)
    assert vid2ev("clips", "-o", "by_one").exit_code == 1
    os.chdir(before)
    return folder


@pytest.fixture(autouse=True)
def within(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)


def vid2ev(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["convert", *arguments, *QUICK])


def same_bytes(directory: str, names: list[str]) -> bool:
    files = [f"{name}_events/{file}" for name in names for file in ("events.h5", "preview.mp4")]
    return all(Path(directory, file).read_bytes() == Path("by_one", file).read_bytes() for file in files)


def test_a_list_stands_for_its_lines() -> None:
    assert many.sources_in("list.txt") == ["clips/c0.npy", "clips/c1.npy", "clips/broken.mp4", "clips/c2.npy"]
    Path("folders.txt").write_text("clips\n")
    assert many.sources_in("folders.txt") == many.sources_in("clips")
    Path("empty.txt").write_text("# nothing\n")
    Path("nested.txt").write_text("list.txt\n")
    for name, sentence in (("empty.txt", "names no videos"), ("nested.txt", "a list within a list")):
        result = vid2ev(name)
        assert result.exit_code == 2 and sentence in result.stderr
    Path("events.txt").write_text("32 24\n0.000001 3 4 1\n0.000002 3 5 0\n")
    assert many.sources_in("events.txt") == ["events.txt"]  # (which is refused in words)


def test_two_workers_make_the_bytes_of_none_and_a_restart_goes_on() -> None:
    result = vid2ev("list.txt", "-o", "by_two", "--jobs", "2", "--retries", "1")
    assert result.exit_code == 1, result.output
    assert same_bytes("by_two", ["c0", "c1", "c2"]) and result.stdout.splitlines()[-1] == "3 of 4 done, 1 failed"
    assert result.stderr.count("error: clips/broken.mp4: not a video") == 1
    before = {path: path.stat().st_mtime_ns for path in Path("by_two").rglob("events.h5")}
    result = vid2ev("clips", "-o", "by_two", "--jobs", "2", "--retries", "0", "--resume", "--json")
    found = json.loads(result.stdout)
    assert result.exit_code == 1 and [each["state"] for each in found] == ["failed", *["done"] * 4]
    assert all(path.stat().st_mtime_ns == when for path, when in before.items())
    assert same_bytes("by_two", ["c0", "c1", "c2", "c3"])
    manifests = [json.loads(Path(of, "c3_events/manifest.json").read_text()) for of in ("by_one", "by_two")]
    assert [manifest.pop("run")["threads"] for manifest in manifests][1] >= 1 and manifests[0] == manifests[1]


@pytest.mark.slow
def test_a_program_that_is_killed_leaves_what_the_next_one_finishes() -> None:
    arguments = ["convert", "clips", "-o", "killed", "--jobs", "2", *QUICK]
    child = subprocess.Popen([sys.executable, "-m", "vid2ev", *arguments], stderr=subprocess.DEVNULL)
    while not list(Path().glob("killed/*_events")) and child.poll() is None:
        time.sleep(0.05)
    child.send_signal(signal.SIGKILL)
    child.wait()
    while list(Path("killed").glob("*.partial/lock")) and _held(Path("killed")):
        time.sleep(0.1)
    assert vid2ev("clips", "-o", "killed", "--jobs", "2", "--resume").exit_code == 1
    assert same_bytes("killed", ["c0", "c1", "c2", "c3"])


@pytest.mark.slow
def test_control_c_ends_it_with_130_and_one_line() -> None:
    arguments = ["convert", "synthetic:moving-edge,size=64x48,fps=100,duration_s=1000", "clips", "-o", "stopped"]
    child = subprocess.Popen(
        [sys.executable, "-m", "vid2ev", *arguments, "--jobs", "2", "-q", *QUICK],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while not list(Path().glob("stopped/*_events")) and child.poll() is None:
        time.sleep(0.05)
    os.killpg(child.pid, signal.SIGINT)  # (as a terminal does: the workers hear it, too)
    _, said = child.communicate()
    lines = [line for line in said.splitlines() if "broken.mp4" not in line]
    assert child.returncode == 130 and len(lines) == 1 and lines[0].startswith("interrupted"), said


@pytest.mark.slow
@pytest.mark.parametrize("asks", [signal.SIGINT, signal.SIGTERM])
def test_who_asks_all_processes_to_end_as_they_begin_is_told_in_one_line(asks: signal.Signals) -> None:
    arguments = ["convert", "clips", "-o", "begun", "--jobs", "2", "-q", *QUICK]
    child = subprocess.Popen(
        [sys.executable, "-m", "vid2ev", *arguments],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while not _begins(child.pid) and child.poll() is None:
        time.sleep(0.01)
    os.killpg(child.pid, asks)
    _, said = child.communicate()
    lines = [line for line in said.splitlines() if "broken.mp4" not in line]
    assert child.returncode == 130 and len(lines) == 1 and lines[0].startswith("interrupted"), said


def _begins(number: int) -> bool:
    """Whether a process that is to share the work of a program is about to: it imports what it needs."""
    psutil = pytest.importorskip("psutil")
    begun = [each for each in psutil.Process(number).children() if "spawn_main" in " ".join(each.cmdline())]
    return any(each.memory_info().rss > 20 << 20 for each in begun)


def _held(folder: Path) -> bool:
    """Whether a process still writes one of the recordings."""
    import fcntl

    for path in folder.glob("*.partial/lock"):
        with open(path) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
    return False


def test_what_cannot_be_shared_out_is_refused() -> None:
    for arguments, sentence in (
        (["-", "camera:0", "--jobs", "2", "-o", "out"], "- passes once"),
        (["list.txt", "--scheduler", "tcp://127.0.0.1:1", "--jobs", "2"], "leave one of them out"),
        (["list.txt", "--scheduler", "here"], "expected an address"),
    ):
        result = vid2ev(*arguments, "--retries", "0")
        assert result.exit_code == 2 and sentence in result.stderr, result.output


def test_the_line_counts_what_is_done_fails_and_runs(capsys: pytest.CaptureFixture[str]) -> None:
    live = Live(3, "clips", quiet=False)
    live.watch("a", {"begun": True})
    live.watch("a", {"share": 0.5, "events": 1000})
    live.watch("b", {"begun": True})
    assert live.text.startswith("0/3 clips, 2 running, 1,000 events, 0/s")  # (what was there before is no speed)
    live.watch("b", {"compiling": True})
    assert live.text.startswith("0/3 clips, 2 running, 1 compiling kernels, once, 1,000 events")
    live.end("b", True, None, "b: broken")
    assert live.text.startswith("0/3 clips, 1 failed, 1 running, 1,000 events")
    live.end("a", False, 5000, "a: 5,000 events")
    assert live.text.startswith("1/3 clips, 1 failed, 0 running, 5,000 events") and not live.text.endswith(" 0/s")
    live.close()
    assert capsys.readouterr() == ("[2/3] a: 5,000 events\n", "[1/3] b: broken\n")
