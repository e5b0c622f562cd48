"""Pictures from events alone by a network: E2VID, FireNet.  A slice of events is a voxel grid, with exact times."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import torch

from interp.interpolate.memory import as_arrays, nested
from interp.light import to_light
from interp.methods.running import finite
from interp.methods.tiling import Tile, parse_tiling
from interp.networks.event_fed import EventFed, States
from interp.pretrained import name_of
from interp.representation.event_counts import as_voxels
from interp.weights import load
from vid2ev import Events
from vid2ev.errors import UsageError
from vid2ev.views.voxel import Voxel


class OfNetwork:
    """The network of a file for a sensor of a size (width, height).

    contrast   what an OFF and an ON event stand for [nat]
    tile       the parts of large pictures: see `interp.methods.tiling.parse_tiling`
    Raises UsageError for a network that takes frames, DataError for a file that holds none.
    """

    def __init__(
        self,
        path: Path,
        size: tuple[int, int],
        contrast: tuple[float, float],
        device: torch.device | str = "cpu",
        tile: str = "auto",
    ):
        network = load(path).to(device)
        if not isinstance(network, EventFed):
            raise UsageError(f"{path} holds a network that takes frames; give weights of e2vid or firenet")
        self.name, self.network, self.device, self.tile = name_of(path), network, device, tile
        off, on = contrast
        self._worth = torch.tensor([-off, on], dtype=torch.float32)[:, None, None, None]
        self._voxel = Voxel(size, int(network.spec.bins), polarity=True)  # type: ignore[arg-type, union-attr]
        self._states: States = ()

    def add(self, events: Events, start_us: int, stop_us: int, worth: np.ndarray | None = None) -> None:
        """See `Reconstructor`."""
        self._voxel.add(events, start_us, stop_us, worth)

    @torch.inference_mode()
    def picture(self, stop_us: int) -> np.ndarray:
        """Light [H, W] float32 at the end of the slice.  Raises DataError where the network makes no numbers."""
        nats = (torch.from_numpy(self._voxel.take(stop_us)) * self._worth).sum(0)
        image, self._states = self.network(as_voxels(nats)[None].to(self.device), self._states, self.step)
        return to_light(finite(image, self.name)[0, 0].float().clamp(0, 1), "srgb").cpu().numpy()

    def step(self, voxels: torch.Tensor, states: States) -> tuple[torch.Tensor, States]:
        """`EventFed.step`, large pictures part by part."""
        (height, width), shape = voxels.shape[-2:], list[int]()

        def law(tile: Tile) -> list[torch.Tensor]:
            seen = tuple(state and tuple(tile.part_of(each, height) for each in state) for state in states)
            image, after = self.network.step(voxels[(..., *tile.within)], seen)
            shape[:] = [len(state or ()) for state in after]
            return [image, *(each for state in after for each in state or ())]

        tiling = parse_tiling(self.tile, (width, height), 2 * self.network.multiple)
        image, *after = tiling.all_cells(law, self.network.around)
        rest = iter(after)
        return image, tuple(tuple(islice(rest, count)) for count in shape)

    def memory(self) -> dict[str, np.ndarray]:
        """All that it knows between two slices."""
        return as_arrays((self._states,))

    def remember(self, memory: dict[str, np.ndarray]) -> None:
        """Take that up."""
        (self._states,) = nested(memory, self.device)
