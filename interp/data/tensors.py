"""Clips as tensors, as networks take them."""

from __future__ import annotations

import numpy as np
import torch

from interp.data.clip import Clip
from interp.data.settings import ClipSettings
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts

Sample = dict[str, torch.Tensor]


def tensors(clip: Clip, settings: ClipSettings) -> Sample:
    """What all samples have of a clip."""
    counts = torch.from_numpy(np.array(clip.off_on, np.float16))
    if settings.rigs > 0 or settings.recordings > 0:  # (recordings, too, may differ in how coarse their events are)
        one = EventCounts(counts[None], torch.ones(1, 2))
        counts = over(one, (clip.truth.shape[1], clip.truth.shape[2])).off_on[0].half()
    return {
        "frames": as_tensor(clip.keys),
        "off_on": counts,
        "footprint": torch.tensor(clip.footprint),
        "contrast": torch.tensor(clip.contrast, dtype=torch.float32),
    }


def as_tensor(frames: np.ndarray) -> torch.Tensor:
    """Frames [N, H, W, C] as [N, C, H, W] float32: codes from 0 to 1, light as it is."""
    values = torch.from_numpy(np.array(np.moveaxis(frames, -1, 1), order="C")).float()
    return values.div_(255) if frames.dtype == np.uint8 else values
