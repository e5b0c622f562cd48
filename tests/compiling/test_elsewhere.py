"""What another process compiles comes back, or is compiled here: with the same events, and nobody left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SEEN = """
import json, sys
import numpy as np
from vid2ev import Dvs, load_sensor
from vid2ev.compiling import elsewhere
from vid2ev.kernels.cpu import walk_tile

elsewhere.sys.executable = sys.argv[2] or None
dvs = Dvs(load_sensor("ideal", ["threshold_on=0.2"]), (4096, 2), threads=int(sys.argv[1]))
light = np.full((2, 4096), 0.1, np.float32)
events = [dvs.step(light * (1 + k), 1_000_000 * k) for k in range(3)]
stats = walk_tile.stats
print(json.dumps({
    "here": sum(stats.cache_misses.values()), "events": [len(e) for e in events], "begun": len(elsewhere._begun),
}))
"""


def seen(cache: Path, threads: int, python: str = sys.executable) -> dict:
    """What a program comes to that keeps what it compiles in a folder, and how often it compiled the walk itself."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    ended = subprocess.run(
        [sys.executable, "-W", "error", "-c", SEEN, str(threads), python],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert not ended.stderr  # (nothing is left open, which would be said there)
    return json.loads(ended.stdout)


@pytest.mark.long
def test_the_walk_is_compiled_by_another_process_where_there_are_threads_for_it(tmp_path: Path) -> None:
    apart = seen(tmp_path / "a", threads=2)
    assert (apart["here"], apart["begun"]) == (0, 0)
    assert seen(tmp_path / "a", threads=2) == apart  # (now it is on disk)
    alone = seen(tmp_path / "b", threads=1)
    assert alone == apart | {"here": 1}
    failing = seen(tmp_path / "c", threads=2, python="/bin/false")
    assert failing == alone
    assert seen(tmp_path / "d", threads=2, python="/no/such/python") == alone
    assert seen(tmp_path / "e", threads=2, python="") == alone


@pytest.mark.long
def test_the_other_process_ends_with_this_one(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    program = subprocess.Popen(
        [sys.executable, "-c", SEEN, "2", sys.executable], env=environment, stdout=subprocess.DEVNULL
    )
    children = Path(f"/proc/{program.pid}/task/{program.pid}/children")
    if not children.exists():
        program.kill()
        pytest.skip("this system does not tell which processes a process has begun")
    while not (others := [pid for pid in children.read_text().split() if compiles(pid)]):
        time.sleep(0.05)
    program.send_signal(signal.SIGKILL)
    program.wait()
    until = time.monotonic() + 60
    while any(compiles(pid) for pid in others) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(compiles(pid) for pid in others)


def compiles(pid: str) -> bool:
    """Whether a process compiles for another one."""
    try:
        return b"compiling.elsewhere" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
