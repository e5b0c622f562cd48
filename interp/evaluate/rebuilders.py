"""What gives frames to be scored: methods of `interp.methods`, each by the protocol's times."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import torch

from interp import pretrained
from interp.data.tensors import as_tensor
from interp.evaluate import protocol as protocols
from interp.evaluate.group import Footage, Group
from interp.evaluate.naming import apart
from interp.methods import METHODS, Gap, Method, open_method
from interp.methods.of_networks import of_weights
from interp.methods.tiling import tiling_for
from interp.own_codes import recoded, shown
from vid2ev.errors import UsageError, nearest
from vid2ev.recording.manifest import sha256

NOTHING: Mapping[str, Sequence[str]] = MappingProxyType({})


class Rebuilder(Protocol):
    """What gives the frames of groups."""

    @property
    def name(self) -> str:
        """For tables and files."""

    @property
    def identity(self) -> dict[str, Any]:
        """What tells it from another, ready for JSON."""

    @property
    def sequential(self) -> bool:
        """Whether groups must come in their order, all that there are."""

    @property
    def unfit(self) -> Mapping[str, Sequence[str]]:
        """Why frames of the sequence that are there cannot be scored: reason, and which they are."""

    @property
    def remarks(self) -> Sequence[str]:
        """What has to be known of it on the sequence, a sentence each that goes on after its name."""

    def begin(self, footage: Footage) -> Self:
        """The same for a sequence."""

    def frames(self, group: Group) -> Sequence[np.ndarray | None]:
        """Pictures at the positions of a group, uint8 [H, W, 3]; None for those that are not there."""


@dataclass
class OfMethod:
    """A method under a name, and the protocol that says for which times it is asked.

    Where groups are left out, across a cut or for want of events, it begins anew.
    """

    name: str
    identity: dict[str, Any]
    method: Method
    protocol: protocols.Protocol
    device: str = "cpu"
    unfit = NOTHING
    remarks: ClassVar[Sequence[str]] = ()
    _next: int = field(default=0, init=False)

    @property
    def sequential(self) -> bool:
        """See `Rebuilder`."""
        return self.method.sequential

    def begin(self, footage: Footage) -> Self:
        """See `Rebuilder`."""
        return replace(self, method=self.method.begin())

    def frames(self, group: Group) -> Sequence[np.ndarray | None]:
        """See `Rebuilder`."""
        if group.number != self._next:
            self.method = self.method.begin()
        self._next = group.number + 1
        keys = as_tensor(shown(group.keys, group.curve)).to(self.device)
        gap = Gap(keys[0], keys[1], group.events.to(self.device))
        targets = torch.from_numpy(self.protocol.targets(group.times_us)).float().to(self.device)
        images = self.method.images(gap, targets, tiling_for(self.method, gap))
        coded = [code for some in images for code in self.protocol.coded(recoded(some, group.curve))]
        return [coded[k] for k in self.protocol.picked]


def methods_of(
    baselines: Sequence[str], networks: Sequence[str | Path], protocol: protocols.Protocol, device: str = "cpu"
) -> list[OfMethod]:
    """Closed forms by their names, and networks by weights (`pretrained.path_of`); in this order.

    Raises UsageError for a name that is none and a device that is not there, DataError for a file that holds no network
    which rebuilds frames.
    """
    if not re.fullmatch(r"cpu|cuda(:\d+)?", device):
        raise UsageError(f"device '{device}': expected cpu or cuda")
    if device != "cpu" and not torch.cuda.is_available():
        raise UsageError(f"device '{device}': torch sees no GPU here; expected cpu, or a torch that sees one")
    if int(device.partition(":")[2] or 0) >= (cards := torch.cuda.device_count()) and device != "cpu":
        raise UsageError(f"device '{device}': torch sees GPUs up to cuda:{cards - 1} here; expected one of these")
    for name in baselines:
        if name not in METHODS:
            raise UsageError(f"baseline '{name}'{nearest(name, METHODS)}: expected some of {', '.join(METHODS)}")
    paths = [pretrained.path_of(network) for network in networks]
    forms = list(dict.fromkeys(baselines))
    found = [OfMethod(name, {"closed_form": name}, open_method(name, device), protocol, device) for name in forms]
    for name, path in zip(apart([*forms, *map(pretrained.name_of, paths)])[len(forms) :], paths, strict=True):
        method = of_weights(path, device, name)
        found.append(OfMethod(name, {"weights_sha256": sha256(path)}, method, protocol, device))
    return found
