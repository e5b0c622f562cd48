"""HDR post-processing of all frames, key frames too, in linear light.

What the network remembers goes from key frame to key frame, with all events between them; frames in between are seen
from the key frame before, with the events since.  So key frames do not depend on how many are made between them, which
no sensor took: where a key frame is clipped, these are near the top of its range, and would be believed there.
A key frame that is held stays what it becomes.  Weights for frames alone are told of the frame before processing.  All
starts afresh after a cut.

Light above white, of curves that go on there, is no end of a range: it is never made darker than it came.

Large frames are gone through in parts, with all around them that the network sees.  Of a network of one colour each
plane of frames in colours is a frame of its own, as each is clipped for itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import torch

from interp.blocks.recurrent import State
from interp.interpolate.fill import Filled, Work
from interp.interpolate.memory import as_arrays, nested
from interp.interpolate.stretches import CUT, UNRELATED
from interp.light import to_codes, to_light
from interp.methods.running import finite
from interp.methods.tiling import Tile, parse_tiling, strips
from interp.networks.hdr import AROUND, MULTIPLE, Hdr, HdrState
from interp.pretrained import name_of
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts
from interp.weights import load
from vid2ev.errors import UsageError
from vid2ev.recording.manifest import sha256


class After:
    """Post-processing with the weights of a file.

    events     whether there are any
    tile       the parts of large frames: see `interp.methods.tiling.parse_tiling`
    bright     whether frames may have light above white
    Raises UsageError for weights of another network, and such as need events without them.
    """

    def __init__(self, path: Path, events: bool, device: torch.device | str, tile: str = "auto", bright: bool = False):
        network = load(path).to(device)
        if not isinstance(network, Hdr):
            raise UsageError(f"{path} holds another network than hdr; give weights of `vid2ev train --network hdr`")
        self.name, self.network, self.device, self.tile, self.bright = name_of(path), network, device, tile, bright
        self.about = {"weights": str(path), "sha256": sha256(path)}
        self.needs_events = network.spec.second == "events"
        if self.needs_events and not events:
            raise UsageError(
                f"HDR by {self.name} needs events, with which it was trained; give some with --events, or leave it out"
            )
        self._state: HdrState | None = None
        self._rest: torch.Tensor | None = None  # events since the key frame that the state is of
        self._shot = 0

    @torch.inference_mode()
    def frames(self, work: Work) -> Iterator[Filled]:
        """The frames of a stretch, processed.  Raises DataError where the network makes no numbers."""
        if work.shot != self._shot:
            self._shot, self._state, self._rest = work.shot, None, None
        first, state = None, None
        if work.first.known:
            first, state = self._processed(work.first.codes, self._rest, self._state)
        held = work.remark in (CUT, UNRELATED)
        for frame in work.frames:
            if first is not None and frame.codes is work.first.codes:
                yield replace(frame, key=False, codes=first, light=None)
                continue
            before = state if frame.shot == work.shot else None
            since = self._voxels(work, 1 if held else frame.instant.share) if before else None
            codes, _ = self._processed(frame.codes, since, before)
            yield replace(frame, key=False, codes=codes, light=None)
        self._state, self._rest = state, self._voxels(work, 1)

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

    def _processed(
        self, codes: np.ndarray, since: torch.Tensor | None, state: HdrState | None
    ) -> tuple[np.ndarray, HdrState]:
        """A frame [H, W, C], with the events since the one that a state is of, and the state after it."""
        planes = torch.from_numpy(np.ascontiguousarray(np.moveaxis(codes, -1, 0)))
        light = to_light(planes, "srgb").to(self.device)
        colours = self.network.spec.colours
        frames = light[:, None] if colours == 1 else light.expand(colours, -1, -1)[None]
        window = light.new_zeros(1, self.network.spec.bins, *light.shape[1:]) if since is None else since
        second = window.expand(len(frames), -1, -1, -1) if self.needs_events else frames
        made, after = self.network(frames, second, state, residue=self.residue)
        made = finite(made, self.name)
        if self.bright:
            made = torch.where(frames > 1, torch.maximum(made, frames), made)
        found = to_codes(made.clamp(min=0), "srgb").flatten(0, 1)
        found = found if len(found) == len(light) else found.mean(0, keepdim=True)
        return found.movedim(0, -1).cpu().numpy(), after

    def residue(self, path_a: torch.Tensor, path_b: torch.Tensor, cell: State) -> tuple[torch.Tensor, State]:
        """`Hdr.residue`, part by part."""

        def law(tile: Tile) -> tuple[torch.Tensor, ...]:
            seen = tuple(tile.part_of(state, height) for state in cell)
            made, after = self.network.residue(path_a[(..., *tile.within)], path_b[(..., *tile.within)], seen)
            return made, *after

        height, width = path_a.shape[-2:]
        made, *after = parse_tiling(self.tile, (width, height), MULTIPLE).all_cells(law, AROUND)
        return made, tuple(after)

    def _voxels(self, work: Work, until: Fraction | int) -> torch.Tensor | None:
        """The events of a gap, from its key frame on, laid over the frames; None where they are not known."""
        if work.events is None:
            return None
        height, width = work.first.codes.shape[:2]
        edges = torch.tensor([[0.0], [float(until)]], device=self.device)

        def law(strip: Tile, events: EventCounts = work.events) -> torch.Tensor:
            laid = over(events, (height, width), strip.within)
            return laid.voxels(edges[:1], edges[1:], self.network.spec.bins)[:, 0]

        return strips(width, height).cells(law)
