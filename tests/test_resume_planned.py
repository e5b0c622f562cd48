"""A conversion that plans while it records, killed and resumed, leaves the bytes of one that is made in one go."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from killed import converted

pytestmark = pytest.mark.long

SIZE = (40, 30)
FEW_HELD = f"from vid2ev.plan import planner; planner.HELD = {10 * SIZE[0] * SIZE[1] * 4}\n"
OPTIONS = {
    "overrides": ["random_phase=true", "mismatch=0", "crossing_noise=0", "refractory_us=0"],
    "upsample": "none",
    "cuts": "keep",
    "fps": 200,
    "effects": "auto",
    "piece": 1,
    "threads": 1,
    "preview": False,
}


def run(clip: Path, directory: Path, killed_at: int = 0, **changed: object) -> subprocess.CompletedProcess[str]:
    return converted(clip, directory, OPTIONS | changed, killed_at, FEW_HELD)


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """Light that rises without a bend for a while, and then trembles."""
    draws = np.random.default_rng(3)
    ramp = 0.2 + 0.01 * np.arange(30)[:, None, None] * np.ones((1, *SIZE[::-1]))
    wild = ramp[-1] * np.exp(draws.normal(0, 0.3, (40, *SIZE[::-1])))
    np.save(tmp_path / "clip.npy", np.concatenate([ramp, wild]).astype(np.float32))
    return tmp_path / "clip.npy"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
@pytest.mark.parametrize(("tolerance", "reports", "killed_at"), [(0.01, 38 + 69, (7, 25, 60, 101)), (0.8, 69, (50,))])
def test_it_plans_on_after_a_kill_to_the_same_bytes(
    clip: Path, tmp_path: Path, tolerance: float, reports: int, killed_at: tuple[int, ...]
) -> None:
    """Killed before the plans change, and after; and where they never do."""
    whole = run(clip, tmp_path / "whole", tolerance=tolerance)
    assert whole.returncode == 0 and int(whole.stdout) == reports, whole.stderr
    for at in killed_at:
        out = tmp_path / f"killed_{at}"
        assert run(clip, out, at, tolerance=tolerance).returncode == -signal.SIGKILL
        done = run(clip, out, resume=True, tolerance=tolerance)
        assert done.returncode == 0 and int(done.stdout) <= reports - at + 2, done.stderr
        assert (out / "events.h5").read_bytes() == (tmp_path / "whole" / "events.h5").read_bytes()
        manifests = [json.loads((folder / "manifest.json").read_text()) for folder in (out, tmp_path / "whole")]
        for manifest in manifests:
            del manifest["run"]
        assert manifests[0] == manifests[1]
