"""A small clip: a texture that moves."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np


def texture(folder: Path, shift_px: float = 2.0, frames: int = 9) -> str:
    """The path of an array [N, 64, 96] of linear light that moves by `shift_px` from frame to frame."""
    wide = cv2.GaussianBlur(np.random.default_rng(3).random((64, 160)).astype(np.float32), (0, 0), 1.5)
    wide = (wide - wide.min()) / (wide.max() - wide.min())
    shifts = [np.array([[1, 0, -20 - shift_px * k], [0, 1, 0]], np.float32) for k in range(frames)]
    np.save(folder / "texture.npy", np.stack([cv2.warpAffine(wide, shift, (96, 64)) for shift in shifts]))
    return str(folder / "texture.npy")
