"""Pairs of frames, and events between them, that are easy to foresee."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import torch

from interp.networks import NETWORKS
from interp.networks.frame_fed import FrameFed
from interp.representation.event_counts import EventCounts
from vid2ev import Events

FRAME_FED = tuple(
    name
    for name, entry in NETWORKS.items()
    if issubclass(getattr(import_module(f"interp.networks.{entry.module}"), entry.network), FrameFed)
)


def frames(batch: int = 1, size: tuple[int, int] = (32, 32), colours: int = 3) -> tuple[torch.Tensor, torch.Tensor]:
    """Two frames of smooth light that moves by a pixel and a half."""
    y, x = torch.meshgrid(torch.arange(size[0]), torch.arange(size[1]), indexing="ij")
    phases = torch.rand(batch, colours, 1, 1)
    waves = [0.5 + 0.3 * torch.sin(0.5 * (x + shift) + 0.3 * y + 6 * phases) for shift in (0.0, 1.5)]
    return waves[0], waves[1]


def counts(
    batch: int = 1, size: tuple[int, int] = (32, 32), steps: int = 16, rate: float = 0.1, seed: int = 0
) -> EventCounts:
    """Events here and there."""
    generator = torch.Generator().manual_seed(seed)
    off_on = torch.poisson(torch.full((batch, 2, steps, *size), rate), generator).to(torch.uint8)
    return EventCounts(off_on, torch.full((batch, 2), 0.15))


def events(t: np.ndarray, size: tuple[int, int], seed: int = 0) -> Events:
    """Events at these times [us], anywhere on a sensor (width, height)."""
    random = np.random.default_rng(seed)
    x, y = (random.integers(0, side, len(t)).astype(np.uint16) for side in size)
    return Events(np.sort(t).astype(np.int64), x, y, random.integers(0, 2, len(t)).astype(np.uint8))
