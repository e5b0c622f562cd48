"""What a network begins to learn from, where it is not fresh weights: weights of a network that was trained before, and
weights for parts of it.

    rrin_events_guided-tiny   the network, and which it is: training goes on with new data, or with another recipe
    flow=RUN                  a part, such as the flow of RRINSloMoEvents, trained for itself; `pretrained` parts are
                              frozen, others go on learning

A run keeps copies of the files, so that it can be carried anywhere, and their digests are part of its job.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import nn

from interp import pretrained, weights
from interp.blocks.frozen import Frozen
from interp.networks import make, spec_of
from vid2ev.errors import UsageError

WHOLE = ""  # the part that is the network


def parsed(texts: Iterable[str]) -> dict[str, Path]:
    """Files by the part that they are for, of `WEIGHTS` and `PART=WEIGHTS`.

    Raises UsageError for files that are not there, and parts that are named twice.
    """
    found: dict[str, Path] = {}
    for text in texts:
        named = re.fullmatch(r"([a-z]\w*)=(.+)", text)
        part, path = (named[1], named[2]) if named else (WHOLE, text)
        if part in found:
            raise UsageError(f"start {text}: {f'part {part}' if part else 'the network'} has weights already; give one")
        found[part] = pretrained.path_of(path)
    return found


def network_of(path: Path) -> tuple[str, str, dict[str, Any]]:
    """Which network weights are of: its name, its size, and those options that are not its defaults."""
    name, spec = weights.about(path)
    size = str(spec.pop("size", "tiny"))
    usual = spec_of(name, size).model_dump(mode="json")
    return name, size, {key: value for key, value in spec.items() if key not in usual or value != usual[key]}


def digests(starts: Mapping[str, Path]) -> dict[str, str]:
    """What stands for the files in a job."""
    return {part: hashlib.sha256(path.read_bytes()).hexdigest() for part, path in starts.items()}


def check_frozen(name: str, size: str, options: Mapping[str, Any], parts: Iterable[str]) -> None:
    """Raise UsageError for a network with parts that are not to learn, and have no weights."""
    if WHOLE in (given := {*parts}):
        return
    with torch.device("meta"):
        network = make(name, size, **options)
    for part, module in network.named_children():
        if isinstance(module, Frozen) and part not in given:
            raise UsageError(
                f"network {name}: its {part} is to be pretrained; give the weights of a"
                f" {type(module.module).__name__}, such as --start {part}=RUN"
            )


def begin(network: nn.Module, starts: Mapping[str, Path]) -> None:
    """Give a network the weights, parts last.

    Raises UsageError for a part that it does not have, DataError for weights that are not of it.
    """
    for part, path in sorted(starts.items()):
        weights.load_part(network, part, path) if part else weights.fill(network, path)
