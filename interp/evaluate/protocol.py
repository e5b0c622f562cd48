"""Which frames are rebuilt, when, and how they are compared: the protocol of Time Lens.

    frame i is a key frame        i mod (skip + 1) = 0            key frames are not scored
    PSNR, SSIM                    against the range of the truth of that frame, R = max - min over all channels
    SSIM                          Gaussian window of sigma 1.5 px, variances of a sample, border of 5 px left out
    pictures                      8 bits, all channels together

What differs from the scripts of the field, and why:

* R is a float.  There it is an 8-bit number, whose square overflows in NumPy 2: 255 squared is 1, and PSNR 48 dB less.
* Rebuilt codes are rounded to 8 bits; the field truncates them, half a code darker (`rounding="truncate"`).
* A frame is rebuilt at its own time; the field's networks get even times whatever the stamps say (`times="even"`).
* Frames after the last complete group are not rebuilt, as there is no key frame behind them.  They are counted.
* Where the truth is of one code, R is 0 and nothing is defined: NaN.  A frame without an error has 100 dB.

Sources: S. Tulyakov et al., "Time Lens", CVPR 2021, and rpg_event_based_frame_interpolation_evaluation, its script.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import torch

from vid2ev.errors import UsageError
from vid2ev.requests import is_whole

Times = Literal["frames", "even"]
Rounding = Literal["round", "truncate"]
LEAST_STEPS = 32  # sub-intervals that events of a gap are counted in
WHOLE = 1e-3  # codes: what is as near to a whole one is that, but for rounding of float32


@dataclass(frozen=True)
class Protocol:
    """How is evaluated.

    skip       frames between two key frames
    insert     frames rebuilt between them; where they are not as many as were skipped, at even times, and those are
               scored at whose place a frame was
    times      "frames": the frames' own times; "even": between those of the key frames
    rounding   of codes to 8 bits: "round" to the nearest, or "truncate"
    Raises UsageError for what is none of these, and where no rebuilt frame would be scored.
    """

    skip: int = 7
    insert: int = 7
    times: Times = "frames"
    rounding: Rounding = "round"

    def __post_init__(self) -> None:
        if not (is_whole(self.skip, 1) and is_whole(self.insert, 1)):
            raise UsageError(f"skip {self.skip!r}, insert {self.insert!r}: expected at least 1 of each")
        for name, value, known in (("times", self.times, Times), ("rounding", self.rounding, Rounding)):
            if value not in get_args(known):
                raise UsageError(f"{name} {value!r}: expected {' or '.join(get_args(known))}")
        if not self.positions:
            raise UsageError(
                f"insert {self.insert} with skip {self.skip}: none of the frames made is where one was skipped; insert"
                f" {self.skip}, or one less than a divisor or multiple of {self.multiple}"
            )

    @property
    def multiple(self) -> int:
        """Frames per key frame."""
        return self.skip + 1

    @property
    def steps(self) -> int:
        """Sub-intervals that events are counted in: as many for each frame."""
        return self.multiple * -(-LEAST_STEPS // self.multiple)

    @property
    def positions(self) -> tuple[int, ...]:
        """Places of the scored frames among those skipped, from 1."""
        return tuple(k for k in range(1, self.multiple) if k * (self.insert + 1) % self.multiple == 0)

    @property
    def picked(self) -> list[int]:
        """Which of the rebuilt frames are those at `positions`."""
        return [k * (self.insert + 1) // self.multiple - 1 for k in self.positions]

    @property
    def own_times(self) -> bool:
        """Whether frames are rebuilt at the times of those that were skipped."""
        return self.times == "frames" and self.insert == self.skip

    def targets(self, times_us: np.ndarray) -> np.ndarray:
        """Times [insert] of the frames to rebuild, 0 ... 1 of the gap, of the times [skip + 2] of its frames, key
        frames included."""
        if self.own_times:
            return (times_us[1:-1] - times_us[0]) / (times_us[-1] - times_us[0])
        return np.linspace(0, 1, self.insert + 2)[1:-1]

    def coded(self, images: torch.Tensor) -> np.ndarray:
        """Images [N, C, H, W] as codes of 8 bits, uint8 [N, H, W, C]."""
        codes = images.float().clamp(0, 1) * 255
        codes = codes.round() if self.rounding == "round" else (codes + WHOLE).floor()
        return codes.to(torch.uint8).movedim(1, -1).contiguous().cpu().numpy()


def range_of(true: np.ndarray) -> float:
    """R of a true picture, in codes."""
    return float(true.max()) - float(true.min())
