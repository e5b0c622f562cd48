"""Flows between true frames, for losses that look at what flickers: dense optical flow (DIS) of their codes."""

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
    """Sequences with flows between their true frames [K + 1, 3, H, W].

    flows            [K, 2, H, W] px, from each frame but the first to the one before
    flows_to_first   [K, 2, H, W] px, from each to the first
    """

    def __init__(self, sequences: Dataset[Batch]):
        self.sequences = sequences

    def __getitem__(self, index: int) -> Batch:
        return with_flows(self.sequences[index])


def with_flows(sample: Batch) -> Batch:
    """A sequence, and its flows."""
    grey = np.tensordot(LUMINANCE, sample["truth"].numpy(), (0, 1))
    codes = np.rint(255 * np.clip(grey, 0, 1)).astype(np.uint8)
    dis = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)  # type: ignore[attr-defined]
    steps = [_flow(dis, later, before) for before, later in pairwise(codes)]
    far = [_flow(dis, later, codes[0]) for later in codes[1:]]
    return sample | {"flows": torch.stack(steps), "flows_to_first": torch.stack(far)}


def _flow(dis: Any, later: np.ndarray, before: np.ndarray) -> torch.Tensor:
    """From each pixel of the later frame to the earlier, [2, H, W] px."""
    return torch.from_numpy(dis.calc(later, before, None)).permute(2, 0, 1)
