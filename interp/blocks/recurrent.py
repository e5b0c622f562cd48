"""Convolutional recurrent cells, stable over long sequences.

    LSTM   i, f, o, g = conv[x, h]     c' = sigmoid(f) c + sigmoid(i) tanh(g)     h' = sigmoid(o) tanh(c')
    GRU    z, r = sigmoid(conv[x, h])  h' = (1 - z) h + z tanh(conv[x, r h])

States are float32 whatever the network's precision: small changes to them would be lost in 16 bits.  A cell c is held
within -16 ... 16, beyond which tanh does not tell values apart; without that it may grow by 1 with every step.  h is
within -1 ... 1. Weights start orthogonal, and the LSTM remembers at first (bias 1 on f).  None stands for a state of
zeros.

Sources: Shi et al. (2015), "Convolutional LSTM network", NeurIPS, without peepholes; Ballas et al. (2016), "Delving
deeper into convolutional networks for learning video representations", ICLR; the start, Jozefowicz et al. (2015), "An
empirical exploration of recurrent network architectures", ICML.
"""

from __future__ import annotations

import torch
from torch import nn

CELL_LIMIT = 16.0
State = tuple[torch.Tensor, ...]  # float32 [B, hidden, H, W] each


class ConvLstm(nn.Module):
    """An LSTM cell over pictures, 3 x 3."""

    def __init__(self, channels_in: int, hidden: int):
        super().__init__()
        self.hidden = hidden
        self.gates = nn.Conv2d(channels_in + hidden, 4 * hidden, 3, padding=1)
        _orthogonal(self.gates)
        with torch.no_grad():
            self.gates.bias[hidden : 2 * hidden] = 1  # type: ignore[index]

    def forward(self, x: torch.Tensor, state: State | None) -> tuple[torch.Tensor, State]:
        """The new h [B, hidden, H, W], and the state (h, c)."""
        h, c = state or (_zeros(x, self.hidden), _zeros(x, self.hidden))
        i, f, o, g = self.gates(torch.cat([x, h], 1)).float().chunk(4, 1)
        c = (torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(g)).clamp(-CELL_LIMIT, CELL_LIMIT)
        h = torch.sigmoid(o) * torch.tanh(c)
        return h, (h, c)


class ConvGru(nn.Module):
    """A GRU cell over pictures, 3 x 3."""

    def __init__(self, channels_in: int, hidden: int):
        super().__init__()
        self.hidden = hidden
        self.update, self.reset, self.out = (nn.Conv2d(channels_in + hidden, hidden, 3, padding=1) for _ in range(3))
        for gate in (self.update, self.reset, self.out):
            _orthogonal(gate)

    def forward(self, x: torch.Tensor, state: State | None) -> tuple[torch.Tensor, State]:
        """The new h [B, hidden, H, W], and the state (h,)."""
        (h,) = state or (_zeros(x, self.hidden),)
        both = torch.cat([x, h], 1)
        update, reset = (torch.sigmoid(gate(both).float()) for gate in (self.update, self.reset))
        fresh = torch.tanh(self.out(torch.cat([x, reset * h], 1)).float())
        h = h + update * (fresh - h)
        return h, (h,)


def detached(states: tuple[State | None, ...]) -> tuple[State | None, ...]:
    """States that gradients do not go back through."""
    return tuple(state and tuple(part.detach() for part in state) for state in states)


def _zeros(x: torch.Tensor, hidden: int) -> torch.Tensor:
    return x.new_zeros(len(x), hidden, *x.shape[-2:], dtype=torch.float32)


def _orthogonal(gate: nn.Conv2d) -> None:
    nn.init.orthogonal_(gate.weight)
    nn.init.zeros_(gate.bias)  # type: ignore[arg-type]
