"""HDR post-processing of all frames, key frames too: one after the other, in linear light.

Between two frames the network is told of the events since the earlier one, or of the frame before processing, as its
weights have it.  It starts afresh after a cut, and works on whole frames.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from interp.interpolate.fill import Filled, Work
from interp.interpolate.memory import as_arrays, nested
from interp.light import to_codes, to_light
from interp.networks.hdr import Hdr, HdrState
from interp.weights import load
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.manifest import sha256


class After:
    """Post-processing with the weights of a file.

    events   whether there are any
    Raises UsageError for weights that need events without them, DataError for those of another network.
    """

    def __init__(self, path: Path, events: bool, device: torch.device | str):
        network = load(path).to(device)
        if not isinstance(network, Hdr):
            raise DataError(f"{path} holds another network than hdr; give weights of `vid2ev train --network hdr`")
        self.network, self.device = network, device
        self.about = {"weights": str(path), "sha256": sha256(path)}
        self.needs_events = network.spec.second == "events"
        if self.needs_events and not events:
            raise UsageError(f"HDR with {path}, which was trained with events, and there are none; leave it out")
        self._state: HdrState | None = None
        self._rest: torch.Tensor | None = None  # events since the last frame
        self._shot = 0

    @torch.inference_mode()
    def frames(self, work: Work) -> Iterator[Filled]:
        """The frames of a stretch, processed."""
        events, since = work.events, torch.zeros(1, device=self.device)
        for frame in work.frames:
            light = to_light(torch.from_numpy(np.ascontiguousarray(np.moveaxis(frame.codes, -1, 0))), "srgb")
            light = light[None].to(self.device)
            share = torch.full((1,), float(frame.instant.share), device=self.device)
            window = self._window(events, since, share, light)
            if frame.shot != self._shot:
                self._shot, self._state, window = frame.shot, None, torch.zeros_like(window)
            second = window if self.needs_events else light
            made, self._state = self.network(light.expand(-1, self.network.spec.colours, -1, -1), second, self._state)
            codes = to_codes(made.clamp(min=0), "srgb")[0]
            codes = codes if len(codes) == frame.codes.shape[2] else codes.mean(0, keepdim=True)
            yield replace(frame, key=False, codes=codes.movedim(0, -1).cpu().numpy())
            since, self._rest = share, None
        if events is not None:
            rest = self._voxels(events, since, torch.ones_like(since))
            self._rest = rest if self._rest is None else self._rest + rest

    def memory(self) -> dict[str, np.ndarray]:
        """What it has to remember after a stretch."""
        state = self._state
        kept = None if state is None else (state.output, state.second, state.cell, state.carried)
        return as_arrays((kept, self._rest, torch.tensor(self._shot)))

    def remember(self, arrays: dict[str, np.ndarray]) -> None:
        """Take that up."""
        if arrays:
            kept, self._rest, shot = nested(arrays, self.device)
            self._shot = int(shot)
            self._state = None if kept is None else HdrState(*kept)

    def _window(self, events: Any, since: torch.Tensor, share: torch.Tensor, light: torch.Tensor) -> torch.Tensor:
        """The events since the frame before."""
        bins = self.network.spec.bins
        found = light.new_zeros(1, bins, *light.shape[2:])
        if events is not None and bool(share > since):
            found = self._voxels(events, since, share)
        return found if self._rest is None else found + self._rest

    def _voxels(self, events: Any, since: torch.Tensor, until: torch.Tensor) -> torch.Tensor:
        return events.voxels(since[None], until[None], self.network.spec.bins)[:, 0]
