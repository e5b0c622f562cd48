"""Small takes: a texture that moves, as a folder of images, and as a recording with the events of its motion."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from interp.data.layouts.ergb import LAYOUTS
from vid2ev.recording.exposures import write_codes

SIZE = (64, 48)
STEP_US = 33_333


def texture(seed: int = 0, width: int = 160) -> np.ndarray:
    draw = np.random.default_rng(seed).random((SIZE[1] // 4, width // 4, 3))
    return np.rint(40 + 180 * cv2.resize(draw, (width, SIZE[1]), interpolation=cv2.INTER_CUBIC).clip(0, 1)).astype(
        np.uint8
    )


def moving(count: int = 4, pixels: int = 3, seed: int = 0) -> list[np.ndarray]:
    """Frames [48, 64, 3] of a texture that moves to the left."""
    whole = texture(seed)
    return [whole[:, pixels * k : pixels * k + SIZE[0]].copy() for k in range(count)]


def strange() -> list[np.ndarray]:
    """Four frames of which none has anything in common with the next one."""
    blocks = np.random.default_rng(1).integers(0, 256, (10, 8, 11, 1, 1, 3), np.int64)[4:8]
    whole = np.broadcast_to(blocks, (4, 8, 11, 6, 6, 3)).swapaxes(2, 3).reshape(4, 48, 66, 3)
    return [*whole[:, :, : SIZE[0]].astype(np.uint8)]


def images(folder: Path, frames: list[np.ndarray], step_us: int = STEP_US, start_us: int = 0) -> Path:
    folder.mkdir(parents=True)
    for k, frame in enumerate(frames):
        write_codes(folder / f"{k:06d}.png", frame)
    times = "".join(f"{start_us + step_us * k}\n" for k in range(len(frames)))
    (folder / "timestamps.txt").write_text("# us\n" + times)
    return folder


def recording(
    folder: Path, frames: list[np.ndarray], events: int = 400, step_us: int = STEP_US, until: int | None = None
) -> Path:
    """In the layout HS-ERGB; of each gap so many events at random, but for those from gap `until` on."""
    names = LAYOUTS["hsergb"]
    (folder / names.images).mkdir(parents=True)
    (folder / names.events).mkdir()
    for k, frame in enumerate(frames):
        write_codes(folder / names.images / f"{k:06d}.png", frame)
    (folder / names.images / "timestamp.txt").write_text("".join(f"{step_us * k}\n" for k in range(len(frames))))
    for k in range(len(frames) - 1 if until is None else until):
        draw = np.random.default_rng(k)
        t = np.sort(draw.integers(step_us * k + 1, step_us * (k + 1) + 1, events))
        t[-1:] = step_us * (k + 1)
        x, y = (draw.integers(0, side, events).astype(np.float32) for side in SIZE)
        columns = dict(zip(names.columns, [x, y, t, draw.integers(0, 2, events)], strict=True))
        np.savez(folder / names.events / f"{k:06d}.npz", **columns)
    return folder


def times_of(folder: Path) -> list[int]:
    return [int(line) for line in (folder / "timestamps.txt").read_text().splitlines()[1:]]
