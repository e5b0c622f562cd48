"""A conversion whose still pixels sleep, killed and resumed, leaves the bytes of one that walks them all in one go."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path

import pytest
from killed import converted

pytestmark = pytest.mark.long

CLIP = "synthetic:moving-edge,size=640x32,fps=100,duration_s=0.12"
OPTIONS = {
    "overrides": ["shot_rate_hz=1"],  # (with more than three in a strip and interval none sleeps)
    "upsample": "none",
    "labels": True,
    "piece": 1 << 15,
    "threads": 1,
    "preview": False,
}


def run(directory: Path, killed_at: int = 0, **changed: object) -> int:
    return converted(CLIP, directory, OPTIONS | changed, killed_at).returncode


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_it_sleeps_on_after_a_kill_to_the_same_bytes(tmp_path: Path) -> None:
    walked, slept = tmp_path / "walked", tmp_path / "slept"
    assert run(walked, skip=False) == 0
    assert run(slept, killed_at=9) == -signal.SIGKILL
    assert run(slept, resume=True) == 0
    assert (walked / "events.h5").read_bytes() == (slept / "events.h5").read_bytes()
    manifests = [json.loads((directory / "manifest.json").read_text()) for directory in (walked, slept)]
    counts = [manifest.pop("run")["strips_slept"][""] for manifest in manifests]
    assert manifests[0] == manifests[1]
    assert counts[0][0] == 0 and counts[1][0] > 0.2 * counts[1][1] > 0
