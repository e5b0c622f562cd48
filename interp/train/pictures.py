"""Pictures to look at while a network learns: rows of what went in, what came out, and what is true."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import torch
from torch.nn import functional as F

from interp.representation.event_counts import EventCounts
from vid2ev.pictures.colours import MOST, event_colours, in_8_bits

GAP_PX = 2
LOUDER = 4  # how much errors are made larger
ROWS = 3


def rows(pictures: Iterable[Sequence[torch.Tensor]]) -> np.ndarray:
    """Rows of images [1 or 3, H, W], codes 0 ... 1, as one: R'G'B' uint8 [rows, columns, 3]."""
    return _joined([_joined([_codes(image) for image in row], axis=1) for row in pictures], axis=0)


def shown(count: int) -> list[int]:
    """The numbers of the images to show of many: the first, the last, one between."""
    return sorted({round(k * (count - 1) / (ROWS - 1)) for k in range(ROWS)})


def of_error(image: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """An image of an error, four times as large, around grey."""
    return 0.5 + LOUDER * (image - truth)


def of_events(events: EventCounts, time: float, like: torch.Tensor) -> torch.Tensor:
    """An image [3, H, W] of the events of a pair up to a time 0 ... 1, as large as a frame."""
    until = max(1, round(time * events.steps))
    off, on = events.off_on[0, :, :until].float().sum(1).round().clamp(0, MOST).long().cpu().numpy()
    coloured = torch.from_numpy(event_colours()[off, on]).float().permute(2, 0, 1)
    return F.interpolate(coloured[None], size=like.shape[-2:], mode="nearest")[0]


def encoded(rgb: np.ndarray) -> bytes:
    """A PNG file."""
    return cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))[1].tobytes()


def _codes(image: torch.Tensor) -> np.ndarray:
    rgb = image.detach().float().cpu().expand(3, -1, -1).permute(1, 2, 0).numpy()
    return in_8_bits(np.nan_to_num(rgb))


def _joined(parts: Sequence[np.ndarray], axis: int) -> np.ndarray:
    shape = list(parts[0].shape)
    shape[axis] = GAP_PX
    between = np.zeros(shape, np.uint8)
    return np.concatenate([piece for part in parts for piece in (between, part)][1:], axis)
