"""Flows between frames: dense optical flow (DIS) of their codes, and of HDR frames of their light up to white, for
losses that look at what flickers, and to learn from."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import torch
from torch.utils.data import Dataset

from interp.train.batches import Batch
from vid2ev.stream.frames import LUMINANCE


class WithFlows(Dataset[Batch]):
    """Sequences with flows between their true frames [K + 1, C, H, W].

    flows            [K, 2, H, W] px, from each frame but the first to the one before
    flows_to_first   [K, 2, H, W] px, from each to the first
    """

    def __init__(self, sequences: Dataset[Batch]):
        self.sequences = sequences

    def __getitem__(self, index: int) -> Batch:
        return with_flows(self.sequences[index])


class WithFlowBetween(Dataset[Batch]):
    """Samples for frame-fed networks with the flow between their key frames, [4, H, W] px: forth (x, y) and back."""

    def __init__(self, samples: Dataset[Batch]):
        self.samples = samples

    def __getitem__(self, index: int) -> Batch:
        return with_flow_between(self.samples[index])


def with_flow_between(sample: Batch) -> Batch:
    """A sample, and that flow."""
    first, last = _codes(sample["frames"])
    dis = _dis()
    return sample | {"flow": torch.cat([_flow(dis, first, last), _flow(dis, last, first)])}


def with_flows(sample: Batch) -> Batch:
    """A sequence, and its flows."""
    codes, dis = _codes(sample["truth"]), _dis()
    steps = [_flow(dis, later, before) for before, later in pairwise(codes)]
    far = [_flow(dis, later, codes[0]) for later in codes[1:]]
    return sample | {"flows": torch.stack(steps), "flows_to_first": torch.stack(far)}


def _codes(frames: torch.Tensor) -> np.ndarray:
    """Luma of frames [N, C, H, W] of codes, or luminance of those of light, uint8."""
    grey = np.tensordot(LUMINANCE, frames.expand(-1, 3, -1, -1).numpy(), (0, 1))
    return np.rint(255 * np.clip(grey, 0, 1)).astype(np.uint8)


def _dis() -> Any:
    return cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)  # type: ignore[attr-defined]


def _flow(dis: Any, here: np.ndarray, there: np.ndarray) -> torch.Tensor:
    """From each pixel of a frame to another frame, [2, H, W] px."""
    return torch.from_numpy(dis.calc(here, there, None)).permute(2, 0, 1)
