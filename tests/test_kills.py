"""Commands that are killed, or find the disk full, and go on to the same bytes: a short form of `examples/kills.py`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(sys.platform != "linux", reason="processes are forked, and killed, as on Linux"),
]


@pytest.mark.parametrize("commands", [["convert", "interpolate"], ["eval"]])
def test_what_is_killed_goes_on_to_the_same_bytes(commands: list[str]) -> None:
    asked = [word for name in commands for word in ("--command", name)]
    command = [sys.executable, ROOT / "examples" / "kills.py", "--kills", "5", *asked]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert all(f"| {name} | 5 |" in done.stdout for name in commands)
