"""Methods that need no training, where it is known what they give."""

from __future__ import annotations

import torch
from torch.nn import functional as F

from interp.representation.event_counts import EventCounts
from interp.train.baselines import METHODS, baseline

TIMES = torch.tensor([0.25, 0.5, 0.875])
NOTHING = EventCounts.none(1, (48, 48), steps=8)


def test_between_two_frames_that_are_alike_all_give_that_frame() -> None:
    frame = 0.05 + 0.9 * torch.rand(3, 48, 48)
    for method in METHODS:
        made = baseline(method, frame, frame, NOTHING, TIMES)
        # Through light and its log and back in float32: a hundredth of a code of 8 bits.
        torch.testing.assert_close(made, frame.expand(3, -1, -1, -1), atol=0.01 / 255, rtol=0, msg=method)


def test_nearest_and_linear_are_what_they_are_called() -> None:
    black, white = torch.zeros(3, 48, 48), torch.ones(3, 48, 48)
    assert baseline("nearest", black, white, NOTHING, TIMES).mean((1, 2, 3)).tolist() == [0, 0, 1]
    assert baseline("linear", black, white, NOTHING, TIMES).mean((1, 2, 3)).tolist() == TIMES.tolist()


def test_flow_carries_what_moves() -> None:
    texture = F.interpolate(torch.rand(1, 3, 16, 16), size=(80, 80), mode="bicubic")[0].clamp(0.1, 0.9)
    shifted = [texture[:, 8:56, 8 + k : 56 + k] for k in (0, 2, 4, 7, 8)]  # 8 px to the left
    made = baseline("flow", shifted[0], shifted[-1], NOTHING, TIMES)
    crossed = baseline("linear", shifted[0], shifted[-1], NOTHING, TIMES)
    inner = (slice(None), slice(None), slice(10, -10), slice(10, -10))
    truth = torch.stack(shifted[1:4])
    assert float((made - truth)[inner].pow(2).mean()) < 0.5 * float((crossed - truth)[inner].pow(2).mean())
