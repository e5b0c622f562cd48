"""Whatever a file holds, reading it ends in a valid result or in one sentence: a short form of `examples/fuzz.py`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SLOW = {"saved-recording": 4, "saved-frames": 4, "recordings": 4, "weights": 15, "meshes": 15, "scene": 15}
SOME = 30  # of the others

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(sys.platform != "linux", reason="limits of memory and time are set as on Linux"),
]


def names() -> list[str]:
    said = subprocess.run([sys.executable, EXAMPLES / "fuzz.py", "--list"], capture_output=True, text=True, check=True)
    return said.stdout.split()


def survive(readers: list[str], count: int, folder: Path) -> None:
    environment = os.environ | {"PYTHONPATH": f"{EXAMPLES}{os.pathsep}{EXAMPLES.parent}"}
    command = [sys.executable, "-m", "hostile.attempts", ",".join(readers), str(folder), "0", str(count)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr[-3000:]
    for reader in readers:
        tally = json.loads((folder / reader / "tally.json").read_text())["tally"]
        traces = [path.read_text()[-1500:] for path in (folder / reader).glob("offending/*.txt")]
        assert set(tally) <= {"read", "refused"} and sum(tally.values()) == count, f"{reader}: {traces[:3]}"


def test_some_damaged_files_of_every_kind(tmp_path: Path) -> None:
    readers = names()
    assert set(SLOW) < set(readers) and len(readers) > 25
    survive([name for name in readers if name not in SLOW], SOME, tmp_path)


@pytest.mark.parametrize("count", set(SLOW.values()))
def test_a_few_damaged_files_that_take_longer(count: int, tmp_path: Path) -> None:
    survive([name for name, few in SLOW.items() if few == count], count, tmp_path)


def test_changes_depend_on_their_number_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    from hostile.mutate import mutated

    contents = [b"key = 3\n" * 9, bytes(range(256)), b"\x89PNG\r\n\x1a\n" + bytes(60)]
    for content in contents:
        made = [[mutated(content, np.random.default_rng(k), contents) for k in range(50)] for _ in range(2)]
        assert made[0] == made[1] and len(set(made[0])) > 25 and content not in made[0]
