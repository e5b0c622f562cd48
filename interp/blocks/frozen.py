"""A network within a network that was trained before and is not trained on."""

from __future__ import annotations

from typing import Any, Self

import torch
from torch import nn


class Frozen(nn.Module):
    """Runs a module without gradients and always as in use, also while what is around it is trained."""

    def __init__(self, module: nn.Module):
        super().__init__()
        self.module = module.requires_grad_(False).eval()

    def train(self, mode: bool = True) -> Self:
        """Has no effect on what is frozen."""
        super().train(mode)
        self.module.eval()
        return self

    @torch.no_grad()
    def forward(self, *values: Any) -> Any:
        """What the module says."""
        return self.module(*values)
