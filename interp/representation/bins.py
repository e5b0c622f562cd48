"""How much of each sub-interval between two frames lies in each bin of a window.

A voxel grid of B bins shares each event between the two bins around it (`vid2ev.views.voxel`).  Of events that are
only known by the sub-interval they lie in, 1/S of the time between two frames, the mean is taken over that
sub-interval:

    w(b, s) = S int_s max(0, 1 - |tau(u) - b|) du        tau(u) = (B - 1) (u - start) / (stop - start)

over the part of s in the window.  The weights of a sub-interval add up to its share that lies in the window, so that no
event is lost or counted twice whatever the window.
"""

from __future__ import annotations

import torch


def bin_weights(start: torch.Tensor, stop: torch.Tensor, bins: int, steps: int) -> torch.Tensor:
    """Weights [..., bins, steps] float32 of sub-intervals in bins of windows [...] in 0 ... 1 of the time between
    frames.

    Where a window is empty they are 0; with one bin all is in it.
    """
    start, stop = start.double()[..., None], stop.double()[..., None]
    edges = torch.arange(steps + 1, dtype=torch.float64, device=start.device) / steps
    within = torch.minimum(torch.maximum(edges, start), stop)
    if bins == 1:
        return (steps * within.diff()).unsqueeze(-2).float()
    length = (stop - start).clamp(min=0)
    per_bin = length / (bins - 1)
    tau = torch.where(length > 0, (within - start) / torch.where(length > 0, per_bin, 1), 0)
    centres = torch.arange(bins, dtype=torch.float64, device=start.device)[:, None]
    return (steps * per_bin.unsqueeze(-1) * _below(tau.unsqueeze(-2) - centres).diff()).float()


def _below(z: torch.Tensor) -> torch.Tensor:
    """The area of a triangle of height 1 over -1 ... 1 that lies before z."""
    z = z.clamp(-1, 1)
    return 0.5 + z - 0.5 * z * z.abs()
