"""Small footage to be scored, on disk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from interp.data.layouts.ergb import LAYOUTS
from vid2ev.recording.exposures import write_codes

SIZE = (40, 24)
STEP_US = 4_000


def pictures(count: int, seed: int = 0, top: int = 256) -> np.ndarray:
    """Pictures in which a square moves over a texture, uint8 [count, H, W, 3]."""
    draw = np.random.default_rng(seed)
    made = np.repeat(draw.integers(top // 4, top // 2, (1, *SIZE[::-1], 3)), count, axis=0).astype(np.uint8)
    for k in range(count):
        made[k, 6:14, 2 + k % 28 : 10 + k % 28] = top - 1 - k % 7
    return made


def write_hsergb(folder: Path, frames: np.ndarray, times_us: Sequence[int] | None = None, last_events: int = 0) -> None:
    """A sequence in the HS-ERGB layout, with 50 events between two frames; none in the last `last_events` gaps."""
    names, draw = LAYOUTS["hsergb"], np.random.default_rng(1)
    times = times_us or [STEP_US * (k + 1) for k in range(len(frames))]
    (folder / names.images).mkdir(parents=True)
    (folder / names.events).mkdir()
    for k, frame in enumerate(frames):
        write_codes(folder / names.images / f"{k:06d}.png", frame)
    (folder / names.images / "timestamp.txt").write_text("".join(f"{t}.0\n" for t in times))
    for k in range(1, len(frames) - last_events):
        t = np.sort(draw.integers(times[k - 1] + 1, max(times[k], times[k - 1] + 1) + 1, 50))
        x, y = ((32 * draw.integers(0, side, 50)).astype(np.uint16) for side in SIZE)
        columns = dict(zip(names.columns, [x, y, t, draw.integers(0, 2, 50)], strict=True))
        np.savez(folder / names.events / f"{k:06d}.npz", **columns)


def write_predictions(folder: Path, frames: np.ndarray) -> None:
    """Pictures as a method leaves them."""
    folder.mkdir(parents=True)
    for k, frame in enumerate(frames):
        write_codes(folder / f"frame{k}.png", frame)


def write_film(path: Path, frames: np.ndarray, fps: float = 250.0) -> None:
    """A film, as an array with a rate."""
    path.parent.mkdir(exist_ok=True)
    np.savez(path, frames=(frames / 255.0).astype(np.float32), fps=fps)
